//! Module `nn`: sparse convolutions of arrays, and networks that classify objects.

mod direct;
mod files;
mod objects;
mod rows;

pub(crate) use direct::{sparse_convolution, sparse_gradient};
pub(crate) use files::{load_xyz, read_idx, read_off, sample_surface};
pub(crate) use objects::{ObjectModel, ObjectTraining, Objects, object_preset};
pub(crate) use rows::{Sites, submanifold_convolution, submanifold_gradient};
