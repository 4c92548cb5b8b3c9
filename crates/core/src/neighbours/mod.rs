//! Nearest neighbours: of points by a k-d tree, and on each level of a voxel pyramid by a grid; both exact.

mod batch;
mod blocks;
mod columns;
mod knn;
mod knn_build;
mod knn_lanes;
mod knn_list;
mod knn_rank;
mod knn_search;
mod knn_tree;
mod level;
mod nearest;
mod optimal;
mod optimal_lanes;
mod optimal_params;
mod order;
mod search;
mod within;

pub use batch::LANES;
pub use columns::{ColumnSearch, Columns};
pub use knn::{knn, nearest_of};
pub use level::{Level, build_levels, coarse_levels};
pub use nearest::Neighbours;
pub use optimal::{Optimal, map_optimal, optimal};
pub use optimal_params::{Eigenvalues, OptimalParams};
pub use order::{Grid, sorted};
pub use search::{Neighbour, Search};
pub use within::{Within, within};
