//! Parting a cloud into segments: descriptors, adjacency, partition, and how good it is.

mod params;
mod part;

pub use params::{GrowingParams, SegmentMethod, SegmentParams};

use super::Labels;
use super::points::{note_oddities, points_of};
use crate::cloud::{Cloud, Points};
use crate::error::Result;
use crate::evaluation::{BoundaryScores, SizeBin, boundary_scores, oracle_accuracy, size_histogram};
use crate::features::{FeatureTable, optimal_features};
use crate::graph::Graph;
use crate::neighbours::OptimalParams;
use crate::parallel::{Monitor, watched};
use crate::segmentation::{Partition, StageSeconds, Trial};
use part::{Level, Parted, adjacency, part};
use serde::Serialize;

/// A parted cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segmented {
    /// Segment of each point of the cloud, from 1; 0 where coordinates are not finite or stray.
    pub clusters: Vec<u32>,
    /// Points with finite coordinates that are not stray, in the order of the partition's nodes.
    pub points: Points,
    /// Linearity, planarity, scattering, verticality of these points; empty if the method does without, see
    /// [`Segmented::describe`].
    pub descriptors: FeatureTable,
    /// The segments of these points; segment s has number s + 1 among the clusters.
    pub partition: Partition,
    /// Segment of each point of the cloud at each level that was asked for, from 1; 0 where coordinates are not finite or stray.
    pub levels: Vec<Vec<u32>>,
    /// What is worth knowing about it.
    pub report: SegmentReport,
}

impl Segmented {
    /// Fills in the descriptors if they are absent.
    ///
    /// # Errors
    /// A parameter out of range, cancellation.
    pub fn describe(&mut self, params: &OptimalParams, monitor: &Monitor) -> Result<()> {
        if self.descriptors.names.is_empty() {
            monitor.stage("describe", self.points.len() as u64);
            self.descriptors = optimal_features(&self.points, params, monitor)?.table;
        }
        Ok(())
    }
}

/// What is worth knowing about a partition.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SegmentReport {
    /// How the segments were found.
    pub method: SegmentMethod,
    /// Number of segments.
    pub segments: usize,
    /// ρ of document 000, μ of document 001, if the method has one.
    pub strength: Option<f64>,
    /// Number of supervoxels, if the method makes some.
    pub supervoxels: Option<usize>,
    /// The levels that were asked for.
    pub levels: Vec<LevelReport>,
    /// Strengths that were tried, ascending.
    pub trials: Vec<Trial>,
    /// Segments by size.
    pub sizes: Vec<SizeBin>,
    /// Best accuracy that naming whole segments could reach, 0..1, if labels are known.
    pub oracle_accuracy: Option<f64>,
    /// How boundaries between labels are met, to one edge, if labels are known.
    pub boundaries: Option<BoundaryScores>,
}

/// One level of a multi-scale segmentation (document 001, Tables 2 and 3).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LevelReport {
    /// Least depth of the octree.
    pub min_depth: u32,
    /// Number of supervoxels.
    pub supervoxels: usize,
    /// Number of segments.
    pub segments: usize,
    /// Seconds of each stage.
    pub seconds: StageSeconds,
    /// Best accuracy that naming whole segments could reach, 0..1, if labels are known.
    pub oracle_accuracy: Option<f64>,
}

/// Parts a cloud into segments by the method that the settings name.
///
/// Labels, few or many, only serve to tell how good the partition is, and the intent that asks for them. At most
/// about 200 bytes a point: the cloud and its coordinates (50), descriptors (16), the graph of nearest neighbours (75 for
/// five neighbours) or the table it is made from, and what the method merges (40), or voxels and what touches them (90). Same bytes for any number of threads, but for the seconds of the report.
///
/// # Errors
/// A parameter out of range, an intent that needs labels without any, no finite point, cancellation.
pub fn segment(cloud: &Cloud, labels: Option<&Labels>, params: &SegmentParams, monitor: &Monitor) -> Result<Segmented> {
    params.validate()?;
    let points = points_of(cloud, None, monitor)?;
    note_oddities([cloud], monitor)?;
    let known: Option<Vec<Option<u8>>> =
        labels.map(|labels| points.index.iter().map(|&i| labels.codes.get(i as usize).copied().flatten()).collect());
    let found = part((cloud, &points), known.as_deref(), params, monitor)?;
    monitor.check()?;
    let report = judge(&found, (&points, known.as_deref()), params, monitor)?;
    let in_cloud = |partition: &Partition| {
        let mut clusters = vec![0; cloud.len()];
        for piece in watched(points.len(), monitor) {
            piece?.for_each(|i| clusters[points.index[i] as usize] = partition.segments()[i] + 1);
        }
        Ok(clusters)
    };
    let clusters = in_cloud(&found.partition)?;
    let levels = found.levels.iter().map(|level| in_cloud(&level.segments)).collect::<Result<_>>()?;
    Ok(Segmented { clusters, levels, descriptors: found.descriptors, partition: found.partition, points, report })
}

fn judge(
    found: &Parted,
    (points, labels): (&Points, Option<&[Option<u8>]>),
    params: &SegmentParams,
    monitor: &Monitor,
) -> Result<SegmentReport> {
    let labels = labels.filter(|labels| labels.iter().any(Option::is_some));
    let mut report = SegmentReport {
        method: params.method,
        segments: found.partition.len(),
        strength: found.strength,
        supervoxels: found.supervoxels,
        trials: found.trials.clone(),
        sizes: size_histogram(&found.partition),
        levels: found.levels.iter().map(|level| level_report(level, labels)).collect::<Result<_>>()?,
        ..SegmentReport::default()
    };
    if let Some(labels) = labels {
        let made: Graph;
        let graph = match &found.graph {
            Some(graph) => graph,
            None => {
                made = adjacency(points, params, monitor)?;
                &made
            }
        };
        report.oracle_accuracy = oracle_accuracy(&found.partition, labels)?;
        report.boundaries = Some(boundary_scores(graph, &found.partition, labels, 1)?);
    }
    Ok(report)
}

fn level_report(level: &Level, labels: Option<&[Option<u8>]>) -> Result<LevelReport> {
    Ok(LevelReport {
        min_depth: level.min_depth,
        supervoxels: level.supervoxels,
        segments: level.segments.len(),
        seconds: level.seconds,
        oracle_accuracy: labels.map(|labels| oracle_accuracy(&level.segments, labels)).transpose()?.flatten(),
    })
}
