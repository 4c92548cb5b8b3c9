//! `scansion train --weak`: learn from a few labels.

use super::{Context, sources};
use crate::args::{Format, Train};
use crate::exit_code::Failure;
use scansion_core::classes::preset;
use scansion_core::cloud::Cloud;
use scansion_core::io::{self, Columns};
use scansion_core::recipes::{LabelFile, Labels, WeakRecipe, WeakReport, read_labels, train_weak};
use scansion_core::{Error, Result};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Train, mut recipe: WeakRecipe, context: &Context<'_>) -> std::result::Result<(), Failure> {
    recipe.labels.per_class = args.per_class.map_or(recipe.labels.per_class, |n| n as usize);
    let picked = args.weak_labels.as_deref().map(|path| picked(path, args, context)).transpose()?;
    let clouds = args
        .inputs
        .iter()
        .map(|path| read(path, picked.as_ref(), (args, &recipe), context))
        .collect::<Result<Vec<_>>>()?;
    let (model, report) = train_weak(&clouds, &recipe, &args.grid_strength, &context.monitor)?;
    model.save(&args.output)?;
    report.warnings.iter().for_each(|w| context.printer.warning(w));
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&report).unwrap_or_default(),
        Format::Csv => csv(&report),
        Format::Table => table(&report, &args.output),
    })
}

/// A table of labels, or a cloud that has some.
fn picked(path: &Path, args: &Train, context: &Context<'_>) -> Result<LabelFile> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ["csv", "txt", "tsv"].contains(&extension.as_str()) {
        return LabelFile::read(path);
    }
    let cloud = io::read_with(path, &context.read_options())?;
    let labels = read_labels(&cloud, &sources::labels(&args.labels, path)?)?;
    Ok(LabelFile::of_cloud(path, &cloud, &labels))
}

fn read(
    path: &Path,
    picked: Option<&LabelFile>,
    (args, recipe): (&Train, &WeakRecipe),
    context: &Context<'_>,
) -> Result<(Cloud, Labels)> {
    let params = sources::labels(&args.labels, path)?;
    let mut wanted = recipe.columns();
    wanted.push(if picked.is_some() { "ClusterID".into() } else { params.dimension.clone() });
    let mut options = context.read_options();
    options.columns = Columns::Only(wanted);
    let cloud = io::read_with(path, &options)?;
    let metres = cloud.metres_per_unit.unwrap_or(1.0);
    let labels = match picked {
        Some(file) => file.apply(&cloud, (metres, recipe.labels.within), &context.monitor),
        None => read_labels(&cloud, &params),
    };
    let labels = labels.map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
    Ok((cloud, labels))
}

fn table(report: &WeakReport, output: &Path) -> String {
    let mut text = format!("{:>5}  {:<20} {:>12} {:>12}\n", "code", "class", "points", "samples");
    for class in &report.classes {
        let name = preset::asprs(class.code).name;
        let _ = writeln!(text, "{:>5}  {name:<20} {:>12} {:>12}", class.code, class.points, class.samples);
    }
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

fn csv(report: &WeakReport) -> String {
    let lines = report.classes.iter().map(|c| format!("{},{},{}\n", c.code, c.points, c.samples));
    std::iter::once("code,points,samples\n".to_string()).chain(lines).collect()
}
