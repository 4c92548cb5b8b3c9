//! `scansion train --recipe objects`: trains the classification of segments.

use super::{Context, train};
use crate::args::{Format, Train};
use crate::exit_code::Failure;
use scansion_core::evaluation::Scores;
use scansion_core::recipes::{ClassCount, ObjectsRecipe, ObjectsReport, train_objects};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Train, mut recipe: ObjectsRecipe, context: &Context<'_>) -> Result<(), Failure> {
    if args.cross_validate.is_some() || !args.grid_depth.is_empty() {
        return Err(Failure::Usage("--cross-validate and --grid-depth need the recipe pyramid".into()));
    }
    if let Some(classifier) = args.classifier {
        recipe.classifier = classifier.kind();
    }
    let clouds = train::read_all(args, &recipe.columns(), context)?;
    let (model, report) = train_objects(&clouds, &recipe, &context.monitor)?;
    model.save(&args.output)?;
    report.warnings.iter().for_each(|w| context.printer.warning(w));
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&report).unwrap_or_default(),
        Format::Csv => train::class_csv(&report.classes, "segments"),
        Format::Table => table(&report, &args.output),
    })
}

fn table(report: &ObjectsReport, output: &Path) -> String {
    let mut text = train::class_rows(&report.classes, "segments");
    let _ = writeln!(
        text,
        "\n{} segments, {} labelled, {} learned from; naming whole segments could reach {:.2} %",
        report.segments,
        report.labelled,
        report.learned,
        100.0 * report.oracle_accuracy
    );
    for (scores, what) in [(&report.by_segment, "segments"), (&report.by_point, "points")] {
        scores.iter().for_each(|scores| text += &held_out(scores, (&report.classes, what)));
    }
    let _ = write!(text, "model: {}", output.display());
    text
}

/// Scores of the segments that were not used for training.
fn held_out(scores: &Scores, (classes, what): (&[ClassCount], &str)) -> String {
    let mut text = format!(
        "\nthe other {} {what}: accuracy {:.2} %, mean F1 {:.2} %\n{:>5}  {:<20} {:>10} {:>10} {:>10} {:>10}\n",
        scores.points,
        100.0 * scores.overall_accuracy,
        100.0 * scores.mean_f1_score,
        "code",
        "class",
        "precision",
        "recall",
        "F1",
        what
    );
    for class in &scores.labels {
        let name = classes.iter().find(|c| c.code == class.code).map_or(&class.name, |c| &c.name);
        let percent = [class.precision, class.recall, class.f1_score].map(|v| format!("{:.2} %", 100.0 * v));
        let [precision, recall, f1] = percent;
        let _ =
            writeln!(text, "{:>5}  {name:<20} {precision:>10} {recall:>10} {f1:>10} {:>10}", class.code, class.support);
    }
    text
}
