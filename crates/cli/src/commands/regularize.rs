//! `scansion regularize`: makes the classes of neighbours agree, from the probabilities in a file.

use super::Context;
use super::codes::{Kept, Replaced, lost, replaced};
use crate::args::{Format, Regularize};
use crate::exit_code::Failure;
use scansion_core::classes::ClassTable;
use scansion_core::cloud::{Cloud, Column, MetricCloud, Values, names};
use scansion_core::io::{self, Columns, Edit};
use scansion_core::recipes::{ClassDimension, Regularise, RegulariseParams, regularise_cloud};
use serde::Serialize;

/// What is said about the result.
#[derive(Serialize)]
struct Summary {
    output: String,
    points: usize,
    /// Points whose class is not their own most probable one.
    changed: u64,
    energy: Option<f64>,
    /// Classes of the input that are written over although they have no probability.
    replaced: Vec<Replaced>,
}

pub(crate) fn run(args: &Regularize, context: &Context<'_>) -> Result<(), Failure> {
    io::check_cloud_output(&args.output)?;
    if let Some(name) = &args.to {
        io::check_dimension_name(&args.output, name)?;
        io::check_holds(&args.output, &format!("the dimension {name}"))?;
    }
    io::check_dimensions(&args.input, &args.output, &added(args, (Vec::new(), Vec::new())))?;
    context.tell_replaced(&args.input, args.to.as_deref())?;
    let params = params(args)?;
    let classes = match args.probabilities.is_empty() {
        true => {
            let known = io::inspect_with(&args.input, context.columns)?.dimensions;
            ClassDimension::among(&known, &ClassTable::default())?
        }
        false => args.probabilities.clone(),
    };
    let mut options = context.read_options();
    let mut wanted: Vec<String> = classes.iter().map(|class| class.name.clone()).collect();
    wanted.push(names::CLASSIFICATION.into());
    options.columns = Columns::Only(wanted);
    let cloud = io::read_with(&args.input, &options)?;
    io::check_coordinates(&args.input, &args.output, &cloud, &context.write_options())?;
    let scene = MetricCloud::new(&cloud, args.unit.unit, &context.monitor)?;
    let mut found = regularise_cloud(&scene, &classes, &params, &context.monitor)?;
    let mut kept = Kept::new(&args.keep);
    kept.look(&cloud);
    kept.tell(context);
    keep(&args.keep, &cloud, &mut found.codes);
    let known: Vec<u8> = classes.iter().map(|class| class.code).collect();
    let replaced = if args.to.is_none() { replaced(&cloud, &found.codes, &known, open(&cloud)) } else { Vec::new() };
    let summary = Summary {
        output: args.output.display().to_string(),
        points: cloud.len(),
        changed: found.changed,
        energy: found.energy,
        replaced,
    };
    drop(cloud);
    let edits = edits(args, (found.codes, found.confidence));
    let report = io::rewrite(&args.input, &args.output, &edits, &context.write_options())?;
    context.report(&args.output, &report);
    tell(&summary, context)
}

/// Codes that may be written over without a word: 1, too, if the cloud was never classified.
fn open(cloud: &Cloud) -> &'static [u8] {
    let codes = cloud.column(names::CLASSIFICATION).map(|column| &column.values);
    let named = codes.is_some_and(|codes| (0..codes.len()).any(|i| codes.get(i) > 1.0));
    if named { &[0] } else { &[0, 1] }
}

/// Puts back the codes of the input that are to be kept.
fn keep(kept: &[u8], cloud: &Cloud, codes: &mut [u8]) {
    let Some(old) = cloud.column(names::CLASSIFICATION).map(|column| &column.values) else { return };
    for (i, code) in codes.iter_mut().enumerate() {
        if let Some(&same) = kept.iter().find(|&&kept| (f64::from(kept) - old.get(i)).abs() < 0.5) {
            *code = same;
        }
    }
}

fn params(args: &Regularize) -> Result<RegulariseParams, Failure> {
    let base = RegulariseParams { method: Regularise::SegmentCrf, ..RegulariseParams::default() };
    let mut params = base.with_settings(args.set.iter().map(String::as_str))?;
    params.method = args.method.unwrap_or(params.method);
    let is_strength = |key: &str| ["strength", "regularise.strength"].contains(&key.trim());
    let set = args.set.iter().filter_map(|setting| setting.split_once('=')).any(|(key, _)| is_strength(key));
    let given = args.strength.is_some() || set;
    if given && !params.method.has_strength() {
        let method = params.method.name();
        return Err(Failure::Usage(format!("the method {method} has no strength; point-crf and segment-crf have one")));
    }
    params.strength = args.strength.unwrap_or(params.strength);
    params.validate()?;
    Ok(params)
}

/// The dimensions that are written beside the classification.
fn added(args: &Regularize, (codes, confidence): (Vec<u8>, Vec<f32>)) -> Vec<Column> {
    let own = args.to.iter().map(|name| Column::new(name, Values::U8(codes.clone())));
    own.chain([Column::new(names::CONFIDENCE, Values::F32(confidence))]).collect()
}

fn edits(args: &Regularize, (codes, confidence): (Vec<u8>, Vec<f32>)) -> Vec<Edit> {
    let mut edits = match args.to {
        Some(_) => Vec::new(),
        None => vec![Edit::Classification(codes.clone())],
    };
    edits.extend(added(args, (codes, confidence)).into_iter().map(Edit::Dimension));
    edits
}

fn tell(summary: &Summary, context: &Context<'_>) -> Result<(), Failure> {
    let Summary { points, changed, energy, .. } = summary;
    let lost = lost("have no probability", &summary.replaced);
    lost.iter().for_each(|text| context.printer.warning(&format!("{}: {text}", summary.output)));
    let share = 100.0 * *changed as f64 / (*points).max(1) as f64;
    let least = energy.map_or_else(String::new, |energy| format!(", energy {energy:.3}"));
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string(summary).unwrap_or_default(),
        Format::Csv => format!("points,changed,energy\n{points},{changed},{}\n", energy.unwrap_or(f64::NAN)),
        Format::Table => format!("{changed} of {points} points ({share:.2} %) changed class{least}\n"),
    })
}
