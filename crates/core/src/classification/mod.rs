//! Classification: classifiers that are trained on labelled samples and predict class probabilities.
//!
//! `Samples -> Classifier -> probabilities`. A [`Classifier`] (a [`Forest`], [`Boosting`] or bagging) is trained on
//! quantised features ([`Binning`]) and becomes arrays in a model file ([`codec`]).

mod bag;
mod bagging;
mod binning;
mod boosting;
mod boosting_codec;
mod check_trees;
mod classifier;
pub(crate) mod codec;
mod compact;
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
mod out_of_bag;
mod params;
mod predict;
mod quantise;
mod samples;
pub mod sampling;
#[cfg(test)]
pub(crate) mod testing;
mod train;
mod vote;

pub use bagging::BaggingParams;
pub use binning::{Binning, BinningParams};
pub use boosting::{Boosting, BoostingParams, BoostingReport};
pub use classifier::{Classifier, ClassifierKind, ClassifierParams};
pub use fingerprint::Fingerprint;
pub use forest::Forest;
pub use importance::{Importance, permutation_importance};
pub use params::{Bootstrap, ClassWeight, Criterion, ForestParams, MaxFeatures, Splitter, Trainer};
pub use predict::PredictScratch;
pub use samples::Samples;
pub use train::FitReport;
