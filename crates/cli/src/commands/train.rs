//! `scansion train`: learn a model from labelled clouds.

use super::{Context, sources, train_objects, train_weak};
use crate::args::{Format, RecipeArgs, Train};
use crate::exit_code::Failure;
use scansion_core::classes::preset;
use scansion_core::cloud::Cloud;
use scansion_core::io::{self, Columns, ReadOptions};
use scansion_core::recipes::{self, AnyRecipe, LabelParams, Labels, TrainingReport, read_labels};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Train, context: &Context<'_>) -> Result<(), Failure> {
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
    let clouds = args
        .inputs
        .iter()
        .map(|path| read(path, &sources::labels(&args.labels, path)?, &columns, context))
        .collect::<Result<Vec<_>, Failure>>()?;
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
    match context.printer.format {
        Format::Json => context.printer.data(&serde_json::to_string_pretty(&report).unwrap_or_default()),
        Format::Csv => context.printer.data(&csv(&report)),
        Format::Table => context.printer.data(&table(&report, &args.output)),
    }
}

/// `--weak` is `--recipe weak`.
fn named(args: &Train) -> RecipeArgs {
    let mut recipe = args.recipe.clone();
    if args.weak {
        recipe.recipe = Some("weak".into());
    }
    recipe
}

/// Refuses what only the weak recipe knows.
fn without_weak(args: &Train) -> Result<(), Failure> {
    match args.weak_labels.is_some() || args.per_class.is_some() || !args.grid_strength.is_empty() {
        true => Err(Failure::Usage("--weak-labels, --per-class and --grid-strength need --weak".into())),
        false => Ok(()),
    }
}

/// A cloud with these columns, and its labels.
pub(super) fn read(
    path: &Path,
    labels: &LabelParams,
    columns: &[String],
    context: &Context<'_>,
) -> Result<(Cloud, Labels), Failure> {
    let mut wanted = columns.to_vec();
    wanted.push(labels.dimension.clone());
    let options = ReadOptions { columns: Columns::Only(wanted), ..context.read_options() };
    let cloud = io::read_with(path, &options)?;
    let labels =
        read_labels(&cloud, labels).map_err(|e| scansion_core::Error::input(format!("{}: {e}", path.display())))?;
    if labels.unlabelled > 0 {
        context.printer.note(&format!(
            "{}: {} of {} points are unlabelled and skipped",
            path.display(),
            labels.unlabelled,
            cloud.len()
        ));
    }
    Ok((cloud, labels))
}

fn table(report: &TrainingReport, output: &Path) -> String {
    let mut text = format!("{:>5}  {:<20} {:>12} {:>12}\n", "code", "class", "points", "samples");
    for class in &report.classes {
        let name = preset::asprs(class.code).name;
        let _ = writeln!(text, "{:>5}  {name:<20} {:>12} {:>12}", class.code, class.points, class.samples);
    }
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

fn csv(report: &TrainingReport) -> String {
    let lines = report.classes.iter().map(|c| format!("{},{},{}\n", c.code, c.points, c.samples));
    std::iter::once("code,points,samples\n".to_string()).chain(lines).collect()
}
