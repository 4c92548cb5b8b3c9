//! `scansion render`: draws a map or an oblique view as PNG.

use super::evaluate::{check_common_map, same_places};
use super::labels::{absent, codes_of, unused};
use super::{Context, sources};
use crate::args::{Render, ViewArg};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::classes::{ClassTable, LabelMap};
use scansion_core::cloud::{Cloud, Column, Values, names};
use scansion_core::images::{self, ColourBy, RenderParams, View};
use scansion_core::io::{self, atomic};
use scansion_core::recipes::{LabelParams, read_labels};
use std::path::Path;

pub(crate) fn run(args: &Render, context: &Context<'_>) -> Result<(), Failure> {
    if args.output.extension().and_then(|e| e.to_str()) != Some("png") {
        return Err(Failure::Usage(format!("{}: pictures are written as .png", args.output.display())));
    }
    io::check_output(&args.output)?;
    if args.view == ViewArg::Map {
        io::check_output(&args.output.with_extension("pgw"))?;
    }
    let range = args.range.as_deref().map(range).transpose()?;
    if args.view == ViewArg::Map && (args.azimuth.is_some() || args.elevation.is_some()) {
        return Err(Failure::Usage("--azimuth and --elevation need --view oblique".into()));
    }
    let inputs = sources::expanded(&args.inputs)?;
    let (mut cloud, notes) = io::read_together(&inputs, &context.read_options())?;
    notes.iter().for_each(|note| context.printer.note(note));
    let by = match &args.truth {
        Some(truth) => differences(&mut cloud, (truth, args), context)?,
        None => ColourBy::named(args.by.as_deref(), &cloud),
    };
    if range.is_some() && !matches!(by, ColourBy::Height | ColourBy::Dimension(_)) {
        return Err(Failure::Usage("--range needs colours by height or by a dimension (--by)".into()));
    }
    let drawn = args.clip.map_or(cloud.len(), |range| {
        (0..cloud.len()).filter(|&i| (range.low..=range.high).contains(&cloud.xyz(i)[2])).count()
    });
    let params = RenderParams {
        view: match args.view {
            ViewArg::Map => View::Map,
            ViewArg::Oblique => View::Oblique {
                azimuth_deg: args.azimuth.unwrap_or(30.0),
                elevation_deg: args.elevation.unwrap_or(35.0),
            },
        },
        by,
        width: args.width,
        height: args.height,
        shading: !args.no_shading,
        legend: !args.no_legend,
        title: args.title.clone(),
        range,
        clip: args.clip.map(|range| (range.low, range.high)),
        lines: args.contours.as_deref().map_or(Ok(Vec::new()), io::read_lines)?,
    };
    let image = images::render(&cloud, &ClassTable::default(), &params, &context.monitor)?;
    atomic::write_bytes(&args.output, &image.to_png(&context.monitor)?)?;
    if let Some(world) = image.world_file() {
        atomic::write_bytes(&args.output.with_extension("pgw"), world.as_bytes())?;
    }
    context.printer.note(&format!(
        "{}: {} x {} pixels, {} points",
        args.output.display(),
        image.width,
        image.height,
        drawn
    ));
    Ok(())
}

/// Adds the true classes to the cloud as a column.
fn differences(cloud: &mut Cloud, (truth, args): (&Path, &Render), context: &Context<'_>) -> Result<ColourBy, Failure> {
    let path = truth.display();
    let truth = io::read_with(truth, &context.read_options())?;
    let missing = || Error::input(format!("{path} has no {} to compare with", names::CLASSIFICATION));
    let codes = codes_of(&truth.column(names::CLASSIFICATION).ok_or_else(missing)?.values);
    let (option, map) = if args.map.is_empty() { ("--map-truth", &args.map_truth) } else { ("--map", &args.map) };
    let params = LabelParams {
        map: map.join(",").parse()?,
        unlabelled: args.unlabelled.codes(),
        classes: args.classes.clone(),
        ..LabelParams::default()
    };
    let labels = read_labels(&truth, &params).map_err(|e| Error::input(format!("{path}: {e}")))?;
    if truth.len() != cloud.len() {
        return Err(Error::input(format!("{path} has {} points, not {}", truth.len(), cloud.len())).into());
    }
    same_places(&truth, cloud)?;
    let unused_of_truth = unused(&params.map, &codes, option);
    let warnings = absent(&args.classes, &labels.counts()).into_iter().chain(unused_of_truth);
    warnings.for_each(|text| context.printer.warning(&text));
    let codes = labels.codes.iter().map(|code| code.map_or(-1, i16::from)).collect();
    cloud.set_column(Column::new("Truth", Values::I16(codes)))?;
    let found = cloud
        .column(names::CLASSIFICATION)
        .map(|column| &column.values)
        .ok_or_else(|| Error::input(format!("no {} to compare with {path}", names::CLASSIFICATION)))?;
    let (map, codes) = (args.map_predicted.join(",").parse::<LabelMap>()?, codes_of(found));
    check_common_map(&args.map.join(","), &codes)?;
    unused(&map, &codes, "--map-predicted").iter().for_each(|text| context.printer.warning(text));
    let mapped = found.to_f64().into_iter().map(|value| map.of_value(value).map_or(value, f64::from)).collect();
    cloud.set_column(Column::new("Predicted", Values::F64(mapped)))?;
    let (truth, prediction, classes) = ("Truth".into(), "Predicted".into(), Vec::new());
    Ok(match args.changes {
        true => ColourBy::Change { truth, prediction, classes },
        false => ColourBy::Agreement { truth, prediction, classes },
    })
}

fn range(text: &str) -> Result<(f64, f64), Failure> {
    let parsed = text.split_once(',').and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
    match parsed {
        Some((low, high)) if low < high => Ok((low, high)),
        _ => Err(Failure::Usage(format!("--range {text}: give LOW,HIGH with LOW below HIGH"))),
    }
}
