//! `scansion train`: trains a model on labelled clouds.

use super::labels::LabelSource;
use super::{Context, sources};
use crate::args::{Format, RecipeArgs, Train};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::cloud::Cloud;
use scansion_core::evaluation::report::csv_field;
use scansion_core::io::{self, Columns, run};
use scansion_core::recipes::{
    AnyRecipe, CarReport, CarTraining, ClassCount, ContoursRecipe, EdgeLines, Grid, LabelFile, LabelledCloud, Labels,
    Model, PickedCloud, Picking, Report, SearchParams, SearchReport, TrainOptions, edge_labels, labelled_scenes,
    search,
};
use std::fmt::Write;
use std::path::{Path, PathBuf};

pub(crate) fn run(args: &Train, context: &Context<'_>) -> Result<(), Failure> {
    Model::check_output(&args.output)?;
    if let (Some(model), Some(code)) = (&args.add_cars_to, args.cars) {
        let model = sources::model(Some(model))?;
        sources::check_unit(model.fitted.recipe().metres_per_unit(), context.unit)?;
        return add_cars(args, &model, code, context);
    }
    let mut recipe = recipe(args)?;
    sources::check_unit(recipe.metres_per_unit(), context.unit)?;
    let mut options = TrainOptions {
        folds: args.cross_validate.map(usize::from),
        block: args.block,
        depths: args.grid_depth.clone(),
        strengths: args.grid_strength.clone(),
        elevation: sources::elevation(args.elevation_model.as_deref(), &context.monitor)?,
        checkpoint: args.checkpoint.clone(),
    };
    // Every recipe can be cross-validated, some by their own training, the others from outside.
    recipe.check_options(&TrainOptions { folds: None, ..options.clone() })?;
    if let Some(checkpoint) = &options.checkpoint {
        run::goes_on_from(checkpoint);
        io::check_output(checkpoint)?;
    }
    if !args.weak_labels.is_empty() && args.recipe.recipe.is_none() && !args.weak {
        context.printer.note("--weak-labels: the recipe weak is made for a few labels a class (--weak)");
    }
    if args.block.is_some() && args.grid.is_empty() && !options.cross_validates() {
        return Err(Failure::Usage("--block needs --cross-validate, --grid or --grid-depth".into()));
    }
    let mut clouds = match args.edges.is_empty() {
        true => read_all(args, &recipe, context)?,
        false => with_edges(args, &recipe, context)?,
    };
    if let Some(count) = args.synthetic {
        clouds.extend(labelled_scenes(contours_recipe(&recipe)?, count, &context.monitor)?);
    }
    let searched = searched(args, &recipe, &mut clouds, &options, context)?;
    if let Some(SearchReport { best, tried, .. }) = &searched {
        recipe = recipe.with_settings(tried[*best].settings.iter().map(String::as_str))?;
        // The folds have done their work, unless strengths are to be tried too.
        options.folds = options.folds.filter(|_| !options.strengths.is_empty());
    }
    let (model, report) = recipe.train(&clouds, &options, &context.monitor)?;
    model.save(&args.output)?;
    report.warnings().iter().for_each(|w| context.printer.warning(w));
    context.printer.data(&match context.printer.format {
        Format::Json => json(&*report, searched.as_ref())?,
        Format::Csv => {
            let further = searched.map(|search| search.csv()).into_iter().chain(report.csv());
            further.fold(class_csv(report.classes(), report.unit()), |all, table| all + "\n" + &table)
        }
        Format::Table => searched.map(|search| search.text()).unwrap_or_default() + &table(&*report, &args.output),
    })
}

/// Writes the model with a classifier of cars, whose code in the labels is `code`.
fn add_cars(args: &Train, model: &Model, code: u8, context: &Context<'_>) -> Result<(), Failure> {
    let clouds = read_all(args, &model.fitted.recipe(), context)?;
    let training = CarTraining { code, ..CarTraining::default() };
    let (model, report) = model.with_cars(&clouds, &training, &context.monitor)?;
    model.save(&args.output)?;
    let CarReport { points, cars, others } = report;
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&report).map_err(|e| Error::input(format!("report: {e}")))?,
        Format::Csv => format!("points,cars,others\n{points},{cars},{others}\n"),
        Format::Table => format!(
            "{points} points of cars; learned from {cars} samples of cars and {others} of other things\nmodel: {}",
            args.output.display()
        ),
    })
}

/// The cross-validation that was asked for, except that of the depths of the pyramid recipe, which is a part of its training
/// and need not compute features again.
fn searched(
    args: &Train,
    recipe: &AnyRecipe,
    clouds: &mut [LabelledCloud],
    options: &TrainOptions,
    context: &Context<'_>,
) -> Result<Option<SearchReport>, Failure> {
    let own = matches!(recipe, AnyRecipe::Pyramid(_)) || !options.depths.is_empty();
    if args.grid.is_empty() && (own || options.folds.is_none()) {
        return Ok(None);
    }
    let params = SearchParams {
        grid: Grid { axes: args.grid.clone() },
        folds: options.folds(),
        block: options.block,
        elevation: options.elevation.clone(),
    };
    Ok(Some(search(recipe, clouds, &params, &context.monitor)?))
}

