//! Recipes: the published methods from cloud to labels. Each file reads like the method section of its paper; the
//! parameters are saved as TOML.

mod any;
mod builtin;
mod classify;
mod labels;
mod objects;
mod points;
mod recipe;
mod regularise;
mod segment;
mod segments;
mod suggest;
mod train;
mod training;
mod weak;

pub use any::AnyRecipe;
pub use builtin::{BUILTIN_MAP, default_model};
pub use classify::{Classified, ClassifyParams, classify};
pub use labels::{LabelParams, Labels, read_labels};
pub use objects::{
    Heights, ObjectSegments, ObjectTraining, ObjectsKind, ObjectsRecipe, ObjectsReport, SupervoxelMode, train_objects,
};
pub use recipe::{PyramidKind, Recipe, set_key};
pub use regularise::{Posterior, Probabilities, Regularise, RegulariseParams, Regularised, regularise};
pub use segment::{GrowingParams, LevelReport, SegmentMethod, SegmentParams, SegmentReport, Segmented, segment};
pub use suggest::{SuggestParams, Suggestion, suggest};
pub use train::{DepthScore, cross_validate, train};
pub use training::{ClassCount, TrainingParams, TrainingReport, planar_density};
pub use weak::{
    ClassShares, Descriptors, Example, LabelFile, RoadParams, RoadSource, StrengthScore, WeakKind, WeakLabels,
    WeakRecipe, WeakReport, train_weak,
};
