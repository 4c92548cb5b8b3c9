//! The adaptive octree: large cells where the points are flat, small ones elsewhere.
//!
//! M. Li, *A super voxel-based Riemannian graph for multi scale segmentation of LiDAR point clouds*, ISPRS Annals,
//! 2018, section 3.1.

mod build;
mod params;

pub use build::{Cube, Leaf, Octree, octree};
pub use params::{OctreeParams, StopRule};
