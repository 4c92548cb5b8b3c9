//! Parameters of region growing.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// The normal that a candidate's normal is compared with.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reference {
    /// That of the point or voxel the candidate is reached from: regions may be curved.
    #[default]
    Current,
    /// That of the region's seed: regions are nearly flat.
    Seed,
}

/// Parameters of [`region_growing`](super::region_growing()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegionGrowingParams {
    /// Largest angle between normals, degrees, 0..=90; the sign of normals does not matter.
    pub angle_deg: f64,
    /// A region grows on only from points whose surface variation λ3 / Σλ is below this; others can only be its border.
    pub variation: f64,
    /// Regions of fewer points are dissolved.
    pub min_size: u32,
    /// Regions of more points are dissolved.
    pub max_size: u32,
    /// The normal that a candidate's normal is compared with.
    pub reference: Reference,
}

impl Default for RegionGrowingParams {
    fn default() -> Self {
        Self { angle_deg: 10.0, variation: 0.03, min_size: 50, max_size: u32::MAX, reference: Reference::Current }
    }
}

impl RegionGrowingParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        check_angle(self.angle_deg)?;
        check_not_negative("variation", self.variation)?;
        check_sizes(self.min_size, self.max_size)
    }
}

/// Parameters of [`octree_region_growing`](super::octree_region_growing()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct OctreeGrowingParams {
    /// Voxels are at most this large, metres; above 0.
    pub largest_voxel: f64,
    /// Voxels are divided no further below this size, metres; above 0.
    pub smallest_voxel: f64,
    /// Voxels with at least this many points are divided while their residual is above
    /// [`OctreeGrowingParams::residual`]; voxels of fewer points join regions only in the refinement, point by
    /// point. At least 3.
    pub min_points: u32,
    /// Largest √λ3 about the plane of a voxel that may be part of a region, metres; above 0. About 0.03 indoors, 0.1
    /// outdoors.
    pub residual: f64,
    /// Largest angle between the normals of voxels, degrees, 0..=90.
    pub angle_deg: f64,
    /// Boundary points join a region if they are at most this far from the plane of its adjacent voxel, metres.
    pub distance: f64,
    /// Number of rings of voxels around a region that are refined.
    pub rings: u32,
    /// Regions of fewer points are dissolved.
    pub min_size: u32,
    /// The normal that a candidate's normal is compared with.
    pub reference: Reference,
}

impl Default for OctreeGrowingParams {
    fn default() -> Self {
        Self {
            largest_voxel: 2.0,
            smallest_voxel: 0.125,
            min_points: 10,
            residual: 0.03,
            angle_deg: 10.0,
            distance: 0.06,
            rings: 2,
            min_size: 50,
            reference: Reference::Seed,
        }
    }
}

impl OctreeGrowingParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("largest_voxel", self.largest_voxel),
            ("smallest_voxel", self.smallest_voxel),
            ("residual", self.residual),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::parameter(name, value, "above 0, finite"));
            }
        }
        if self.smallest_voxel > self.largest_voxel {
            let expected = format!("at most the largest, {}", self.largest_voxel);
            return Err(Error::parameter("smallest_voxel", self.smallest_voxel, expected));
        }
        if self.min_points < 3 {
            return Err(Error::parameter("min_points", self.min_points, "3 or more"));
        }
        check_not_negative("distance", self.distance)?;
        check_angle(self.angle_deg)?;
        check_sizes(self.min_size, u32::MAX)
    }
}

fn check_angle(value: f64) -> Result<()> {
    if (0.0..=90.0).contains(&value) { Ok(()) } else { Err(Error::parameter("angle_deg", value, "0..=90")) }
}

fn check_not_negative(name: &'static str, value: f64) -> Result<()> {
    if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(Error::parameter(name, value, "0 or more, finite")) }
}

fn check_sizes(min: u32, max: u32) -> Result<()> {
    if min <= max { Ok(()) } else { Err(Error::parameter("min_size", min, format!("at most max_size, {max}"))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let plain = |params: RegionGrowingParams| params.validate().unwrap_err().to_string();
        let coarse = |params: OctreeGrowingParams| params.validate().unwrap_err().to_string();
        assert!(RegionGrowingParams::default().validate().is_ok() && OctreeGrowingParams::default().validate().is_ok());
        assert!(plain(RegionGrowingParams { angle_deg: 91.0, ..Default::default() }).contains("angle_deg"));
        assert!(plain(RegionGrowingParams { variation: f64::NAN, ..Default::default() }).contains("variation"));
        assert!(plain(RegionGrowingParams { max_size: 3, ..Default::default() }).contains("min_size"));
        assert!(coarse(OctreeGrowingParams { residual: 0.0, ..Default::default() }).contains("residual"));
        assert!(coarse(OctreeGrowingParams { smallest_voxel: 3.0, ..Default::default() }).contains("largest"));
        assert!(coarse(OctreeGrowingParams { min_points: 2, ..Default::default() }).contains("min_points"));
    }

    #[test]
    fn a_recipe_can_hold_them() {
        let given: OctreeGrowingParams = toml::from_str("residual = 0.1\nreference = \"current\"").unwrap();
        assert_eq!((given.residual, given.reference, given.rings), (0.1, Reference::Current, 2));
        assert!(toml::from_str::<RegionGrowingParams>("angel_deg = 3").is_err());
    }
}
