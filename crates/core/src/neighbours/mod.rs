//! Neighbours of points by a k-d tree, exactly: the k nearest, all within a radius, and the optimal neighbourhood.

mod knn;
mod knn_build;
mod knn_lanes;
mod knn_list;
mod knn_rank;
mod knn_search;
mod knn_tree;
mod nearest;
mod optimal;
mod optimal_lanes;
mod optimal_params;
mod within;

pub use knn::{knn, nearest_of};
pub use nearest::Neighbours;
pub use optimal::{Optimal, map_optimal, optimal};
pub use optimal_params::{Eigenvalues, OptimalParams};
pub use within::{Within, within};
