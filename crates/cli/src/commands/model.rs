//! `scansion model show`: shows the contents of a model.

use super::{Context, sources};
use crate::args::{Format, Model};
use crate::exit_code::Failure;
use crate::printer::bar;
use scansion_core::classification::Predictor;
use scansion_core::recipes::{self, Model as ModelFile, RegulariseParams, Trained};
use std::fmt::Write;

pub(crate) fn run(args: &Model, context: &Context<'_>) -> Result<(), Failure> {
    let Model::Show { model, recipe } = args;
    let model = sources::model(model.as_deref())?;
    if *recipe {
        return context.printer.data(&model.fitted.recipe().to_toml()?);
    }
    if recipes::is_builtin(&model) {
        context.printer.note(&recipes::builtin_limits(&model.fitted.rules()));
    }
    let ranked = ranked(&model);
    context.printer.data(&match context.printer.format {
        Format::Json => json(&model, &ranked)?,
        Format::Csv => csv(&ranked),
        Format::Table => table(&model, &ranked),
    })
}

/// Features by decreasing importance.
fn ranked(model: &ModelFile) -> Vec<(&str, f64)> {
    let Trained { feature_names, classifier, .. } = &model.trained;
    let mut ranked: Vec<(&str, f64)> =
        feature_names.iter().map(String::as_str).zip(classifier.importance().iter().copied()).collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(b.0)));
    ranked
}

fn table(model: &ModelFile, ranked: &[(&str, f64)]) -> String {
    let trained = &model.trained;
    let parts: Vec<String> = trained.classifier.parts().iter().map(|p| format!("{} {}", p.count, p.kind)).collect();
    let mut text = format!(
        "{}: {}, {} features, trained at {:.1} points per square metre\n\
         regularisation: {}\n\n{:>5}  {:<20} {:>12}\n",
        trained.classifier.kind().name(),
        parts.join(", "),
        trained.feature_names.len(),
        trained.fingerprint.density,
        regularisation(model),
        "code",
        "class",
        "samples"
    );
    for (class, samples) in trained.classes.classes().iter().zip(&trained.fingerprint.class_counts) {
        let _ = writeln!(text, "{:>5}  {:<20} {samples:>12}", class.code, class.name);
    }
    let given = model.fitted.rules().given(&trained.classes);
    if given.classes() != trained.classes.classes() {
        let list: Vec<String> = given.classes().iter().map(|class| format!("{} {}", class.code, class.name)).collect();
        let free = trained.classes.free_code();
        let _ = writeln!(text, "\nclassify writes: {}; {free} where it does not know", list.join(", "));
    }
    if let Some(cars) = &trained.cars {
        let parts: Vec<String> = cars.parts().iter().map(|p| format!("{} {}", p.count, p.kind)).collect();
        let _ = writeln!(text, "cars are found, and left unclassified: {}, {}", cars.kind().name(), parts.join(", "));
    }
    let _ = writeln!(text, "\nmost important features (share of what the splits gained)");
    let largest = ranked.first().map_or(0.0, |(_, importance)| *importance);
    for (name, importance) in ranked.iter().take(20) {
        let _ = writeln!(text, "{name:>32} {:>6.2} %  {}", 100.0 * importance, bar(*importance, largest));
    }
    text
}

/// The method that `classify` uses, and the strength of a field.
fn regularisation(model: &ModelFile) -> String {
    let RegulariseParams { method, strength, .. } = model.fitted.regularise();
    match method.has_strength() {
        true => format!("{}, strength {strength}", method.name()),
        false => method.name().into(),
    }
}

fn csv(ranked: &[(&str, f64)]) -> String {
    let lines = ranked.iter().map(|(name, importance)| format!("{name},{importance}\n"));
    std::iter::once("feature,importance\n".to_string()).chain(lines).collect()
}

fn json(model: &ModelFile, ranked: &[(&str, f64)]) -> Result<String, Failure> {
    let mut value = serde_json::json!({
        "classifier": model.trained.classifier.kind(),
        "seed": model.fitted.seed(),
        "classes": model.trained.classes.classes(),
        "written_classes": model.fitted.rules().given(&model.trained.classes).classes(),
        "samples": model.trained.fingerprint.class_counts,
        "density": model.trained.fingerprint.density,
        "regularisation": regularisation(model),
        "cars": model.trained.cars.is_some(),
        "features": ranked.iter().map(|(name, importance)| serde_json::json!({"name": name, "importance": importance})).collect::<Vec<_>>(),
        "recipe": model.fitted.recipe().to_toml()?,
    });
    model.trained.classifier.parts().iter().for_each(|part| value[part.kind] = part.count.into());
    Ok(value.to_string())
}
