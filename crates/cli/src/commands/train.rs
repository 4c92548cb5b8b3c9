//! `scansion train`: trains a model on labelled clouds.

use super::labels::LabelSource;
use super::{Context, sources, train_objects, train_weak};
use crate::args::{Format, RecipeArgs, Train};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::classification::Model;
use scansion_core::cloud::Cloud;
use scansion_core::io::{self, Columns, ReadOptions};
use scansion_core::recipes::{self, AnyRecipe, ClassCount, Labels, TrainingReport};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Train, context: &Context<'_>) -> Result<(), Failure> {
    Model::check_output(&args.output)?;
    let mut recipe = match sources::any_recipe(&named(args))? {
        AnyRecipe::Pyramid(recipe) => *recipe,
        AnyRecipe::Weak(_) if args.classifier.is_some() => {
            return Err(Failure::Usage(
                "--classifier needs the recipe pyramid; the recipe weak learns a forest".into(),
            ));
        }
        AnyRecipe::Weak(recipe) => return train_weak::run(args, *recipe, context),
        AnyRecipe::Objects(recipe) => {
            without_weak(args)?;
            return train_objects::run(args, *recipe, context);
        }
    };
    without_weak(args)?;
    if let Some(classifier) = args.classifier {
        recipe.classifier = classifier.kind();
    }
    let columns: Vec<String> = recipe.features.columns().into_iter().map(String::from).collect();
    let clouds = read_all(args, &columns, context)?;
    if !args.grid_depth.is_empty() || args.cross_validate.is_some() {
        let folds = usize::from(args.cross_validate.unwrap_or(5));
        let scores = recipes::cross_validate(&clouds, &recipe, (&args.grid_depth, folds), &context.monitor)?;
        for score in &scores {
            let depth = score.max_depth.map_or("unlimited".into(), |d| d.to_string());
            context.printer.note(&format!(
                "depth {depth}: {folds}-fold accuracy {:.2} %, mean F1 {:.2} % (folds of 50 m squares)",
                100.0 * score.accuracy,
                100.0 * score.mean_f1
            ));
        }
        if let Some(best) = scores.iter().rev().max_by(|a, b| a.mean_f1.total_cmp(&b.mean_f1)) {
            recipe.set_max_depth(best.max_depth);
        }
    }
    let (model, report) = recipes::train(&clouds, &recipe, &context.monitor)?;
    model.save(&args.output)?;
    report.warnings.iter().for_each(|w| context.printer.warning(w));
    match context.printer.format {
        Format::Json => context.printer.data(&serde_json::to_string_pretty(&report).unwrap_or_default()),
        Format::Csv => context.printer.data(&class_csv(&report.classes, "samples")),
        Format::Table => context.printer.data(&table(&report, &args.output)),
    }
}

/// `--weak` is the same as `--recipe weak`.
fn named(args: &Train) -> RecipeArgs {
    let mut recipe = args.recipe.clone();
    if args.weak {
        recipe.recipe = Some("weak".into());
    }
    recipe
}

/// Refuses options that only the weak recipe has.
fn without_weak(args: &Train) -> Result<(), Failure> {
    match args.weak_labels.is_some() || args.per_class.is_some() || !args.grid_strength.is_empty() {
        true => Err(Failure::Usage("--weak-labels, --per-class and --grid-strength need --weak".into())),
        false => Ok(()),
    }
}

/// Reads all inputs with these columns, and their labels.
pub(super) fn read_all(
    args: &Train,
    columns: &[String],
    context: &Context<'_>,
) -> Result<Vec<(Cloud, Labels)>, Failure> {
    let inputs: Vec<&Path> = args.inputs.iter().map(AsRef::as_ref).collect();
    let source = LabelSource::new(&args.labels, &inputs)?;
    let options = ReadOptions {
        columns: Columns::Only([columns, std::slice::from_ref(&args.labels.label_dimension)].concat()),
        ..context.read_options()
    };
    let read = |path: &Path| -> Result<(Cloud, Labels), Failure> {
        let cloud = io::read_with(path, &options)?;
        let labels = source.read(path, &cloud, context)?;
        Ok((cloud, labels))
    };
    let clouds = inputs.into_iter().map(read).collect::<Result<Vec<_>, Failure>>()?;
    all_there(&source, &clouds)?;
    Ok(clouds)
}

/// Fails if a requested class has no labels.
pub(super) fn all_there(source: &LabelSource<'_>, clouds: &[(Cloud, Labels)]) -> Result<(), Failure> {
    match source.absent(clouds.iter().map(|(_, labels)| labels)) {
        Some(text) => Err(Error::input(text).into()),
        None => Ok(()),
    }
}

/// Table rows of the classes: points and samples; `samples` is the heading of the latter.
pub(super) fn class_rows(classes: &[ClassCount], samples: &str) -> String {
    let width = classes.iter().map(|c| c.name.len()).max().unwrap_or(0).max(20);
    let mut text = format!("{:>5}  {:<width$} {:>12} {samples:>12}\n", "code", "class", "points");
    for c in classes {
        let note = match c.samples {
            0 => "  left out".to_string(),
            _ if c.weight > 1.0 => format!("  each weighs {:.1}", c.weight),
            _ => String::new(),
        };
        let _ = writeln!(text, "{:>5}  {:<width$} {:>12} {:>12}{note}", c.code, c.name, c.points, c.samples);
    }
    text
}

/// One CSV line per class.
pub(super) fn class_csv(classes: &[ClassCount], samples: &str) -> String {
    let line = |c: &ClassCount| format!("{},{},{},{},{}\n", c.code, c.points, c.samples, c.weight, c.name);
    std::iter::once(format!("code,points,{samples},weight,class\n")).chain(classes.iter().map(line)).collect()
}

fn table(report: &TrainingReport, output: &Path) -> String {
    let mut text = class_rows(&report.classes, "samples");
    let _ = writeln!(text, "{:>5}  {:<20} {:>12}", "", "unlabelled, skipped", report.unlabelled);
    let _ = writeln!(
        text,
        "\n{} of {} features used, finest voxel {} m",
        report.used_features, report.features, report.first_scale
    );
    if let Some(score) = report.out_of_bag_accuracy {
        let _ = writeln!(
            text,
            "out-of-bag accuracy {:.2} % (neighbouring samples leak: expect less on a new scene)",
            100.0 * score
        );
    }
    let _ = write!(text, "model: {}", output.display());
    text
}
