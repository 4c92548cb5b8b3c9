//! Arguments that are one name of a list of the core.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use scansion_core::classification::ClassifierKind;
use scansion_core::recipes::{Regularise, SegmentMethod};

/// Methods of segmentation.
pub(crate) fn segment_methods() -> impl TypedValueParser<Value = SegmentMethod> {
    choices(SegmentMethod::ALL, SegmentMethod::name, SegmentMethod::title)
}

/// Kinds of classifiers.
pub(crate) fn classifiers() -> impl TypedValueParser<Value = ClassifierKind> {
    choices(ClassifierKind::ALL, ClassifierKind::name, ClassifierKind::title)
}

/// Methods of regularisation.
pub(crate) fn regularisations() -> impl TypedValueParser<Value = Regularise> {
    choices(&Regularise::ALL, Regularise::name, Regularise::title)
}

/// Parses the name of one of `all`; help shows the names with their titles.
fn choices<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
    title: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let values = all.iter().map(|&choice| PossibleValue::new(name(choice)).help(title(choice)));
    PossibleValuesParser::new(values).try_map(move |text| {
        let found = all.iter().copied().find(|&choice| name(choice) == text);
        found.ok_or_else(|| format!("{text} is not in the list"))
    })
}
