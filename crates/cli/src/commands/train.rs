//! `scansion train`: trains a model on labelled clouds.

use super::labels::LabelSource;
use super::{Context, sources};
use crate::args::{Format, RecipeArgs, Train};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::io::{self, Columns};
use scansion_core::recipes::{AnyRecipe, ClassCount, LabelFile, LabelledCloud, Model, Picking, Report, TrainOptions};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Train, context: &Context<'_>) -> Result<(), Failure> {
    Model::check_output(&args.output)?;
    let recipe = recipe(args)?;
    let options = TrainOptions {
        folds: args.cross_validate.map(usize::from),
        depths: args.grid_depth.clone(),
        strengths: args.grid_strength.clone(),
        elevation: sources::elevation(args.elevation_model.as_deref(), &context.monitor)?,
    };
    let clouds = read_all(args, &recipe, context)?;
    let (model, report) = recipe.train(&clouds, &options, &context.monitor)?;
    model.save(&args.output)?;
    report.warnings().iter().for_each(|w| context.printer.warning(w));
    context.printer.data(&match context.printer.format {
        Format::Json => report.json()?,
        Format::Csv => class_csv(report.classes(), report.unit()),
        Format::Table => table(&*report, &args.output),
    })
}

/// The recipe with the settings that have a flag of their own; `--weak` is the same as `--recipe weak`.
fn recipe(args: &Train) -> Result<AnyRecipe, Failure> {
    let weak = args.weak.then(|| "weak".into());
    let named = RecipeArgs { recipe: weak.or_else(|| args.recipe.recipe.clone()), ..args.recipe.clone() };
    let mut recipe = sources::any_recipe(&named)?;
    let classifier = args.classifier.map(|c| ("--classifier", format!("classifier={}", c.name())));
    let per_class = args.per_class.map(|n| ("--per-class", format!("labels.per_class={n}")));
    for (flag, setting) in classifier.into_iter().chain(per_class) {
        recipe = recipe.with_settings([setting.as_str()]).map_err(|_| {
            let (key, _) = setting.split_once('=').unwrap_or_default();
            Failure::Usage(format!("{flag} sets {key}, which the recipe {} does not have", recipe.name()))
        })?;
    }
    recipe.validate()?;
    Ok(recipe)
}

/// Reads all inputs and their labels.
fn read_all(args: &Train, recipe: &AnyRecipe, context: &Context<'_>) -> Result<Vec<LabelledCloud>, Failure> {
    let inputs: Vec<&Path> = args.inputs.iter().map(AsRef::as_ref).collect();
    let source = LabelSource::new(&args.labels, &[&inputs[..], args.weak_labels.as_deref().as_slice()].concat())?;
    let picked = args.weak_labels.as_deref().map(|path| picked(path, &source, context)).transpose()?;
    let labels = if picked.is_some() { "ClusterID" } else { args.labels.label_dimension.as_str() };
    let mut options = context.read_options();
    options.columns = Columns::Only([recipe.columns(), vec![labels.to_string()]].concat());
    let read = |path: &Path| -> Result<LabelledCloud, Failure> {
        let cloud = io::read_with(path, &options)?;
        let labels = match &picked {
            Some(file) => {
                let metres = cloud.metres(recipe.metres_per_unit())?;
                let picking = Picking { metres, within: recipe.label_distance() };
                (file.apply(&cloud, &picking, &context.monitor))
                    .map_err(|e| Error::input(format!("{}: {e}", path.display())))?
            }
            None => source.read(path, &cloud, context)?,
        };
        Ok(LabelledCloud { cloud, labels })
    };
    let clouds = inputs.into_iter().map(read).collect::<Result<Vec<_>, Failure>>()?;
    match source.absent(clouds.iter().map(|labelled| &labelled.labels)) {
        Some(text) if picked.is_none() => Err(Error::input(text).into()),
        _ => Ok(clouds),
    }
}

/// A label table, or the labels of a cloud.
fn picked(path: &Path, source: &LabelSource<'_>, context: &Context<'_>) -> Result<LabelFile, Failure> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ["csv", "txt", "tsv"].contains(&extension.as_str()) {
        return Ok(LabelFile::read(path)?);
    }
    let cloud = io::read_with(path, &context.read_options())?;
    let labels = source.read(path, &cloud, context)?;
    Ok(LabelFile::of_cloud(path, &cloud, &labels))
}

/// Table rows of the classes: points and samples; `samples` is the heading of the latter.
fn class_rows(classes: &[ClassCount], samples: &str) -> String {
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
fn class_csv(classes: &[ClassCount], samples: &str) -> String {
    let line = |c: &ClassCount| format!("{},{},{},{},{}\n", c.code, c.points, c.samples, c.weight, c.name);
    std::iter::once(format!("code,points,{samples},weight,class\n")).chain(classes.iter().map(line)).collect()
}

fn table(report: &dyn Report, output: &Path) -> String {
    format!("{}{}model: {}", class_rows(report.classes(), report.unit()), report.text(), output.display())
}
