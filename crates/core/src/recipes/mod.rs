//! One file per published system: each reads like the paper's method section and is saved as TOML.

mod builtin;
mod classify;
mod labels;
mod recipe;
mod train;
mod training;

pub use builtin::{BUILTIN_MAP, default_model};
pub use classify::{Classified, ClassifyParams, classify};
pub use labels::{LabelParams, Labels, read_labels};
pub use recipe::{Recipe, set_key};
pub use train::{DepthScore, cross_validate, train};
pub use training::{ClassCount, TrainingParams, TrainingReport, planar_density};
