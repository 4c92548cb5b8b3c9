//! Segments of Felzenszwalb and Huttenlocher 2004 on the points, by the four local descriptors.

use super::SegmentParams;
use super::interface::{Parted, PartitionMethod, SegmentScene};
use crate::error::{Error, Result};
use crate::features::{FeatureTable, optimal_features};
use crate::graph::{EdgeMeaning, felzenszwalb};
use crate::parallel::{Monitor, map_watched};
use crate::recipes::regularise::point_graph;
use crate::segmentation::Partition;

/// Components of the graph of nearest neighbours, whose edges weigh the distance of the descriptors of their ends.
pub(super) struct Felzenszwalb;

impl PartitionMethod for Felzenszwalb {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        if params.felzenszwalb.meaning != EdgeMeaning::Dissimilarity {
            return Err(Error::parameter(
                "felzenszwalb.meaning",
                "similarity",
                "dissimilarity: distances of descriptors",
            ));
        }
        let points = &scene.points.positions;
        monitor.stage("describe", points.len() as u64);
        let descriptors = optimal_features(points, &params.neighbourhood, monitor)?.table;
        let graph = point_graph(points, params.neighbours, &params.adjacency, monitor)?;
        monitor.stage("segments", points.len() as u64);
        let weights = map_watched(graph.edges().len(), monitor, |e| apart(&descriptors, graph.edges()[e]))?;
        let boundaries = graph.clone();
        let found = felzenszwalb(&graph.with_weights(weights)?, &params.felzenszwalb, monitor)?;
        let partition = Partition::from_labels_watched(&found.of, monitor)?;
        Ok(Parted { partition, descriptors, graph: Some(boundaries), ..Parted::default() })
    }

    fn describes_points(&self) -> bool {
        true
    }
}

/// Distance between the descriptors of two points.
fn apart(descriptors: &FeatureTable, [a, b]: [u32; 2]) -> f32 {
    let [a, b] = [a, b].map(|i| descriptors.row(i as usize));
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
}
