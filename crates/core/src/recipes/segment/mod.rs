//! Segmentation of a cloud: descriptors, adjacency graph, partition, and its quality.

mod dispatch;
mod felzenszwalb;
mod growing;
mod interface;
mod method;
mod on_points;
mod on_supervoxels;
mod params;
mod riemannian;

pub use method::SegmentMethod;
pub use params::{GrowingParams, SegmentParams};

use super::Labels;
use super::regularise::point_graph;
use crate::cloud::{Cloud, Column, MetricCloud, Points};
use crate::error::Result;
use crate::evaluation::{BoundaryScores, SizeBin, boundary_scores, oracle_accuracy, size_histogram};
use crate::features::{FeatureTable, optimal_features};
use crate::graph::Graph;
use crate::neighbours::OptimalParams;
use crate::parallel::{Monitor, watched};
use crate::segmentation::{Automatic, Partition, StageSeconds, Trial};
use interface::{Level, Parted, SegmentScene};
use serde::Serialize;

/// A segmented cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segmented {
    /// Segment of each point of the cloud, from 1; 0 where coordinates are not finite or stray.
    pub clusters: Vec<u32>,
    /// Points with finite coordinates that are not stray, in the order of the partition's nodes.
    pub points: Points,
    /// Linearity, planarity, scattering, verticality of these points; empty if the method does not use them, see
    /// [`Segmented::describe`].
    pub descriptors: FeatureTable,
    /// The segments of these points; segment s has number s + 1 in `clusters`.
    pub partition: Partition,
    /// For each requested level the segment of each point of the cloud, from 1; 0 where coordinates are not finite or
    /// stray.
    pub levels: Vec<Vec<u32>>,
    /// Further dimensions of all points of the cloud, with the names of [`SegmentMethod::dimensions`].
    pub columns: Vec<Column>,
    /// Report on the segmentation.
    pub report: SegmentReport,
}

impl Segmented {
    /// Computes the descriptors if they are absent.
    ///
    /// # Errors
    /// If a parameter is out of range or the work was cancelled.
    pub fn describe(&mut self, params: &OptimalParams, monitor: &Monitor) -> Result<()> {
        if self.descriptors.names.is_empty() {
            monitor.stage("describe", self.points.len() as u64);
            self.descriptors = optimal_features(&self.points.positions, params, monitor)?.table;
        }
        Ok(())
    }
}

/// Report on a segmentation.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SegmentReport {
    /// The method.
    pub method: SegmentMethod,
    /// Number of segments.
    pub segments: usize,
    /// The strength: ρ in Guinard & Landrieu 2017, μ in Li 2018; absent if the method has none.
    pub strength: Option<f64>,
    /// Number of supervoxels, if the method uses them.
    pub supervoxels: Option<usize>,
    /// The requested levels.
    pub levels: Vec<LevelReport>,
    /// Method `clusters`: its parameters, and the clusters of each level.
    pub clusters: Option<ClusterReport>,
    /// The strengths that were tried, ascending.
    pub trials: Vec<Trial>,
    /// Histogram of segment sizes.
    pub sizes: Vec<SizeBin>,
    /// Oracle accuracy, 0..1, if labels are known: the best accuracy that classifying whole segments can reach.
    pub oracle_accuracy: Option<f64>,
    /// Boundary recall and precision with a tolerance of one edge, if labels are known.
    pub boundaries: Option<BoundaryScores>,
}

/// Clusters at four levels.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ClusterReport {
    /// The parameters, and where each comes from.
    pub automatic: Automatic,
    /// Number of clusters on each level.
    pub counts: [u32; 4],
}

/// One level of a multi-scale segmentation (Li 2018, Tables 2 and 3).
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
    /// Oracle accuracy, 0..1, if labels are known.
    pub oracle_accuracy: Option<f64>,
}

/// Segments a cloud by the method that the parameters name.
///
/// Labels only serve to measure the quality of the partition, and for the intent that is based on them. Memory is at most
/// about 200 bytes a point: the cloud and its coordinates (50), descriptors (16), the graph of nearest neighbours (75) and
/// the state of the merging (40), or voxels and their adjacency (90). The result is the same bytes for any number of
/// threads, except for the seconds in the report.
///
/// # Errors
/// If a parameter is out of range, the intent needs labels and there are none, no point is finite, or the work was
/// cancelled.
pub fn segment(cloud: &Cloud, labels: Option<&Labels>, params: &SegmentParams, monitor: &Monitor) -> Result<Segmented> {
    params.validate()?;
    let metric = MetricCloud::new(cloud, None, monitor)?;
    let points = metric.some_points(monitor)?;
    metric.oddities().into_iter().for_each(|text| monitor.warn(text));
    let known = labels.map(|labels| labels.of(&points.frame.index));
    let scene = SegmentScene { cloud, points: &points, labels: known.as_deref() };
    let found = params.method.method().part(&scene, params, monitor)?;
    monitor.check()?;
    let report = judge(&found, &scene, params, monitor)?;
    let in_cloud = |partition: &Partition| {
        let mut clusters = vec![0; cloud.len()];
        for piece in watched(points.len(), monitor) {
            piece?.for_each(|i| clusters[points.frame.index[i] as usize] = partition.segments()[i] + 1);
        }
        Ok(clusters)
    };
    let clusters = in_cloud(&found.partition)?;
    let levels = found.levels.iter().map(|level| in_cloud(&level.segments)).collect::<Result<_>>()?;
    let Parted { partition, descriptors, columns, .. } = found;
    Ok(Segmented { clusters, levels, descriptors, partition, points, columns, report })
}

fn judge(found: &Parted, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<SegmentReport> {
    let labels = scene.labels.filter(|labels| labels.iter().any(Option::is_some));
    let mut report = SegmentReport {
        method: params.method,
        segments: found.partition.len(),
        clusters: found.clusters.clone(),
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
                made = point_graph(&scene.points.positions, params.neighbours, &params.adjacency, monitor)?;
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
