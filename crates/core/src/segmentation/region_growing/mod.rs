//! Region growing: smooth surfaces from seeds of little curvature, on points and on the cells of an octree.

mod grow;
mod octree_growing;
mod params;
pub(super) mod planar;
mod refine;
mod result;
mod voxels;

pub use grow::region_growing;
pub use octree_growing::octree_region_growing;
pub use params::{OctreeGrowingParams, Reference, RegionGrowingParams};
pub use result::{GrownRegions, Leftovers};
