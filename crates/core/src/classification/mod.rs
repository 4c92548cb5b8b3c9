//! Classification: classifiers that are trained on labelled samples and predict class probabilities.
//!
//! `Samples -> Classifier -> probabilities`. A [`Classifier`] (a [`Forest`], [`Boosting`] or bagging) is trained on
//! quantised features ([`Binning`]) and becomes arrays in a model file ([`classifier_codec`]).

mod bag;
mod bagging;
mod binning;
mod boosting;
mod boosting_codec;
mod classifier;
pub(crate) mod classifier_codec;
pub(crate) mod codec;
mod compact;
pub mod cross_validation;
mod descend;
mod exact;
mod fingerprint;
mod forest;
mod forest_bytes;
mod forest_codec;
mod grow;
mod histogram;
mod importance;
mod impurity;
mod node_check;
mod nodes;
mod out_of_bag;
mod params;
mod predict;
mod quantise;
mod samples;
pub mod sampling;
mod splitter;
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
pub use importance::{Importance, PermutationParams, permutation_importance};
pub use out_of_bag::FitReport;
pub use params::{Bootstrap, ClassWeight, Criterion, ForestParams, MaxFeatures, Splitter, Trainer};
pub use predict::PredictScratch;
pub(crate) use predict::argmax;
pub use samples::Samples;
