//! Layers on rows of channels: normalisation, products with a matrix, dropout, losses.

mod dropout;
mod linear;
mod loss;
mod norm;
mod rectify;

pub use dropout::Dropped;
pub use linear::{Linear, LinearGradient};
pub use loss::{Loss, cross_entropy, disagreement, softmax};
pub use norm::{BatchNorm, Moments, NormGradient};
pub use rectify::{rectify, stop_below};

/// Rows that one task takes.
const BLOCK: usize = 1024;
