//! The built-in model: ground, vegetation and building in airborne scans.

use super::classify::Classified;
use super::classify::rules::ClassRules;
use super::model::Model;
use crate::error::Result;
use std::path::Path;

/// Mapping of the classes of a labelled scan to those that the built-in model learned: all vegetation is 5.
pub const BUILTIN_MAP: &str = "3-4=5";

/// More points per square metre than any airborne or UAV scan has.
const DENSEST: f64 = 2000.0;

/// [`Classified::density_spread`] of scans from the ground: those of streets have 1.8 and more, airborne scans up to 1.3.
const UNEVEN: f64 = 1.5;

/// Share of squares whose first returns lie above the last ones: eight airborne scans have 0.97 and more.
const FALLING: f64 = 0.5;

/// Mean confidence below which the built-in model does not know a cloud. Airborne scans have 0.8 to 0.98, those of slopes above
/// 20 degrees less.
const LEAST_CONFIDENCE: f64 = 0.7;

/// Why the result of the built-in model should not be used, and what to do: the cloud is not like an airborne scan. `None` if
/// it may be.
pub fn builtin_misfit(result: &Classified) -> Option<String> {
    let confidence = result.mean_confidence().filter(|&c| c < LEAST_CONFIDENCE);
    let confidence = confidence.map(|c| format!("its mean confidence is {c:.2} (airborne scans: 0.8 and more)"));
    let dense = (result.density > DENSEST).then(|| {
        format!("there are {:.0} points per square metre (airborne and UAV scans: up to {DENSEST})", result.density)
    });
    let uneven = (result.density_spread > UNEVEN).then(|| {
        "the density falls off everywhere, as around a scanner on the ground (airborne and UAV scans are even)".into()
    });
    let turned = result.returns_falling.filter(|&share| share < FALLING);
    let turned =
        turned.map(|_| "the last returns of its pulses lie above the first ones: its heights are upside down".into());
    let advice = match turned {
        Some(_) => "turn them over first (z times -1)",
        None => "`scansion train` makes models of such clouds",
    };
    let reasons: Vec<String> = [confidence, dense, uneven, turned].into_iter().flatten().collect();
    (!reasons.is_empty()).then(|| {
        format!(
            "the built-in model is for airborne and UAV scans and does not know this cloud: {}; {advice}",
            reasons.join(", and ")
        )
    })
}

/// Whether this is the built-in model, perhaps saved under another name, with other names of its classes, or with cars learned
/// anew.
pub fn is_builtin(model: &Model) -> bool {
    default_model().is_ok_and(|own| own.trained.classifier == model.trained.classifier)
}

/// What the built-in model has no class for, and what becomes of it with these rules.
pub fn builtin_limits(rules: &ClassRules) -> String {
    let searches = [
        (rules.cars.points > 0, "cars"),
        (rules.water.area > 0.0, "water"),
        (rules.decks.length > 0.0, "decks of bridges"),
    ];
    let named = |name: &str| name == "water" && rules.water.named;
    let those = |wanted: &dyn Fn(bool, &str) -> bool| -> Vec<&str> {
        searches.into_iter().filter(|&(on, name)| wanted(on, name)).map(|(_, name)| name).collect()
    };
    let unclassified = listed(&those(&|on, name| on && !named(name)));
    let parts = [
        unclassified.map(|names| format!("{names} that are found become unclassified")),
        (!those(&|on, name| on && named(name)).is_empty()).then(|| "water that is found becomes water (9)".into()),
        listed(&those(&|on, _| !on)).map(|names| format!("not looked for: {names}")),
    ];
    let found: Vec<String> = parts.into_iter().flatten().collect();
    format!(
        "the built-in model has no class for bridges, masts, water and cars, which become ground, building or vegetation; \
         {}; `scansion train` makes models with other classes",
        found.join(", ")
    )
}

/// Words with commas and "and" between them; `None` if there is none.
fn listed(words: &[&str]) -> Option<String> {
    match words {
        [] => None,
        [one] => Some((*one).into()),
        [first @ .., last] => Some(format!("{} and {last}", first.join(", "))),
    }
}

const BYTES: &[u8] = include_bytes!("../../assets/default.model");

const CONTOURS: &[u8] = include_bytes!("../../assets/contours.model");

/// The built-in model for contours, trained by `scripts/contour-model` on synthetic streets and rooms.
///
/// # Errors
/// Never: the embedded file is valid.
pub fn default_contour_model() -> Result<Model> {
    Model::from_bytes(CONTOURS, Path::new("built-in model for contours"))
}

/// The built-in model for airborne scans (ASPRS codes 2 ground, 5 vegetation, 6 building; the rules of its recipe divide
/// vegetation into 3, 4 and 5 by its height, and find noise). [`builtin_limits`] says what it has no class for.
///
/// It was trained by `scripts/default-model` on the clouds listed there; `docs/default-model.md` reports its accuracy
/// on scenes not used for training.
///
/// # Errors
/// Never: the embedded file is valid.
pub fn default_model() -> Result<Model> {
    Model::from_bytes(BYTES, Path::new("built-in model"))
}
