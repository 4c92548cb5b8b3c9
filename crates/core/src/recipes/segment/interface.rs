//! The interface of the methods of segmentation: what each takes, and what it gives.

use super::{ClusterReport, SegmentParams};
use crate::cloud::{Cloud, Column, Points};
use crate::error::Result;
use crate::features::FeatureTable;
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::{Intent, Partition, Scale, StageSeconds, Trial};

/// A cloud to segment.
pub(super) struct SegmentScene<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: &'a Points,
    /// One label a point, for the intent that is based on them.
    pub(super) labels: Option<&'a [Option<u8>]>,
}

/// A way to divide a cloud into segments.
pub(super) trait PartitionMethod: Sync {
    /// Segments the points.
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted>;

    /// Whether it reads colours.
    fn reads_colours(&self) -> bool {
        false
    }

    /// Names of dimensions that it gives besides the segments.
    fn dimensions(&self) -> &'static [&'static str] {
        &[]
    }

    /// Whether it segments at several depths of an octree.
    fn has_levels(&self) -> bool {
        false
    }

    /// Whether it describes points by their neighbours (`neighbourhood`).
    fn describes_points(&self) -> bool {
        false
    }

    /// Whether it merges small segments into their best neighbour (`partition.cutoff`).
    fn merges_small(&self) -> bool {
        false
    }

    /// Sets a strength or an intent; `None` if the method has no such parameter.
    fn aim(&self, _params: &mut SegmentParams, _aim: Intent) -> Option<()> {
        None
    }

    /// Sets the size of supervoxels or voxels, metres; `None` if the method has no such parameter.
    fn set_size(&self, _params: &mut SegmentParams, _size: f64) -> Option<()> {
        None
    }
}

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
