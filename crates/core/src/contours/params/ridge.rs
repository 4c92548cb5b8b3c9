//! Parameters of the ridge of likely points.

use super::checks::{above_zero, between, zero_or_more};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Parameters of [`ridge`](crate::contours::ridge()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RidgeParams {
    /// How often points are moved, 0 to 100; 0: never, lines run from point to point, as in the thesis.
    pub passes: usize,
    /// Standard deviation of the neighbourhood whose mean a point is moved to, metres, above 0.
    pub reach: f64,
    /// Standard deviations beyond the mean, away from the surface, at which the edge lies, 0 or more; 0: lines run through the
    /// means.
    pub end: f64,
    /// Radius of the surroundings that tell where the surface is, metres, above 0.
    pub around: f64,
    /// Edge of the voxels of which the likeliest point is moved, metres, 0 or more.
    pub voxel: f64,
    /// Least likelihood of a point that is moved, 0 to 1; others are on no line.
    pub least: f64,
}

impl Default for RidgeParams {
    fn default() -> Self {
        Self { passes: 2, reach: 0.05, end: 1.2, around: 0.12, voxel: 0.025, least: 0.1 }
    }
}

impl RidgeParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if self.passes > 100 {
            return Err(Error::parameter("passes", self.passes, "0 to 100"));
        }
        above_zero("reach", self.reach)?;
        zero_or_more("end", self.end)?;
        above_zero("around", self.around)?;
        zero_or_more("voxel", self.voxel)?;
        between("least", self.least, 1.0)
    }
}
