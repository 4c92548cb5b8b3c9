//! Voxels: keys of cells, sparse grids, and the levels of a pyramid with exact searches on them.
//!
//! Cells of three dimensions have 21 bits an axis in a 64-bit key, of one of two orders. In Morton order ([`morton`],
//! [`Grid`]) the key of a cell shifted right by 3 is that of the cell of twice the size, so that levels nest: the
//! pyramid, the octree and the steps of LAS files use it. In rows (`rows`) the three cells side by side along x have
//! consecutive keys, so that the 27 cells around one are nine searches: supervoxels use it. Squares in plan, and the
//! voxels of training samples, have the plain numbers of a cell as their key (`cells`), because they may be too many
//! for 21 bits: the sites of a terrain, the lowest points and the outline of a road, and covered ground use it. Labels
//! and samples depend on the order of the cells, so that no kind of key can replace another.
//!
//! Only the search for stray points, in [`cloud`](crate::cloud), has cells of its own: as long as stray points are not
//! known, neither is the extent of the scene.

mod batch;
mod blocks;
mod candidates;
pub(crate) mod cells;
mod columns;
mod grid;
mod level;
pub mod morton;
pub(crate) mod rows;
mod search;
mod squares;

pub use batch::{LANES, Queries};
pub use columns::{ColumnSearch, Columns};
pub use grid::{Grid, sorted};
pub use level::{Level, LevelLimits, build_levels, coarse_levels};
pub use search::{Neighbour, Search};
pub use squares::planar_density;
pub(crate) use squares::{PlanarDensity, covered_area};
