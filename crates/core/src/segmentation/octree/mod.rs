//! The adaptive octree: cells as large as their points are flat.
//!
//! M. Li, *A super voxel-based Riemannian graph for multi scale segmentation of LiDAR point clouds*, 2018, section 3.1.

mod build;
mod params;
mod spread;

pub use build::{Cube, Leaf, Octree, octree};
pub use params::{OctreeParams, StopRule};
pub(super) use spread::{Moments, eigenvalues};
