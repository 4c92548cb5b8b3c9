//! Parameters of the directions of contours.

use super::checks::{above_zero, at_least_one, between};
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Parameters of [`tangents`](crate::contours::tangents()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TangentParams {
    /// Edge of the voxels of which the most likely point counts, metres, above 0.
    pub voxel: f64,
    /// Number of nearest ones that give a direction, 1 or more.
    pub neighbours: usize,
    /// Least likelihood of points that count and that get a direction, 0 to 1.
    pub least: f64,
}

impl Default for TangentParams {
    fn default() -> Self {
        Self { voxel: 0.05, neighbours: 12, least: 0.1 }
    }
}

impl TangentParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        above_zero("voxel", self.voxel)?;
        at_least_one("neighbours", self.neighbours)?;
        between("least", self.least, 1.0)
    }
}
