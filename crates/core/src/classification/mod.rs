//! Classification: learning names from examples, and naming.
//!
//! `Samples -> Forest -> probabilities`. A [`Forest`] is learned on quantised features ([`Binning`]) and travels in a
//! [`Model`] file together with the recipe that computes its features.

mod bag;
mod binning;
mod boosting;
mod codec;
pub mod cross_validation;
mod descend;
mod exact;
mod fingerprint;
mod forest;
mod forest_bytes;
mod grow;
mod histogram;
mod importance;
mod impurity;
mod model;
mod out_of_bag;
mod params;
mod predict;
mod quantise;
mod samples;
pub mod sampling;
#[cfg(test)]
mod testing;
mod train;

pub use binning::{Binning, BinningParams};
pub use boosting::{Boosting, BoostingParams, BoostingReport};
pub use fingerprint::Fingerprint;
pub use forest::Forest;
pub use importance::{Importance, permutation_importance};
pub use model::Model;
pub use params::{Bootstrap, ClassWeight, Criterion, ForestParams, MaxFeatures, Splitter, Trainer};
pub use predict::PredictScratch;
pub use samples::Samples;
pub use train::FitReport;
