//! The structure on which labels are made consistent: the graph of the points, or segments. It does not depend on the
//! probabilities.

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

/// The graph on which labels are made consistent. About 75 bytes a point with ten neighbours.
pub(in crate::recipes) fn adjacency(points: &Positions, params: &RegulariseParams, monitor: &Monitor) -> Result<Graph> {
    let graph = point_graph(points, params.neighbours, &params.adjacency, monitor)?;
    if params.near.is_infinite() { Ok(graph) } else { graph.weakened(points, params.near, monitor) }
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
        if matches!(params.method, Regularise::None | Regularise::Auto) {
            return Ok(Self::Alone(points.len()));
        }
        let graph = adjacency(points, params, monitor)?;
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
                let found = field(&costs, graph, params, monitor)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;
    use crate::recipes::regularise::regularise;

    /// Classes of a thin scan: 0.3 points per square metre of a plain with houses of 6 m, and probabilities that are
    /// right for most points.
    struct Village {
        points: Positions,
        values: Vec<f32>,
        truth: Vec<u16>,
    }

    fn village() -> Village {
        let mut random = stream(5, 1);
        let (mut rows, mut values, mut truth) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..12_000 {
            let [x, y] = [200.0 * random.uniform(), 200.0 * random.uniform()];
            let roof = x % 20.0 < 6.0 && y % 20.0 < 6.0;
            rows.push([x, y, if roof { 3.0 } else { 0.0 } + 0.05 * random.uniform()]);
            let sure = (0.45 + 0.4 * random.uniform()) as f32;
            values.extend(if roof { [1.0 - sure, sure] } else { [sure, 1.0 - sure] });
            truth.push(u16::from(roof));
        }
        Village { points: Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions, values, truth }
    }

    /// Share of the points of houses that are named ground.
    fn lost_roofs(scene: &Village, method: Regularise, near: f64) -> f64 {
        let given = Probabilities { values: &scene.values, classes: 2 };
        let params = RegulariseParams { method, near, ..RegulariseParams::default() };
        let found = regularise(&scene.points, given, &params, &Monitor::default()).unwrap();
        let of = |label: u16| found.labels.iter().zip(&scene.truth).filter(|(a, b)| **b == 1 && **a == label).count();
        of(0) as f64 / (of(0) + of(1)) as f64
    }

    #[test]
    fn weights_that_fall_with_the_metres_keep_the_houses_of_a_thin_scan() {
        let scene = village();
        let alone = lost_roofs(&scene, Regularise::None, 0.5);
        for method in [Regularise::PointCrf, Regularise::SegmentCrf] {
            let [relative, metric] = [f64::INFINITY, 0.5].map(|near| lost_roofs(&scene, method, near));
            assert!(relative > 0.9 && metric < alone, "{method:?}: alone {alone}, {relative}, {metric}");
        }
    }

    #[test]
    fn a_length_must_be_above_zero_and_a_dense_scan_does_not_notice_it() {
        for near in [0.0, -1.0, f64::NAN] {
            let message = RegulariseParams { near, ..RegulariseParams::default() }.validate().unwrap_err().to_string();
            assert!(message.contains("regularise.near"), "{message}");
        }
        let rows: Vec<[f32; 3]> = (0..400).map(|i| [(i % 20) as f32 * 0.1, (i / 20) as f32 * 0.1, 0.0]).collect();
        let points = Positions::from_rows(&rows);
        let graph = |near| {
            let params = RegulariseParams { near, ..RegulariseParams::default() };
            adjacency(&points, &params, &Monitor::default()).unwrap()
        };
        assert_eq!(graph(0.5), graph(f64::INFINITY));
        assert!(graph(0.05).weights().iter().all(|&w| w > 0.0 && w <= 0.26));
    }
}
