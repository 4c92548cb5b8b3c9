//! `scansion render`: draws a map or an oblique view as PNG.

use super::Context;
use crate::args::{Render, ViewArg};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::classes::ClassTable;
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
    let mut cloud = io::read_with(&args.input, &context.read_options())?;
    let by = match &args.truth {
        Some(truth) => differences(&mut cloud, (truth, args), context)?,
        None => colour_by(args.by.as_deref(), &cloud),
    };
    let params = RenderParams {
        view: match args.view {
            ViewArg::Map => View::Map,
            ViewArg::Oblique => View::Oblique { azimuth_deg: args.azimuth, elevation_deg: args.elevation },
        },
        by,
        width: args.width,
        height: args.height,
        shading: !args.no_shading,
        legend: !args.no_legend,
        title: args.title.clone(),
        range,
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
        cloud.len()
    ));
    Ok(())
}

/// Adds the true classes to the cloud as a column.
fn differences(cloud: &mut Cloud, (truth, args): (&Path, &Render), context: &Context<'_>) -> Result<ColourBy, Failure> {
    let path = truth.display();
    let truth = io::read_with(truth, &context.read_options())?;
    let missing = || Error::input(format!("{path} has no {} to compare with", names::CLASSIFICATION));
    truth.column(names::CLASSIFICATION).ok_or_else(missing)?;
    let params =
        LabelParams { unlabelled: args.unlabelled.codes(), classes: args.classes.clone(), ..LabelParams::default() };
    let labels = read_labels(&truth, &params).map_err(|e| Error::input(format!("{path}: {e}")))?;
    if truth.len() != cloud.len() {
        return Err(Error::input(format!("{path} has {} points, not {}", truth.len(), cloud.len())).into());
    }
    let codes = labels.codes.iter().map(|code| code.map_or(-1, i16::from)).collect();
    cloud.set_column(Column::new("Truth", Values::I16(codes)))?;
    Ok(ColourBy::Agreement { truth: "Truth".into(), prediction: names::CLASSIFICATION.into(), classes: Vec::new() })
}

fn range(text: &str) -> Result<(f64, f64), Failure> {
    let parsed = text.split_once(',').and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
    match parsed {
        Some((low, high)) if low < high => Ok((low, high)),
        _ => Err(Failure::Usage(format!("--range {text}: give LOW,HIGH with LOW below HIGH"))),
    }
}

fn colour_by(asked: Option<&str>, cloud: &Cloud) -> ColourBy {
    match asked {
        Some("class") => ColourBy::Class,
        Some("height") => ColourBy::Height,
        Some("rgb") => ColourBy::Colour,
        Some(name) if name.starts_with("ClusterID") => ColourBy::Segments(name.to_string()),
        Some(name) => ColourBy::Dimension(name.to_string()),
        None if cloud.column(names::CLASSIFICATION).is_some() => ColourBy::Class,
        None => ColourBy::Height,
    }
}
