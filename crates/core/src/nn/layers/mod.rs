//! Layers on rows of channels: normalisation, products with a matrix, losses.

mod linear;
mod loss;
mod norm;

pub use linear::{Linear, LinearGradient};
pub use loss::{Loss, cross_entropy, softmax};
pub use norm::{BatchNorm, Moments, NormGradient};

/// Rows that one task takes.
const BLOCK: usize = 1024;
