//! `scansion evaluate`: compare a classification with the truth.

use super::{Context, sources};
use crate::args::{Evaluate, Format};
use crate::exit_code::Failure;
use scansion_core::cloud::{Cloud, names};
use scansion_core::evaluation::{Confusion, report};
use scansion_core::io::{self, atomic};
use scansion_core::recipes::{self, ClassifyParams, LabelParams, read_labels};
use scansion_core::{Error, images};
use std::path::Path;

pub(crate) fn run(args: &Evaluate, context: &Context<'_>) -> Result<(), Failure> {
    let truth_params = sources::labels(&args.labels, &args.truth)?;
    let cloud = io::read_with(&args.truth, &context.read_options())?;
    let truth = read_labels(&cloud, &truth_params)?.codes;
    let predicted = predicted(args, &cloud, &truth_params, context)?;
    if predicted.len() != truth.len() {
        let text = format!(
            "{} points in the truth, {} in the prediction; both must be the same points in the same order",
            truth.len(),
            predicted.len()
        );
        return Err(Error::input(text).into());
    }
    let confusion = Confusion::from_options(&truth, &predicted)?;
    args.output.iter().try_for_each(|path| write(path, &confusion, context))?;
    context.printer.data(&match context.printer.format {
        Format::Json => report::to_json(&confusion)?,
        Format::Csv => report::to_csv(&confusion),
        Format::Table => report::to_table(&confusion),
    })
}

/// Codes of the prediction, mapped as the truth's, none skipped.
fn predicted(args: &Evaluate, cloud: &Cloud, truth: &LabelParams, context: &Context<'_>) -> Result<Vec<u8>, Failure> {
    if args.model.is_some() {
        let model = sources::model(args.model.as_deref())?;
        let result = recipes::classify(cloud, &model, &ClassifyParams::default(), &context.monitor)?;
        result.warnings.iter().for_each(|w| context.printer.warning(w));
        return Ok(result.codes.iter().map(|&c| truth.map.apply(c)).collect());
    }
    let default = if args.prediction.is_some() { names::CLASSIFICATION } else { "PredictedClassification" };
    let dimension = args.prediction_dimension.clone().unwrap_or_else(|| default.into());
    let params = LabelParams { dimension, map: truth.map.clone(), unlabelled: Vec::new(), classes: Vec::new() };
    let read = |path| io::read_with(path, &context.read_options());
    let other = args.prediction.as_deref().map(read).transpose()?;
    let other = other.as_ref().unwrap_or(cloud);
    same_places(cloud, other)?;
    // A point that the prediction leaves open counts as code 0: an error of the prediction.
    Ok(read_labels(other, &params)?.codes.into_iter().map(|c| c.unwrap_or(0)).collect())
}

/// Two files of equal length whose points stand elsewhere are not the same scan.
fn same_places(a: &Cloud, b: &Cloud) -> Result<(), Error> {
    let step = (a.len() / 1000).max(1);
    let apart = |i: &usize| {
        let (p, q) = (a.xyz(*i), b.xyz(*i));
        p.iter().zip(q).any(|(u, v)| (u - v).abs() > 0.01)
    };
    match (0..a.len().min(b.len())).step_by(step).find(apart) {
        Some(i) => Err(Error::input(format!(
            "point {i} stands at {:?} in the truth and at {:?} in the prediction",
            a.xyz(i),
            b.xyz(i)
        ))),
        None => Ok(()),
    }
}

fn write(path: &Path, confusion: &Confusion, context: &Context<'_>) -> Result<(), Failure> {
    let bytes = match path.extension().and_then(|e| e.to_str()) {
        Some("json") => report::to_json(confusion)?.into_bytes(),
        Some("csv") => report::to_csv(confusion).into_bytes(),
        Some("png") => images::confusion_picture(confusion).to_png(&context.monitor)?,
        _ => return Err(Failure::Usage(format!("{}: write .json, .csv or .png", path.display()))),
    };
    Ok(atomic::write_bytes(path, &bytes)?)
}
