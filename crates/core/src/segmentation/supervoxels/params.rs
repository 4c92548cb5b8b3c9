//! Parameters of supervoxels.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Weights of the terms of the distance between a point and a supervoxel; all ≥ 0, not all 0.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SupervoxelWeights {
    /// Weight of the difference in colour.
    pub colour: f64,
    /// Weight of the distance in space.
    pub spatial: f64,
    /// Weight of the angle between normals.
    pub normal: f64,
}

impl Default for SupervoxelWeights {
    /// The defaults of the Point Cloud Library, as Hasanpour Zaryabi et al. 2022 give none.
    fn default() -> Self {
        Self { colour: 0.1, spatial: 0.4, normal: 1.0 }
    }
}

impl SupervoxelWeights {
    fn validate(&self) -> Result<()> {
        for (name, weight) in [("colour", self.colour), ("spatial", self.spatial), ("normal", self.normal)] {
            check(name, weight, weight >= 0.0, "0 or more, finite")?;
        }
        check("spatial", self.spatial, self.colour + self.spatial + self.normal > 0.0, "one weight above 0")
    }
}

/// The divisor of the spatial distance.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normaliser {
    /// √3 S, the distance of the cube's corner: the spatial term is at most its weight.
    #[default]
    Corner,
    /// √2 S, as printed.
    Paper,
}

impl Normaliser {
    /// The divisor for seeds `size` apart.
    pub(super) fn length(self, size: f64) -> f64 {
        match self {
            Self::Corner => 3.0f64.sqrt() * size,
            Self::Paper => 2.0f64.sqrt() * size,
        }
    }
}

/// Parameters of [`slic`](crate::segmentation::slic).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlicParams {
    /// S: edge of the voxels whose centroids are the seeds, in metres, above 0; about four times the point spacing.
    pub size: f64,
    /// Voxels with fewer points than this give no seed; ≥ 1.
    pub min_points: usize,
    /// Weights of the distance.
    pub weights: SupervoxelWeights,
    /// The divisor of the spatial distance.
    pub normaliser: Normaliser,
    /// Largest number of rounds of assignment and update; ≥ 1.
    pub rounds: usize,
    /// Stops early when the centres move less than this share of S on average; ≥ 0.
    pub tolerance: f64,
    /// Split supervoxels whose points are not connected in voxels of S/4; small pieces join an adjacent supervoxel.
    pub connected: bool,
}

impl Default for SlicParams {
    fn default() -> Self {
        Self {
            size: 1.2,
            min_points: 3,
            weights: SupervoxelWeights::default(),
            normaliser: Normaliser::Corner,
            rounds: 5,
            tolerance: 0.02,
            connected: false,
        }
    }
}

impl SlicParams {
    /// The divisor as printed in Hasanpour Zaryabi et al. 2022.
    pub fn paper() -> Self {
        Self { normaliser: Normaliser::Paper, ..Self::default() }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        check("size", self.size, self.size > 0.0, "metres, above 0, finite")?;
        check("tolerance", self.tolerance, self.tolerance >= 0.0, "0 or more, finite")?;
        for (name, count) in [("min_points", self.min_points), ("rounds", self.rounds)] {
            check(name, count as f64, count > 0, "1 or more")?;
        }
        self.weights.validate()
    }
}

/// Parameters of [`vccs`](crate::segmentation::vccs).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct VccsParams {
    /// R_seed: distance of the seeds, in metres, above 0.
    pub size: f64,
    /// R_voxel: edge of the voxels in metres, above 0 and at most `size`. A supervoxel only grows from a voxel to an
    /// adjacent one: take twice the point spacing.
    pub voxel: f64,
    /// Weights of the distance.
    pub weights: SupervoxelWeights,
    /// A seed is kept if the voxels within R_seed/2 of it are more than this share of the number that a plane would
    /// have; ≥ 0.
    pub min_share: f64,
    /// Largest number of growth steps, in R_seed/R_voxel; ≥ 1.
    pub depth: f64,
    /// How often the supervoxels are grown again from the voxel nearest to their mean.
    pub refinements: usize,
}

impl Default for VccsParams {
    fn default() -> Self {
        Self {
            size: 1.2,
            voxel: 0.3,
            weights: SupervoxelWeights::default(),
            min_share: 0.05,
            depth: 1.8,
            refinements: 1,
        }
    }
}

impl VccsParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        check("size", self.size, self.size > 0.0, "metres, above 0, finite")?;
        let fits = self.voxel > 0.0 && self.voxel <= self.size;
        check("voxel", self.voxel, fits, "metres, above 0 and at most `size`")?;
        check("min_share", self.min_share, self.min_share >= 0.0, "0 or more, finite")?;
        check("depth", self.depth, self.depth >= 1.0, "1 or more, finite")?;
        self.weights.validate()
    }
}

fn check(name: &'static str, value: f64, fine: bool, expected: &str) -> Result<()> {
    if fine && value.is_finite() { Ok(()) } else { Err(Error::parameter(name, value, expected)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let slic = SlicParams::default;
        let refused = |params: SlicParams| params.validate().unwrap_err().to_string();
        assert!(slic().validate().is_ok() && SlicParams::paper().validate().is_ok());
        assert!(refused(SlicParams { size: 0.0, ..slic() }).contains("size"));
        assert!(refused(SlicParams { size: f64::INFINITY, ..slic() }).contains("size"));
        assert!(refused(SlicParams { rounds: 0, ..slic() }).contains("rounds"));
        let weights = SupervoxelWeights { colour: 0.0, spatial: 0.0, normal: 0.0 };
        assert!(refused(SlicParams { weights, ..slic() }).contains("spatial"));
        let refused = |params: VccsParams| params.validate().unwrap_err().to_string();
        assert!(VccsParams::default().validate().is_ok());
        assert!(refused(VccsParams { voxel: 2.0, ..VccsParams::default() }).contains("voxel"));
        assert!(refused(VccsParams { depth: f64::NAN, ..VccsParams::default() }).contains("depth"));
    }

    #[test]
    fn parameters_are_read_from_text() {
        let slic: SlicParams = toml::from_str("size = 0.8\n[weights]\ncolour = 0.0").unwrap();
        assert_eq!((slic.size, slic.weights.colour, slic.weights.normal), (0.8, 0.0, 1.0));
        assert!(toml::from_str::<VccsParams>("voxels = 3").is_err());
    }
}
