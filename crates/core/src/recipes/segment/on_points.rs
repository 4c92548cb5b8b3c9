//! Minimal partitions of the points by the four local descriptors.

use super::method::{PartitionMethod, SegmentScene};
use super::{Parted, SegmentParams};
use crate::cloud::Positions;
use crate::error::Result;
use crate::features::optimal_features;
use crate::graph::{Graph, knn_graph};
use crate::neighbours::knn;
use crate::parallel::Monitor;
use crate::segmentation::{Intent, Method, PartitionInput, PartitionParams, Signal, partition_by_intent};

/// Guinard & Landrieu 2017, section 3, by one of the minimisers.
pub(super) struct OnPoints(pub(super) Method);

impl PartitionMethod for OnPoints {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let points = &scene.points.positions;
        monitor.stage("describe", points.len() as u64);
        let descriptors = optimal_features(points, &params.neighbourhood, monitor)?.table;
        let graph = adjacency(points, params, monitor)?;
        monitor.stage("segments", points.len() as u64);
        let signal = Signal::new(&descriptors.values, descriptors.width())?;
        let input = PartitionInput { signal, graph: &graph, points: Some(points), labels: scene.labels };
        let partition = PartitionParams { method: self.0, ..params.partition.clone() };
        let found = partition_by_intent(&input, &partition, monitor)?;
        Ok(Parted {
            partition: found.partition,
            descriptors,
            graph: Some(graph),
            strength: Some(found.strength),
            trials: found.trials,
            ..Parted::default()
        })
    }

    fn aim(&self, params: &mut SegmentParams, aim: Intent) -> Option<()> {
        params.partition.intent = aim;
        Some(())
    }
}

/// The graph of nearest neighbours of the points.
pub(super) fn adjacency(points: &Positions, params: &SegmentParams, monitor: &Monitor) -> Result<Graph> {
    let near = knn(points, params.neighbours, monitor)?;
    knn_graph(points.len(), near, &params.adjacency, monitor)
}
