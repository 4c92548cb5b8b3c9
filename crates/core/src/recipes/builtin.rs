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

/// Mean confidence below which the built-in model does not know a cloud. Airborne scans have 0.8 to 0.98.
const LEAST_CONFIDENCE: f64 = 0.7;

/// Why the result of the built-in model should not be used: the cloud is not like an airborne scan. `None` if it may be.
pub fn builtin_misfit(result: &Classified) -> Option<String> {
    let confidence = result.mean_confidence().filter(|&c| c < LEAST_CONFIDENCE);
    let confidence = confidence.map(|c| format!("its mean confidence is {c:.2} (airborne scans: 0.8 and more)"));
    let dense = (result.density > DENSEST).then(|| {
        format!("there are {:.0} points per square metre (airborne and UAV scans: up to {DENSEST})", result.density)
    });
    let reasons: Vec<String> = [confidence, dense].into_iter().flatten().collect();
    (!reasons.is_empty()).then(|| {
        format!(
            "the built-in model is for airborne and UAV scans and does not know this cloud: {}",
            reasons.join(", and ")
        )
    })
}

/// What the built-in model has no class for, and what becomes of it with these rules.
pub fn builtin_limits(rules: &ClassRules) -> String {
    let searches = [
        (rules.cars.points > 0, "cars"),
        (rules.water.area > 0.0 && !rules.water.named, "water"),
        (rules.decks.length > 0.0, "decks of bridges"),
    ];
    let found: Vec<&str> = searches.into_iter().filter(|(on, _)| *on).map(|(_, name)| name).collect();
    let found = match found.as_slice() {
        [] => "the rules that find some of them are not applied".into(),
        [one] => format!("{one} that are found become unclassified"),
        [first @ .., last] => format!("{} and {last} that are found become unclassified", first.join(", ")),
    };
    format!(
        "the built-in model has no class for bridges, masts, water and cars, which become ground, building or vegetation; \
         {found}; `scansion train` makes models with other classes"
    )
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
