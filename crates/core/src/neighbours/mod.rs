//! Who is near whom: a voxel pyramid with an exact search for the k nearest points of each level.

mod batch;
mod blocks;
mod columns;
mod level;
mod nearest;
mod order;
mod search;

pub use batch::LANES;
pub use columns::{ColumnSearch, Columns};
pub use level::{Level, build_levels};
pub use nearest::Neighbours;
pub use order::{Grid, sorted};
pub use search::{Neighbour, Search};
