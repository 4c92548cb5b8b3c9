//! Runs each segmentation method on the points of a cloud.

use super::{SegmentMethod, SegmentParams};
use crate::cloud::{Cloud, Points};
use crate::error::Result;
use crate::features::{FeatureTable, normals, optimal_features};
use crate::graph::{Graph, knn_graph};
use crate::neighbours::knn;
use crate::parallel::Monitor;
use crate::recipes::SupervoxelMode;
use crate::segmentation::{
    Method, Partition, PartitionInput, PartitionParams, Scale, Signal, StageSeconds, Trial, multi_scale,
    octree_region_growing, partition_by_intent, region_growing,
};

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
}

/// The partition at one depth.
pub(super) struct Level {
    pub(super) min_depth: u32,
    pub(super) supervoxels: usize,
    pub(super) segments: Partition,
    pub(super) seconds: StageSeconds,
}

/// Segments the points; `labels`, one a point, are for the intent that is based on them.
pub(super) fn part(
    (cloud, points): (&Cloud, &Points),
    labels: Option<&[Option<u8>]>,
    params: &SegmentParams,
    monitor: &Monitor,
) -> Result<Parted> {
    match params.method {
        SegmentMethod::CutPursuit => on_points(points, labels, (params, Method::CutPursuit), monitor),
        SegmentMethod::Merge => on_points(points, labels, (params, Method::Merge), monitor),
        SegmentMethod::Riemannian => on_supervoxels(points, params, monitor),
        SegmentMethod::LocalGraph | SegmentMethod::Slic | SegmentMethod::Vccs => {
            of_supervoxels((cloud, points), params, monitor)
        }
        SegmentMethod::RegionGrowing => {
            let near = knn(points, params.growing.neighbours, monitor)?;
            let surface = normals(points, &near, monitor)?;
            let grown = region_growing(&near, &surface, &params.region_growing, monitor)?;
            let partition = grown.partition(points, params.growing.leftovers, monitor)?;
            Ok(Parted { partition, ..Parted::default() })
        }
        SegmentMethod::OctreeRegionGrowing => {
            let grown = octree_region_growing(points, &params.octree_region_growing, monitor)?;
            let partition = grown.partition(points, params.growing.leftovers, monitor)?;
            Ok(Parted { partition, ..Parted::default() })
        }
    }
}

/// The graph of nearest neighbours of the points.
pub(super) fn adjacency(points: &Points, params: &SegmentParams, monitor: &Monitor) -> Result<Graph> {
    let near = knn(points, params.neighbours, monitor)?;
    knn_graph(points.len(), near, &params.adjacency, monitor)
}

fn on_points(
    points: &Points,
    labels: Option<&[Option<u8>]>,
    (params, method): (&SegmentParams, Method),
    monitor: &Monitor,
) -> Result<Parted> {
    monitor.stage("describe", points.len() as u64);
    let descriptors = optimal_features(points, &params.neighbourhood, monitor)?.table;
    let graph = adjacency(points, params, monitor)?;
    monitor.stage("segments", points.len() as u64);
    let signal = Signal::new(&descriptors.values, descriptors.width())?;
    let scene = PartitionInput { signal, graph: &graph, points: Some(points), labels };
    let partition = PartitionParams { method, ..params.partition.clone() };
    let found = partition_by_intent(&scene, &partition, monitor)?;
    Ok(Parted {
        partition: found.partition,
        descriptors,
        graph: Some(graph),
        strength: Some(found.strength),
        trials: found.trials,
        ..Parted::default()
    })
}

fn on_supervoxels(points: &Points, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
    // The normals are the same at all depths: a single call computes the segments and the levels.
    let depths = std::iter::once(params.riemannian.octree.min_depth).chain(params.levels.iter().copied());
    let mut scales = multi_scale(points, &params.riemannian, depths, monitor)?.into_iter().map(Level::from);
    let Some(found) = scales.next() else { return Ok(Parted::default()) };
    Ok(Parted {
        partition: found.segments,
        strength: Some(params.riemannian.strength),
        supervoxels: Some(found.supervoxels),
        levels: scales.collect(),
        ..Parted::default()
    })
}

impl From<Scale> for Level {
    fn from(Scale { min_depth, found }: Scale) -> Self {
        let supervoxels = found.supervoxels.len();
        Self { min_depth, supervoxels, segments: found.segments, seconds: found.seconds }
    }
}

fn of_supervoxels((cloud, points): (&Cloud, &Points), params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
    let mut objects = params.objects.clone();
    let colours = objects.colours(cloud, points)?;
    objects.supervoxels = match params.method {
        SegmentMethod::Slic => SupervoxelMode::Slic,
        SegmentMethod::Vccs => SupervoxelMode::Vccs,
        _ => objects.supervoxels,
    };
    let supervoxels = objects.supervoxels(points, colours.as_deref(), monitor)?;
    let partition = match params.method {
        SegmentMethod::LocalGraph => objects.joined(&supervoxels, monitor)?,
        _ => supervoxels.partition(monitor)?,
    };
    Ok(Parted { partition, supervoxels: Some(supervoxels.len()), ..Parted::default() })
}
