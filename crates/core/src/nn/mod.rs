//! Sparse neural networks on CPU threads: tensors of occupied cells, layers with gradients, training, networks.
//!
//! The result of a pass is the same bytes for any number of threads.

pub mod arrays;
pub mod dense;
pub mod layers;
pub mod networks;
pub mod objects;
pub mod parameters;
pub mod scalar;
pub mod sites;
pub mod sparse;
pub mod tape;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod torch;
pub mod training;
pub mod workspace;
