//! Parameters of the four levels of clusters.

use super::k_means::{HartiganParams, range};
use crate::error::Result;
use crate::graph::Centrality;
use serde::{Deserialize, Serialize};

/// How parameters that are not given follow from the cloud. The paper says only that they do; the rules are this
/// project's.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct AutomaticParams {
    /// Number of points that are examined, at least 1; all if there are fewer.
    pub sample: usize,
    /// The radius is the median distance to this neighbour, at least 3: balls of this radius hold about as many points.
    pub neighbour: usize,
    /// Points of a segment, as a multiple of the median number of points in such a ball; above 0.
    pub size_factor: f64,
    /// A segment has at least this many points.
    pub size_least: u32,
    /// The angle is the median angle between the normals of neighbours plus this many standard deviations (by the median
    /// absolute deviation), times [`AutomaticParams::angle_factor`]; 0 or more.
    pub angle_deviations: f64,
    /// A point is compared with the plane of the region, not with a neighbour: the angle is this much larger; above 0.
    pub angle_factor: f64,
    /// Least angle, degrees.
    pub angle_least_deg: f64,
    /// Largest angle, degrees, up to 90.
    pub angle_most_deg: f64,
    /// The offset as a multiple of the median standard deviation across the surface, √λ3; above 0.
    pub offset_factor: f64,
    /// Least offset as a multiple of the radius.
    pub offset_least: f64,
    /// Largest offset as a multiple of the radius.
    pub offset_most: f64,
}

impl Default for AutomaticParams {
    fn default() -> Self {
        Self {
            sample: 20_000,
            neighbour: 16,
            size_factor: 4.0,
            size_least: 10,
            angle_deviations: 2.0,
            angle_factor: 2.0,
            angle_least_deg: 10.0,
            angle_most_deg: 45.0,
            offset_factor: 3.0,
            offset_least: 0.25,
            offset_most: 1.0,
        }
    }
}

/// Parameters of [`cluster_levels`](super::cluster_levels()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClusterParams {
    /// ε: points within this distance are neighbours, metres, above 0; found in the cloud if absent (`"none"` in a recipe).
    #[serde(with = "crate::settings::optional")]
    pub radius: Option<f64>,
    /// τ: least number of points of a segment, at least 1; found in the cloud if absent.
    #[serde(with = "crate::settings::optional")]
    pub min_size: Option<u32>,
    /// α: largest angle between the normal of a point and of the region that takes it, degrees, 0..=90; found in the
    /// cloud if absent.
    #[serde(with = "crate::settings::optional")]
    pub angle_deg: Option<f64>,
    /// δ: largest distance of a point from the plane of the region, metres, 0 or more; found in the cloud if absent.
    #[serde(with = "crate::settings::optional")]
    pub offset: Option<f64>,
    /// How those that are absent are found.
    pub automatic: AutomaticParams,
    /// Points with fewer points in their ball, themselves included, begin regions last: three points are always flat. Their
    /// normals count as those of others when regions grow.
    pub normal_points: u32,
    /// A region has the normal of its seed until it has this many points, and then that of its own plane; at least 3.
    pub first_fit: u32,
    /// The plane is fitted again when the region has grown by this factor; above 1.
    pub growth: f64,
    /// Rounds in which the points next to a planar segment join it if they are within δ of its plane, whatever their
    /// normals: those at an edge are mixed of both sides.
    pub edge_rounds: u32,
    /// Sets of fewer than τ points join the nearest segment within this many radii; 0 or more.
    pub join_radii: f64,
    /// Level 2: planes are merged if their normals differ by at most this many α.
    pub merge_angles: f64,
    /// Level 2: and if the centre of each is within this many δ of the other's plane.
    pub merge_offsets: f64,
    /// Level 2: other segments are merged if their surface variations differ by at most this.
    pub merge_variation: f64,
    /// Level 3.
    pub categories: HartiganParams,
    /// Level 4: the measure of centrality.
    pub centrality: Centrality,
    /// Level 4: weights of the centralities in the graphs of levels 1 to 3; 0 or more, not all 0.
    pub level_weights: [f64; 3],
    /// Seed of all random draws.
    pub seed: u64,
}

impl Default for ClusterParams {
    fn default() -> Self {
        Self {
            radius: None,
            min_size: None,
            angle_deg: None,
            offset: None,
            automatic: AutomaticParams::default(),
            normal_points: 4,
            first_fit: 10,
            growth: 1.25,
            edge_rounds: 2,
            join_radii: 2.0,
            merge_angles: 2.0,
            merge_offsets: 2.0,
            merge_variation: 0.05,
            categories: HartiganParams::default(),
            centrality: Centrality::PageRank,
            level_weights: [1.0; 3],
            seed: 0,
        }
    }
}

impl ClusterParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        let a = &self.automatic;
        let positive = |name, value: f64| range(value > 0.0 && value.is_finite(), name, value, "above 0, finite");
        let not_negative =
            |name, value: f64| range(value >= 0.0 && value.is_finite(), name, value, "0 or more, finite");
        positive("clusters.radius", self.radius.unwrap_or(1.0))?;
        range(self.min_size != Some(0), "clusters.min_size", 0.0, "1 or more")?;
        let angle = self.angle_deg.unwrap_or(0.0);
        range((0.0..=90.0).contains(&angle), "clusters.angle_deg", angle, "0..=90")?;
        not_negative("clusters.offset", self.offset.unwrap_or(0.0))?;
        range(a.sample > 0, "clusters.automatic.sample", a.sample as f64, "1 or more")?;
        range(a.neighbour > 2, "clusters.automatic.neighbour", a.neighbour as f64, "3 or more")?;
        positive("clusters.automatic.size_factor", a.size_factor)?;
        not_negative("clusters.automatic.angle_deviations", a.angle_deviations)?;
        positive("clusters.automatic.angle_factor", a.angle_factor)?;
        let angles = [a.angle_least_deg, a.angle_most_deg];
        let ordered = 0.0 <= angles[0] && angles[0] <= angles[1] && angles[1] <= 90.0;
        range(ordered, "clusters.automatic.angle_least_deg", angles[0], "0 to angle_most_deg, which is at most 90")?;
        positive("clusters.automatic.offset_factor", a.offset_factor)?;
        let offsets = 0.0 <= a.offset_least && a.offset_least <= a.offset_most && a.offset_most.is_finite();
        range(offsets, "clusters.automatic.offset_least", a.offset_least, "0 to offset_most")?;
        range(self.first_fit > 2, "clusters.first_fit", f64::from(self.first_fit), "3 or more")?;
        range(self.growth > 1.0 && self.growth.is_finite(), "clusters.growth", self.growth, "above 1, finite")?;
        not_negative("clusters.join_radii", self.join_radii)?;
        not_negative("clusters.merge_angles", self.merge_angles)?;
        not_negative("clusters.merge_offsets", self.merge_offsets)?;
        not_negative("clusters.merge_variation", self.merge_variation)?;
        let sum: f64 = self.level_weights.iter().sum();
        let weighted = self.level_weights.iter().all(|w| *w >= 0.0) && sum > 0.0 && sum.is_finite();
        range(weighted, "clusters.level_weights", sum, "0 or more each, not all 0, finite")?;
        self.categories.validate()
    }
}
