//! Gradient-boosted trees: each round adds trees that approximate the negative gradient of the loss.
//!
//! Friedman 2001; second-order gain and L2 penalty as in Chen & Guestrin 2016; histograms and leaf-wise growth as in Ke
//! et al. 2017. Sums are integers, so that the result is the same bytes for any number of threads.

pub(in crate::classification) mod codec;
mod fit;
mod growing;
mod loss;
mod model;
mod params;
mod predict;
mod sweep;

pub use fit::BoostingReport;
pub use model::Boosting;
pub use params::BoostingParams;

#[cfg(test)]
mod tests;
