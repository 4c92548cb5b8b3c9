//! Gradient-boosted trees: each round adds trees that follow the slope of the loss that is left.
//!
//! Friedman 2001; second-order gain and L2 penalty of Chen and Guestrin 2016; histograms and leaf-wise growth of Ke et
//! al. 2017. Sums are kept in whole numbers, so that the result is the same bytes for any number of threads.

mod blocks;
mod fit;
mod grow;
mod histogram;
mod lesson;
mod loss;
mod model;
mod params;
mod predict;
mod rows;
mod split;
mod sweep;

pub use fit::BoostingReport;
pub use model::Boosting;
pub use params::BoostingParams;

#[cfg(test)]
mod tests;
