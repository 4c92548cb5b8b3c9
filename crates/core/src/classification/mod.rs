//! Classification: classifiers that are trained on labelled samples and predict class probabilities.
//!
//! `Samples -> Classifier -> probabilities`. A [`Classifier`] (a [`Forest`], [`Boosting`] or bagging, on quantised
//! features ([`Binning`]), or [`Linear`]) becomes arrays in a model file (`arrays`).

pub(crate) mod arrays;
mod binning;
mod boosting;
mod bytes;
mod classifier;
pub mod cross_validation;
mod fingerprint;
mod forest;
mod learner;
mod linear;
mod nodes;
mod params;
mod quantise;
mod samples;
pub mod sampling;
#[cfg(test)]
pub(crate) mod testing;

pub use binning::{Binning, BinningParams};
pub use boosting::{Boosting, BoostingParams, BoostingReport};
pub use classifier::{Classifier, ClassifierKind, ClassifierParams, ClassifierScratch};
pub use fingerprint::Fingerprint;
pub use forest::Forest;
pub use forest::bagging::BaggingParams;
pub use forest::growing::ForestPart;
pub use forest::growing::out_of_bag::FitReport;
pub use forest::importance::{Importance, PermutationParams, permutation_importance};
pub(crate) use learner::argmax;
pub use learner::{Learner, PartCount, Predictor};
pub use linear::{Linear, LinearParams};
pub use params::{Bootstrap, ClassWeight, Criterion, ForestParams, MaxFeatures, Splitter, Trainer};
pub use samples::Samples;
