//! What every method of segmentation gives.

use super::ClusterReport;
use crate::cloud::Column;
use crate::features::FeatureTable;
use crate::graph::Graph;
use crate::segmentation::{Partition, Scale, StageSeconds, Trial};

/// A partition, with method-specific results.
#[derive(Default)]
pub(super) struct Parted {
    pub(super) partition: Partition,
    pub(super) descriptors: FeatureTable,
    pub(super) graph: Option<Graph>,
    pub(super) strength: Option<f64>,
    pub(super) trials: Vec<Trial>,
    pub(super) supervoxels: Option<usize>,
    pub(super) levels: Vec<Level>,
    /// Dimensions of the points of the cloud.
    pub(super) columns: Vec<Column>,
    pub(super) clusters: Option<ClusterReport>,
}

/// The partition at one depth.
pub(super) struct Level {
    pub(super) min_depth: u32,
    pub(super) supervoxels: usize,
    pub(super) segments: Partition,
    pub(super) seconds: StageSeconds,
}

impl From<Scale> for Level {
    fn from(Scale { min_depth, found }: Scale) -> Self {
        let supervoxels = found.supervoxels.len();
        Self { min_depth, supervoxels, segments: found.segments, seconds: found.seconds }
    }
}
