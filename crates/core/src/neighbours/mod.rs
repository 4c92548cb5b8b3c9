//! Neighbours of points by a k-d tree, exactly: the k nearest, all within a radius, and the optimal neighbourhood.

mod distances;
mod knn;
mod nearest;
mod optimal;
pub(crate) mod stacks;
pub(crate) mod sums;
mod within;

pub use distances::map_distances;
pub use knn::{knn, nearest_of};
pub use nearest::Neighbours;
pub use optimal::params::{Eigenvalues, OptimalParams};
pub use optimal::{Optimal, map_optimal, optimal};
pub use sums::Shape;
pub use within::{Within, within};
