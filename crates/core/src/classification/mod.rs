//! Classification: learning names from examples, and naming.
//!
//! `Samples -> Forest -> probabilities`. A [`Forest`] is learned on quantised features ([`Binning`]) and travels in a
//! [`Model`] file together with the recipe that computes its features.

mod bag;
mod binning;
mod exact;
mod forest;
mod grow;
mod histogram;
mod impurity;
mod out_of_bag;
mod params;
mod predict;
mod samples;
#[cfg(test)]
mod testing;
mod train;

pub use binning::{Binning, BinningParams};
pub use forest::Forest;
pub use params::{Bootstrap, ClassWeight, Criterion, ForestParams, MaxFeatures, Splitter, Trainer};
pub use predict::PredictScratch;
pub use samples::Samples;
pub use train::FitReport;
