//! What labels are made consistent on: the graph of the points, or segments. Independent of the probabilities.

use super::field::field;
use super::on_segments::Segments;
use super::{Probabilities, Regularise, RegulariseParams, Regularised};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::features::{FeatureTable, optimal_features};
use crate::graph::{Graph, KnnGraphParams, knn_graph};
use crate::neighbours::knn;
use crate::parallel::Monitor;
use crate::regularisation::local_smoothing;
use crate::segmentation::{PartitionInput, PartitionParams, Signal, StrengthSearch, partition_by_intent};

/// What labels are made consistent on.
#[derive(Debug)]
pub(in crate::recipes) enum Support {
    /// Each point for itself; the number of points.
    Alone(usize),
    /// The graph of the points' nearest neighbours.
    Points(Graph),
    /// Segments and their graph.
    Segments(Segments),
}

/// Points and the descriptors on which segments are based.
#[derive(Clone, Copy)]
pub(in crate::recipes) struct DescribedPoints<'a> {
    pub(in crate::recipes) points: &'a Positions,
    pub(in crate::recipes) descriptors: &'a FeatureTable,
    /// Labels, where they are known, for the oracle accuracy.
    pub(in crate::recipes) labels: Option<&'a [Option<u8>]>,
}

/// The graph of the points' nearest neighbours. About 75 bytes a point with ten neighbours.
pub(in crate::recipes) fn point_graph(
    points: &Positions,
    neighbours: usize,
    adjacency: &KnnGraphParams,
    monitor: &Monitor,
) -> Result<Graph> {
    knn_graph(points.len(), knn(points, neighbours, monitor)?, adjacency, monitor)
}

/// The minimal partition of the points by their descriptors.
pub(in crate::recipes) fn partition(
    described: DescribedPoints<'_>,
    graph: &Graph,
    params: &PartitionParams,
    monitor: &Monitor,
) -> Result<StrengthSearch> {
    let DescribedPoints { points, descriptors, labels } = described;
    monitor.stage("segments", descriptors.rows() as u64);
    let signal = Signal::new(&descriptors.values, descriptors.width())?;
    partition_by_intent(&PartitionInput { signal, graph, points: Some(points), labels }, params, monitor)
}

impl Support {
    /// What `params.method` needs. `descriptors` are computed if they are needed but not given.
    pub(in crate::recipes) fn new(
        points: &Positions,
        descriptors: Option<&FeatureTable>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        params.validate()?;
        if params.method == Regularise::None {
            return Ok(Self::Alone(points.len()));
        }
        let graph = point_graph(points, params.neighbours, &params.adjacency, monitor)?;
        if !params.method.has_segments() {
            return Ok(Self::Points(graph));
        }
        let own;
        let descriptors = match descriptors {
            Some(table) => table,
            None => {
                own = optimal_features(points, &params.neighbourhood, monitor)?.table;
                &own
            }
        };
        let described = DescribedPoints { points, descriptors, labels: None };
        let found = partition(described, &graph, &params.partition, monitor)?;
        Ok(Self::Segments(Segments::new(found, &graph, monitor)?))
    }

    /// Number of points.
    fn points(&self) -> usize {
        match self {
            Self::Alone(points) => *points,
            Self::Points(graph) => graph.len(),
            Self::Segments(segments) => segments.of_points().len(),
        }
    }

    /// The labels for these probabilities.
    pub(in crate::recipes) fn decide(
        &self,
        given: Probabilities<'_>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Regularised> {
        let Probabilities { values, classes } = given;
        if classes == 0 || values.len() != self.points() * classes {
            let points = self.points();
            return Err(Error::input(format!(
                "{} probabilities for {points} points of {classes} classes",
                values.len()
            )));
        }
        let smooth = smoothed(given, params.smoothing);
        match self {
            Self::Alone(_) => Ok(Regularised::by_largest(smooth, classes, None)),
            Self::Points(graph) if params.method == Regularise::Local => {
                Ok(Regularised::by_largest(local_smoothing(&smooth, classes, graph, monitor)?, classes, None))
            }
            Self::Points(graph) => {
                monitor.stage("random field", graph.len() as u64);
                let costs: Vec<f32> = smooth.iter().map(|p| -p.ln()).collect();
                let found = field(&costs, graph, params.strength, monitor)?;
                Ok(Regularised { labels: found.labels, rows: smooth, partition: None, energy: Some(found.energy) })
            }
            Self::Segments(segments) => segments.decide(Probabilities { values: &smooth, classes }, params, monitor),
        }
    }
}

/// (1 − α) p + α / classes.
pub(super) fn smoothed(given: Probabilities<'_>, alpha: f64) -> Vec<f32> {
    let floor = alpha / given.classes as f64;
    given.values.iter().map(|&p| ((1.0 - alpha) * f64::from(p) + floor) as f32).collect()
}
