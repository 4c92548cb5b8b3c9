//! `scansion contours`: draws lines along the edges of objects.

use super::Context;
use crate::args::{Contours, Format};
use crate::exit_code::Failure;
use scansion_core::cloud::names;
use scansion_core::evaluation::report::csv_field;
use scansion_core::io::{self, Columns};
use scansion_core::recipes::{self, ContourParams, Model, contours, default_contour_model};
use scansion_core::{Error, Result};
use std::collections::BTreeMap;
use std::fmt::Write;

pub(crate) fn run(args: &Contours, context: &Context<'_>) -> std::result::Result<(), Failure> {
    io::check_drawing_output(&args.output)?;
    if !(0.0..=1.0).contains(&args.min_confidence) {
        return Err(Error::parameter("min-confidence", args.min_confidence, "0 to 1").into());
    }
    let model = model(args)?;
    let mut options = context.read_options();
    options.columns = Columns::Only([model.fitted.columns(), vec![names::CLASSIFICATION.into()]].concat());
    let cloud = io::read_with(&args.input, &options)?;
    let params = ContourParams {
        metres_per_unit: args.unit.unit,
        codes: None,
        without: args.without.clone(),
        min_confidence: args.min_confidence,
    };
    let found = contours(&cloud, &model, &params, &context.monitor)?;
    found.warnings.iter().for_each(|warning| context.printer.warning(warning));
    let drawing = found.drawing(&cloud);
    io::write_drawing(&args.output, &drawing, &context.monitor)?;
    context.tell_no_place(&args.output, &cloud);
    if found.lines.is_empty() {
        context.printer.warning("no edges were found; finer ones need a smaller --voxel");
    }
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&found).map_err(|e| Error::input(e.to_string()))?,
        format => layers(&found, &drawing, format),
    })
}

/// The model with the settings of the arguments.
fn model(args: &Contours) -> Result<Model> {
    let model = args.model.as_deref().map_or_else(default_contour_model, Model::load)?;
    let voxel = args.voxel.map(|voxel| format!("voxel={voxel}"));
    let settings: Vec<&str> = args.set.iter().chain(&voxel).map(String::as_str).collect();
    Ok(Model { fitted: model.fitted.with_settings(settings)?, ..model })
}

/// Number and length of the lines of each layer.
fn layers(found: &recipes::Contours, drawing: &io::Drawing, format: Format) -> String {
    let mut layers: BTreeMap<&str, [f64; 2]> = BTreeMap::new();
    for (line, drawn) in found.lines.iter().zip(&drawing.lines) {
        let [count, length] = layers.entry(&drawn.layer).or_default();
        *count += 1.0;
        *length += line.length;
    }
    if format == Format::Csv {
        let rows = layers.iter().map(|(name, [count, length])| format!("{},{count},{length:.3}\n", csv_field(name)));
        return std::iter::once("layer,lines,metres\n".to_string()).chain(rows).collect();
    }
    let width = layers.keys().map(|name| name.chars().count()).max().unwrap_or(0).max(20);
    let mut text = format!("{:<width$} {:>8} {:>12}\n", "layer", "lines", "metres");
    for (name, [count, length]) in &layers {
        let _ = writeln!(text, "{name:<width$} {count:>8} {length:>12.1}");
    }
    let _ = write!(
        text,
        "\nvoxels of {:.3} m; {} points, {} seeds, {} candidates, {} lines",
        found.voxel,
        found.points,
        found.seeds,
        found.candidates,
        found.lines.len()
    );
    text
}
