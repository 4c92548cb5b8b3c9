//! Parting a cloud into segments: descriptors, adjacency, partition, and how good it is.

use super::Labels;
use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::evaluation::{BoundaryScores, SizeBin, boundary_scores, oracle_accuracy, size_histogram};
use crate::features::{FeatureTable, optimal_features};
use crate::graph::{Graph, KnnGraphParams, knn_graph};
use crate::neighbours::{OptimalParams, knn};
use crate::parallel::Monitor;
use crate::segmentation::{Intent, Partition, PartitionParams, Scene, Signal, Trial, partition_by_intent};
use serde::{Deserialize, Serialize};

/// Settings of [`segment`]; the defaults are document 000's, but for a strength of 0.03 that suits airborne scans too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentParams {
    /// Neighbourhoods of the four descriptors that are nearly constant on a segment.
    pub neighbourhood: OptimalParams,
    /// Nearest neighbours that each point is joined with, at least 1.
    pub neighbours: usize,
    /// Weights of these edges.
    pub adjacency: KnnGraphParams,
    /// The partition: a strength, or what it is for.
    pub partition: PartitionParams,
}

impl Default for SegmentParams {
    fn default() -> Self {
        Self {
            neighbourhood: OptimalParams::default(),
            neighbours: 10,
            adjacency: KnnGraphParams::default(),
            partition: PartitionParams { intent: Intent::Strength(0.03), ..PartitionParams::default() },
        }
    }
}

impl SegmentParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if self.neighbours == 0 {
            return Err(Error::parameter("neighbours", 0, "1 or more"));
        }
        self.neighbourhood.validate()?;
        self.adjacency.validate()?;
        self.partition.validate()
    }
}

/// A parted cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segmented {
    /// Segment of each point of the cloud, from 1; 0 where coordinates are not finite.
    pub clusters: Vec<u32>,
    /// Points with finite coordinates, in the order of the partition's nodes.
    pub points: Points,
    /// Linearity, planarity, scattering, verticality of these points.
    pub descriptors: FeatureTable,
    /// The segments of these points; segment s has number s + 1 among the clusters.
    pub partition: Partition,
    /// What is worth knowing about it.
    pub report: SegmentReport,
}

/// What is worth knowing about a partition.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SegmentReport {
    /// Number of segments.
    pub segments: usize,
    /// ρ.
    pub strength: f64,
    /// Strengths that were tried, ascending.
    pub trials: Vec<Trial>,
    /// Segments by size.
    pub sizes: Vec<SizeBin>,
    /// Best accuracy that naming whole segments could reach, 0..1, if labels are known.
    pub oracle_accuracy: Option<f64>,
    /// How boundaries between labels are met, to one edge, if labels are known.
    pub boundaries: Option<BoundaryScores>,
}

/// Parts a cloud into segments by l0 cut pursuit or greedy merging on its graph of nearest neighbours.
///
/// Labels, few or many, only serve to tell how good the partition is, and the intent that asks for them. About 600 bytes
/// a point. Same bytes for any number of threads.
///
/// # Errors
/// A parameter out of range, an intent that needs labels without any, no finite point, cancellation.
pub fn segment(cloud: &Cloud, labels: Option<&Labels>, params: &SegmentParams, monitor: &Monitor) -> Result<Segmented> {
    params.validate()?;
    let points = Points::from_cloud(cloud, cloud.metres_per_unit.unwrap_or(1.0));
    if points.is_empty() {
        return Err(Error::input("the cloud has no point with finite coordinates"));
    }
    monitor.stage("describe", points.len() as u64);
    let descriptors = optimal_features(&points, &params.neighbourhood, monitor)?.table;
    let graph = {
        let near = knn(&points, params.neighbours, monitor)?;
        knn_graph(points.len(), &near, &params.adjacency, monitor)?
    };
    let known: Option<Vec<Option<u8>>> =
        labels.map(|labels| points.index.iter().map(|&i| labels.codes.get(i as usize).copied().flatten()).collect());
    monitor.stage("segments", points.len() as u64);
    let signal = Signal::new(&descriptors.values, descriptors.width())?;
    let scene = Scene { signal, graph: &graph, points: Some(&points), labels: known.as_deref() };
    let found = partition_by_intent(&scene, &params.partition, monitor)?;
    let mut clusters = vec![0; cloud.len()];
    for (&point, &s) in points.index.iter().zip(found.partition.segments()) {
        clusters[point as usize] = s + 1;
    }
    let mut report = judge(&found.partition, &graph, known.as_deref())?;
    (report.strength, report.trials) = (found.strength, found.trials);
    Ok(Segmented { clusters, points, descriptors, partition: found.partition, report })
}

fn judge(partition: &Partition, graph: &Graph, labels: Option<&[Option<u8>]>) -> Result<SegmentReport> {
    let mut report =
        SegmentReport { segments: partition.len(), sizes: size_histogram(partition), ..SegmentReport::default() };
    if let Some(labels) = labels.filter(|labels| labels.iter().any(Option::is_some)) {
        report.oracle_accuracy = oracle_accuracy(partition, labels)?;
        report.boundaries = Some(boundary_scores(graph, partition, labels, 1)?);
    }
    Ok(report)
}
