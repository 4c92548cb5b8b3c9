//! Parameters of the neighbourhood graph.

use super::checks::{at_least_one, between, zero_or_more};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Parameters of [`Nodes::new`](crate::contours::Nodes::new) and [`neighbourhood()`](crate::contours::neighbourhood()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NeighbourhoodParams {
    /// Least likelihood of a node, 0 to 1; 0 keeps all points. Lower: contours bridge places that look unlike contours.
    pub keep: f64,
    /// Edge of the voxels of which the most likely point is a node, metres; 0 keeps all points but copies.
    pub voxel: f64,
    /// Number of nearest neighbours, 1 or more.
    pub k1: usize,
    /// Number of nearest neighbours that may join components, at least `k1`.
    pub k2: usize,
}

impl Default for NeighbourhoodParams {
    fn default() -> Self {
        Self { keep: 0.1, voxel: 0.025, k1: 5, k2: 50 }
    }
}

impl NeighbourhoodParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        between("keep", self.keep, 1.0)?;
        zero_or_more("voxel", self.voxel)?;
        at_least_one("k1", self.k1)?;
        match self.k2 < self.k1 {
            true => Err(Error::parameter("k2", self.k2, format!("at least k1, {}", self.k1))),
            false => Ok(()),
        }
    }
}