/// The report, with the cross-validation under `search`.
fn json(report: &dyn Report, searched: Option<&SearchReport>) -> Result<String, Failure> {
    let text = report.json()?;
    let Some(searched) = searched else { return Ok(text) };
    let wrong = |e| Error::input(format!("report: {e}"));
    let mut value: serde_json::Value = serde_json::from_str(&text).map_err(wrong)?;
    value["search"] = serde_json::to_value(searched).map_err(wrong)?;
    Ok(serde_json::to_string_pretty(&value).map_err(wrong)?)
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
    run::warn_of_twice(&args.inputs, &context.monitor);
    let weak: Vec<&Path> = args.weak_labels.iter().map(AsRef::as_ref).collect();
    let source = LabelSource::new(&args.labels, &[&inputs[..], &weak[..]].concat())?;
    let files = weak.iter().map(|path| source.picked(path, context)).collect::<scansion_core::Result<Vec<_>>>()?;
    let labels = if files.is_empty() { args.labels.label_dimension.as_str() } else { "ClusterID" };
    let mut options = context.read_options();
    let segments = args.spread_over.clone();
    options.columns = Columns::Only([recipe.columns(), vec![labels.to_string()], Vec::from_iter(segments)].concat());
    if !files.is_empty() {
        let clouds =
            inputs.iter().map(|path| io::read_with(path, &options)).collect::<scansion_core::Result<Vec<_>>>()?;
        let picked = clouds.iter().map(|cloud| {
            let metres = cloud.metres(recipe.metres_per_unit())?;
            Ok(PickedCloud { cloud, picking: Picking { metres, within: recipe.label_distance() } })
        });
        let picked = picked.collect::<scansion_core::Result<Vec<_>>>()?;
        let labels = LabelFile::apply_all(&files, &picked, &context.monitor).map_err(|e| match (e, &inputs[..]) {
            (e @ (Error::Interrupted | Error::Memory { .. }), _) => e,
            (e, [one]) => Error::input(format!("{}: {e}", one.display())),
            (e, _) => e,
        })?;
        let clouds = clouds.into_iter().zip(labels).map(|(cloud, labels)| spread(args, cloud, labels));
        return with_all_classes(&source, clouds.collect::<Result<_, Failure>>()?, context);
    }
    let all = inputs.len();
    let read = |(number, path): (usize, &Path)| -> Result<LabelledCloud, Failure> {
        context.monitor.file(number + 1, all);
        let cloud = io::read_with(path, &options)?;
        let labels = source.read(path, &cloud, context)?;
        spread(args, cloud, labels)
    };
    let clouds = inputs.into_iter().enumerate().map(read).collect::<Result<Vec<_>, Failure>>()?;
    context.monitor.file(0, 0);
    with_all_classes(&source, clouds, context)
}

/// The clouds, if they have all classes of `--classes`.
fn with_all_classes(
    source: &LabelSource<'_>,
    clouds: Vec<LabelledCloud>,
    context: &Context<'_>,
) -> Result<Vec<LabelledCloud>, Failure> {
    source.unused().iter().for_each(|text| context.printer.warning(text));
    match source.absent(clouds.iter().map(|labelled| &labelled.labels)) {
        Some(text) => Err(Error::input(text).into()),
        None => Ok(clouds),
    }
}

/// The recipe of contours, which alone learns from lines and synthetic scenes.
fn contours_recipe(recipe: &AnyRecipe) -> Result<&ContoursRecipe, Failure> {
    match recipe {
        AnyRecipe::Contours(recipe) => Ok(recipe),
        other => Err(Failure::Usage(format!("--edges and --synthetic need --recipe contours, not {}", other.name()))),
    }
}

/// Reads all inputs; their labels are those of the lines along their edges.
fn with_edges(args: &Train, recipe: &AnyRecipe, context: &Context<'_>) -> Result<Vec<LabelledCloud>, Failure> {
    let own = contours_recipe(recipe)?;
    if args.edges.len() != args.inputs.len() {
        let found = format!("--edges: {} files for {} inputs", args.edges.len(), args.inputs.len());
        return Err(Failure::Usage(format!("{found}; one each is needed")));
    }
    let mut options = context.read_options();
    options.columns = Columns::Only(recipe.columns());
    let read = |(input, edges): (&PathBuf, &PathBuf)| {
        let cloud = io::read_with(input, &options)?;
        let edges = EdgeLines { lines: io::read_lines(edges)?, ..EdgeLines::default() };
        let labels = edge_labels(own, &cloud, edges, &context.monitor)?;
        Ok(LabelledCloud { cloud, labels })
    };
    args.inputs.iter().zip(&args.edges).map(read).collect()
}

/// A cloud with its labels, spread over segments if that is asked for.
fn spread(args: &Train, cloud: Cloud, labels: Labels) -> Result<LabelledCloud, Failure> {
    let labels = match &args.spread_over {
        Some(dimension) => labels.spread_over(&cloud, dimension)?,
        None => labels,
    };
    Ok(LabelledCloud { cloud, labels })
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
    let line = |c: &ClassCount| format!("{},{},{},{},{}\n", c.code, c.points, c.samples, c.weight, csv_field(&c.name));
    std::iter::once(format!("code,points,{samples},weight,class\n")).chain(classes.iter().map(line)).collect()
}

fn table(report: &dyn Report, output: &Path) -> String {
    format!("{}{}model: {}", class_rows(report.classes(), report.unit()), report.text(), output.display())
}
