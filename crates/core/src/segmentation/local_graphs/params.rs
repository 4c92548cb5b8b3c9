//! Parameters of the segmentation by local graphs.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// When two surfaces count as one connected surface.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceRule {
    /// Stein et al. 2014: convex, or concave by less than `concavity_deg`, and not touching in a single spot.
    #[default]
    Stein,
    /// As printed (Eq. 2 and 3): α_i − α_j above −60°/(1 + exp(−0.25 (β − 25°))).
    Paper,
}

/// How the segments of the local graphs become segments of the cloud.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Combination {
    /// Two supervoxels are linked if each selects the other: each lies in the centre's segment of the other's local
    /// graph.
    #[default]
    Mutual,
    /// It is enough that one selects the other.
    Union,
    /// Local segments that share a supervoxel are one, those without the centre too (Hasanpour Zaryabi et al. 2022).
    Shared,
}

/// Parameters of [`local_graphs`](crate::segmentation::local_graphs()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocalGraphParams {
    /// N: nearest supervoxels in a local graph besides its centre; ≥ 1.
    pub neighbours: usize,
    /// Supervoxels whose centroids are nearer than this multiple of S are connected by an edge; above 0.
    pub reach: f64,
    /// λ_p: distance, in units of S, at which the weight of an edge has fallen to exp(−1/2); above 0, may be infinite.
    pub distance_scale: f64,
    /// λ_s: the same for the distance of (linearity, planarity, scattering, change of curvature).
    pub feature_scale: f64,
    /// λ_c: the same for the angles between the surfaces, in radians.
    pub surface_scale: f64,
    /// k of the segmentation of a local graph: larger gives larger segments; ≥ 0.
    pub k: f64,
    /// When two surfaces count as one connected surface.
    pub surface: SurfaceRule,
    /// Concave edges of a smaller angle than this count as flat under [`SurfaceRule::Stein`], degrees, 0..=180.
    pub concavity_deg: f64,
    /// How the local segments are combined into global ones.
    pub combination: Combination,
    /// Link each supervoxel without a link to the most similar neighbour that has more than one.
    pub attach_isolated: bool,
}

impl Default for LocalGraphParams {
    fn default() -> Self {
        Self {
            neighbours: 5,
            reach: 3.0f64.sqrt(),
            distance_scale: 2.0,
            feature_scale: 0.8,
            surface_scale: std::f64::consts::FRAC_PI_4,
            k: 0.9,
            surface: SurfaceRule::Stein,
            concavity_deg: 10.0,
            combination: Combination::Mutual,
            attach_isolated: true,
        }
    }
}

impl LocalGraphParams {
    /// The surface rule and the combination as printed in Hasanpour Zaryabi et al. 2022, and no step for supervoxels
    /// without a link. The paper gives N and the reach, but neither λ nor k: those of the default.
    pub fn paper() -> Self {
        Self {
            surface: SurfaceRule::Paper,
            combination: Combination::Shared,
            attach_isolated: false,
            ..Self::default()
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        let scales = [
            ("reach", self.reach),
            ("distance_scale", self.distance_scale),
            ("feature_scale", self.feature_scale),
            ("surface_scale", self.surface_scale),
        ];
        if let Some((name, value)) = scales.into_iter().find(|(_, v)| v.is_nan() || *v <= 0.0) {
            return Err(Error::parameter(name, value, "above 0"));
        }
        if self.neighbours == 0 || self.neighbours > 1000 {
            return Err(Error::parameter("neighbours", self.neighbours, "1 to 1000"));
        }
        if self.k.is_nan() || self.k < 0.0 {
            return Err(Error::parameter("k", self.k, "0 or more"));
        }
        if !(0.0..=180.0).contains(&self.concavity_deg) {
            return Err(Error::parameter("concavity_deg", self.concavity_deg, "0 to 180"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let default = LocalGraphParams::default;
        let refused = |params: LocalGraphParams| params.validate().unwrap_err().to_string();
        assert!(default().validate().is_ok() && LocalGraphParams::paper().validate().is_ok());
        assert!(refused(LocalGraphParams { neighbours: 0, ..default() }).contains("neighbours"));
        assert!(refused(LocalGraphParams { surface_scale: 0.0, ..default() }).contains("surface_scale"));
        assert!(refused(LocalGraphParams { k: f64::NAN, ..default() }).contains("k"));
        assert!(refused(LocalGraphParams { concavity_deg: -1.0, ..default() }).contains("concavity_deg"));
        let read: LocalGraphParams = toml::from_str("surface = \"paper\"\ncombination = \"union\"").unwrap();
        assert_eq!((read.surface, read.combination), (SurfaceRule::Paper, Combination::Union));
    }
}
