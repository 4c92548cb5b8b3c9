//! `scansion train --weak`: trains on a few labels.

use super::labels::LabelSource;
use super::{Context, train};
use crate::args::{Format, Train};
use crate::exit_code::Failure;
use scansion_core::cloud::Cloud;
use scansion_core::io::{self, Columns};
use scansion_core::recipes::{LabelFile, Labels, WeakRecipe, WeakReport, train_weak};
use scansion_core::{Error, Result};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Train, mut recipe: WeakRecipe, context: &Context<'_>) -> std::result::Result<(), Failure> {
    recipe.labels.per_class = args.per_class.map_or(recipe.labels.per_class, |n| n as usize);
    let inputs: Vec<&Path> = args.inputs.iter().map(AsRef::as_ref).collect();
    let source = LabelSource::new(&args.labels, &[&inputs[..], args.weak_labels.as_deref().as_slice()].concat())?;
    let picked = args.weak_labels.as_deref().map(|path| picked(path, &source, context)).transpose()?;
    let clouds = inputs
        .iter()
        .map(|path| read(path, picked.as_ref(), (args, &recipe, &source), context))
        .collect::<Result<Vec<_>>>()?;
    if picked.is_none() {
        train::all_there(&source, &clouds)?;
    }
    let (model, report) = train_weak(&clouds, &recipe, &args.grid_strength, &context.monitor)?;
    model.save(&args.output)?;
    report.warnings.iter().for_each(|w| context.printer.warning(w));
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&report).unwrap_or_default(),
        Format::Csv => train::class_csv(&report.classes, "samples"),
        Format::Table => table(&report, &args.output),
    })
}

/// A label table, or the labels of a cloud.
fn picked(path: &Path, source: &LabelSource<'_>, context: &Context<'_>) -> Result<LabelFile> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ["csv", "txt", "tsv"].contains(&extension.as_str()) {
        return LabelFile::read(path);
    }
    let cloud = io::read_with(path, &context.read_options())?;
    let labels = source.read(path, &cloud, context)?;
    Ok(LabelFile::of_cloud(path, &cloud, &labels))
}

fn read(
    path: &Path,
    picked: Option<&LabelFile>,
    (args, recipe, source): (&Train, &WeakRecipe, &LabelSource<'_>),
    context: &Context<'_>,
) -> Result<(Cloud, Labels)> {
    let mut wanted = recipe.columns();
    wanted.push(if picked.is_some() { "ClusterID".into() } else { args.labels.label_dimension.clone() });
    let mut options = context.read_options();
    options.columns = Columns::Only(wanted);
    let cloud = io::read_with(path, &options)?;
    let metres = cloud.metres_per_unit.unwrap_or(1.0);
    let labels = match picked {
        Some(file) => (file.apply(&cloud, (metres, recipe.labels.within), &context.monitor))
            .map_err(|e| Error::input(format!("{}: {e}", path.display())))?,
        None => source.read(path, &cloud, context)?,
    };
    Ok((cloud, labels))
}

fn table(report: &WeakReport, output: &Path) -> String {
    let mut text = train::class_rows(&report.classes, "samples");
    let _ = writeln!(text, "{:>5}  {:<20} {:>12}", "", "unlabelled", report.unlabelled);
    for score in &report.partitions {
        let _ = writeln!(
            text,
            "segments of strength {:<8.4} could have {:.1} % of the labels right",
            score.strength,
            100.0 * score.accuracy
        );
    }
    for score in &report.strengths {
        let _ = writeln!(
            text,
            "strength {:<8} {:.2} % of the labels that were held out",
            score.strength,
            100.0 * score.accuracy
        );
    }
    let _ = write!(text, "strength of the field: {}\nmodel: {}", report.strength, output.display());
    text
}
