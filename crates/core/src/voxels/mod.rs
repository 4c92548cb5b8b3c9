//! Voxels: keys of cells, sparse grids, and the levels of a pyramid with exact searches on them.
//!
//! Cells have 21 bits an axis in a 64-bit key, of one of two orders. In Morton order ([`morton`], [`Grid`]) the key of a
//! cell shifted right by 3 is that of the cell of twice the size, so that levels nest: the pyramid, the octree and the
//! steps of LAS files use it. In rows (`cells`) the three cells side by side along x have consecutive keys, so that the
//! 27 cells around one are nine searches: supervoxels use it. Labels depend on the order of cells, so that neither
//! replaces the other.

mod batch;
mod blocks;
pub(crate) mod cells;
mod columns;
mod grid;
mod level;
pub mod morton;
mod search;

pub use batch::LANES;
pub use columns::{ColumnSearch, Columns};
pub use grid::{Grid, sorted};
pub use level::{Level, build_levels, coarse_levels};
pub use search::{Neighbour, Search};
