//! Parameters of the segmentation on a Riemannian graph.

use crate::error::{Error, Result};
use crate::graph::{EdgeWeight, Orientation};
use crate::segmentation::{CutPursuitSteps, OctreeParams};
use serde::{Deserialize, Serialize};

/// Whether normals are oriented.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sides {
    /// Oriented normals: D_N = n_p · n_c, features n.
    #[default]
    Signed,
    /// Normals of any sign: D_N = |n_p · n_c|, features the six entries of n nᵀ (√2 off the diagonal).
    Unsigned,
}

/// Initial position of a cluster centre.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// At the mean of the leaf's points.
    #[default]
    Centroid,
    /// At the centre of the leaf's cube, as in the paper.
    Cube,
}

/// Parameters of the modified k-means.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct KMeansParams {
    /// Initial position of the cluster centres.
    pub start: Start,
    /// Largest number of iterations; at least 1.
    pub max_iterations: usize,
    /// Stops once the mean displacement of the centres is below this share of the edge of a cell of the least depth. ≥
    /// 0.
    pub tolerance: f64,
    /// Afterwards split clusters into the connected components of the graph of nearest neighbours; components of fewer
    /// points than the octree's `min_points` join the cluster that they touch most.
    pub connected: bool,
}

impl Default for KMeansParams {
    fn default() -> Self {
        Self { start: Start::Centroid, max_iterations: 10, tolerance: 0.01, connected: false }
    }
}

/// How d_proj(i, j) and d_proj(j, i) are made symmetric.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Symmetry {
    /// The larger.
    #[default]
    Max,
    /// The smaller.
    Min,
}

/// The distance by which neighbours of a node are nearest.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Nearest {
    /// By d_proj, among the candidates.
    #[default]
    Distance,
    /// By the length of the path along the spanning tree.
    TreePath,
}

/// Parameters of the Riemannian graph.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct RiemannianGraphParams {
    /// Number of Euclidean nearest supervoxels that are candidates for neighbours, beside the Euclidean spanning tree.
    /// At least 1.
    pub candidates: usize,
    /// k: number of candidates that each node keeps as neighbours, beside the spanning tree.
    pub nearest: usize,
    /// The distance by which candidates are nearest.
    pub nearest_by: Nearest,
    /// How d_proj becomes symmetric.
    pub symmetry: Symmetry,
    /// Multiply d_proj by 2 − n_i · n_j: keeps the two faces of a thin wall apart. For [`Sides::Unsigned`] by
    /// 2 − |n_i · n_j|, which keeps surfaces apart that meet at an edge, but not two faces.
    pub thin_wall: bool,
    /// Weight of an edge in the optimisation, from d_proj and its mean over the edges.
    pub edge_weight: EdgeWeight,
}

impl Default for RiemannianGraphParams {
    fn default() -> Self {
        Self {
            candidates: 16,
            nearest: 8,
            nearest_by: Nearest::Distance,
            symmetry: Symmetry::Max,
            thin_wall: false,
            edge_weight: EdgeWeight::Constant,
        }
    }
}

/// The weight of a supervoxel in the optimisation.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeWeight {
    /// 1, as printed.
    #[default]
    One,
    /// Its number of points over the mean number: the result then depends less on the depth of the octree.
    Points,
}

/// Parameters of [`riemannian`](super::riemannian()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct RiemannianParams {
    /// Number of neighbours for point normals; 2 to 32.
    pub neighbours: usize,
    /// μ: cost of an edge between segments, in squared feature difference. Larger: fewer segments. ≥ 0.
    pub strength: f64,
    /// Whether normals are oriented.
    pub sides: Sides,
    /// The weight of a supervoxel in the optimisation.
    pub node_weight: NodeWeight,
    /// Factor of planarity and scattering in the optimisation; the paper: 1. ≥ 0.
    pub shape_weight: f64,
    /// Seed of the optimisation.
    pub seed: u64,
    /// How normals are oriented; without effect for [`Sides::Unsigned`].
    pub orientation: Orientation,
    /// The octree whose leaves initialise the clusters.
    pub octree: OctreeParams,
    /// The modified k-means.
    pub clusters: KMeansParams,
    /// The graph of the supervoxels.
    pub graph: RiemannianGraphParams,
    /// The steps of the optimisation.
    pub cut_pursuit: CutPursuitSteps,
}

impl Default for RiemannianParams {
    fn default() -> Self {
        Self {
            neighbours: 15,
            strength: 0.1,
            sides: Sides::Signed,
            node_weight: NodeWeight::One,
            shape_weight: 1.0,
            seed: 0,
            orientation: Orientation::SpanningTree,
            octree: OctreeParams::adaptive(),
            clusters: KMeansParams::default(),
            graph: RiemannianGraphParams::default(),
            cut_pursuit: CutPursuitSteps::default(),
        }
    }
}

impl RiemannianParams {
    /// As printed: the octree's stop rule is λ3 < 0.5, clusters start at the centres of the leaves' cubes, and cut pursuit
    /// is the published one.
    pub fn paper() -> Self {
        Self {
            octree: OctreeParams::paper(),
            clusters: KMeansParams { start: Start::Cube, ..KMeansParams::default() },
            cut_pursuit: CutPursuitSteps::paper(),
            ..Self::default()
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if !(2..=32).contains(&self.neighbours) {
            return Err(Error::parameter("neighbours", self.neighbours, "2..=32"));
        }
        let not_negative =
            [("strength", self.strength), ("shape_weight", self.shape_weight), ("tolerance", self.clusters.tolerance)];
        if let Some((name, value)) = not_negative.into_iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
            return Err(Error::parameter(name, value, "0 or more, finite"));
        }
        let counts = [("max_iterations", self.clusters.max_iterations), ("candidates", self.graph.candidates)];
        if let Some((name, value)) = counts.into_iter().find(|(_, v)| *v == 0) {
            return Err(Error::parameter(name, value, "1 or more"));
        }
        self.graph.edge_weight.validate()?;
        self.cut_pursuit.validate()?;
        self.octree.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_can_hold_them() {
        let mut params = RiemannianParams { orientation: Orientation::Sensor([1.0, 2.0, 3.0]), ..Default::default() };
        params.graph.edge_weight = EdgeWeight::Inverse { offset: 1.0 };
        let text = toml::to_string(&params).unwrap();
        assert_eq!(toml::from_str::<RiemannianParams>(&text).unwrap(), params);
        let given: RiemannianParams = toml::from_str("strength = 0.3\n[octree]\nmin_depth = 5").unwrap();
        assert_eq!((given.strength, given.octree.min_depth, given.octree.min_points), (0.3, 5, 10));
        assert!(toml::from_str::<RiemannianParams>("strenght = 0.3").is_err());
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let refused = |change: fn(&mut RiemannianParams)| {
            let mut params = RiemannianParams::default();
            change(&mut params);
            params.validate().unwrap_err().to_string()
        };
        assert!(RiemannianParams::paper().validate().is_ok());
        assert!(refused(|p| p.strength = f64::NAN).contains("strength"));
        assert!(refused(|p| p.neighbours = 33).contains("neighbours"));
        assert!(refused(|p| p.clusters.max_iterations = 0).contains("max_iterations"));
        assert!(refused(|p| p.clusters.tolerance = -1.0).contains("tolerance"));
        assert!(refused(|p| p.graph.candidates = 0).contains("candidates"));
        assert!(refused(|p| p.octree.min_depth = 40).contains("min_depth"));
    }
}
