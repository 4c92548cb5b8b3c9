//! Minimal partitions of the points by the four local descriptors.

use super::SegmentParams;
use super::interface::{Parted, PartitionMethod, SegmentScene};
use crate::error::Result;
use crate::features::optimal_features;
use crate::parallel::Monitor;
use crate::recipes::regularise::{DescribedPoints, partition, point_graph};
use crate::segmentation::{Intent, Method, PartitionParams};

/// Guinard & Landrieu 2017, section 3, by one of the minimisers.
pub(super) struct OnPoints(pub(super) Method);

impl PartitionMethod for OnPoints {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let points = &scene.points.positions;
        monitor.stage("describe", points.len() as u64);
        let descriptors = optimal_features(points, &params.neighbourhood, monitor)?.table;
        let graph = point_graph(points, params.neighbours, &params.adjacency, monitor)?;
        let described = DescribedPoints { points, descriptors: &descriptors, labels: scene.labels };
        let params = PartitionParams { method: self.0, ..params.partition.clone() };
        let found = partition(described, &graph, &params, monitor)?;
        Ok(Parted {
            partition: found.partition,
            descriptors,
            graph: Some(graph),
            strength: Some(found.strength),
            trials: found.trials,
            ..Parted::default()
        })
    }

    fn merges_small(&self) -> bool {
        true
    }

    fn describes_points(&self) -> bool {
        true
    }

    fn aim(&self, params: &mut SegmentParams, aim: Intent) -> Option<()> {
        params.partition.intent = aim;
        Some(())
    }
}
