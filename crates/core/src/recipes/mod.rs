//! Recipes: the published methods from cloud to labels. Each has a folder whose `mod.rs` reads like the method section of
//! its paper; its parameters are saved as TOML. What they have in common is [`System`].

mod any;
mod builtin;
mod classifiers;
mod classify;
#[cfg(test)]
mod height;
mod label_file;
mod labels;
mod model;
mod objects;
mod points;
mod predict;
mod pyramid;
mod regularise;
mod report;
mod segment;
mod settings;
mod statistics;
mod suggest;
mod system;
mod training;
mod weak;

pub use any::{AnyFitted, AnyRecipe};
pub use builtin::{BUILTIN_MAP, default_model};
pub use classify::{Classified, ClassifyParams, Job, classify};
pub use label_file::{LabelFile, Picking};
pub use labels::{LabelParams, LabelledCloud, Labels, read_labels};
pub use model::Model;
pub use objects::{Heights, ObjectSegments, ObjectTraining, ObjectsKind, ObjectsRecipe, ObjectsReport, SupervoxelMode};
pub use pyramid::{DepthScore, PyramidKind, PyramidRecipe, PyramidReport, TrainingParams};
pub use regularise::{Posterior, Probabilities, Regularise, RegulariseParams, Regularised, regularise};
pub use report::{ClassCount, Report};
pub use segment::{GrowingParams, LevelReport, SegmentMethod, SegmentParams, SegmentReport, Segmented, segment};
pub use settings::set_key;
pub use statistics::{CloudStatistics, statistics};
pub use suggest::{SuggestParams, Suggestion, suggest, suggestion_page};
pub use system::{Fitted, Nothing, System, TrainOptions};
pub use weak::{
    ClassShares, Descriptors, Example, LabelledPosition, RoadExample, RoadParams, RoadSource, StrengthScore, WeakKind,
    WeakLabels, WeakLearned, WeakRecipe, WeakReport,
};
