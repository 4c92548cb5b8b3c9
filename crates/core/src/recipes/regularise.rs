//! Regularisation: from class probabilities of single points to labels that are consistent among neighbours. Works with
//! any trained model.
//!
//! S. Guinard, L. Landrieu, *Weakly supervised segmentation-aided classification of urban scenes from 3D LiDAR point
//! clouds*, ISPRS Archives XLII-1/W1, 2017, doi:10.5194/isprs-archives-XLII-1-W1-151-2017, sections 3 and 4.
//! `docs/weak.md` has the equations.

use super::segments::{Again, Segments};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::features::{FeatureTable, optimal_features};
use crate::graph::{Graph, KnnGraphParams, connected_components, knn_graph};
use crate::neighbours::{OptimalParams, knn};
use crate::parallel::Monitor;
use crate::regularisation::{ExpansionParams, Labelling, alpha_expansion, local_smoothing};
use crate::segmentation::{Intent, Partition, PartitionInput, PartitionParams, Signal, partition_by_intent};
use serde::{Deserialize, Serialize};

/// The method of regularisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Regularise {
    /// None: each point has its most probable class.
    #[default]
    None,
    /// Local smoothing: the mean of the neighbours' probabilities.
    Local,
    /// A conditional random field on the points: each edge between different labels costs `strength`.
    PointCrf,
    /// Each segment takes the most probable class of its mean probabilities.
    Consensus,
    /// A conditional random field on the segments: the paper's method.
    SegmentCrf,
}

impl Regularise {
    /// All methods.
    pub const ALL: [Self; 5] = [Self::None, Self::Local, Self::PointCrf, Self::Consensus, Self::SegmentCrf];

    /// The name as in TOML and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Local => "local",
            Self::PointCrf => "point-crf",
            Self::Consensus => "consensus",
            Self::SegmentCrf => "segment-crf",
        }
    }

    /// One line about it.
    pub fn title(self) -> &'static str {
        match self {
            Self::None => "No regularisation",
            Self::Local => "Mean of the neighbours' probabilities",
            Self::PointCrf => "Conditional random field on the points",
            Self::Consensus => "The most probable class of each segment, by its mean probabilities",
            Self::SegmentCrf => "Conditional random field on the segments (Guinard and Landrieu 2017)",
        }
    }
}

/// How the probabilities of a segment's points are combined into one cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Posterior {
    /// The logarithm of the mean, as in the paper: a single confident point cannot outvote the others.
    #[default]
    LogOfMean,
    /// The mean of the logarithms: the energy of the point field, restricted to labellings that are constant on
    /// segments.
    MeanOfLogs,
}

/// Parameters of [`regularise`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegulariseParams {
    /// The method of regularisation.
    pub method: Regularise,
    /// α: p = (1 − α) p + α / classes keeps every class possible. 0 < α ≤ 1.
    pub smoothing: f64,
    /// σ: cost of an edge of weight 1 between different labels, ≥ 0; infinite gives one label to all that is connected.
    pub strength: f64,
    /// How the probabilities of a segment's points are combined.
    pub posterior: Posterior,
    /// Number of nearest neighbours that each point is connected to, at least 1.
    pub neighbours: usize,
    /// Weights of these edges.
    pub adjacency: KnnGraphParams,
    /// Neighbourhoods for the descriptors on which the segments are based, if the model has none.
    pub neighbourhood: OptimalParams,
    /// The segments. The strength is 0.03, which suits streets and airborne scans; Guinard & Landrieu 2017 use 0.1.
    pub partition: PartitionParams,
}

impl Default for RegulariseParams {
    fn default() -> Self {
        Self {
            method: Regularise::None,
            smoothing: 0.01,
            strength: 1.0,
            posterior: Posterior::LogOfMean,
            neighbours: 10,
            adjacency: KnnGraphParams::default(),
            neighbourhood: OptimalParams::default(),
            partition: PartitionParams { intent: Intent::Strength(0.03), ..PartitionParams::default() },
        }
    }
}

impl RegulariseParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if !(self.smoothing > 0.0 && self.smoothing <= 1.0) {
            return Err(Error::parameter("regularise.smoothing", self.smoothing, "above 0, at most 1"));
        }
        if self.strength.is_nan() || self.strength < 0.0 {
            return Err(Error::parameter("regularise.strength", self.strength, "0 or more; may be infinite"));
        }
        if self.neighbours == 0 {
            return Err(Error::parameter("regularise.neighbours", 0, "1 or more"));
        }
        self.adjacency.validate()?;
        self.neighbourhood.validate()?;
        self.partition.validate()
    }
}

/// Class probabilities of points.
#[derive(Clone, Copy, Debug)]
pub struct Probabilities<'a> {
    /// Row-major `points x classes`.
    pub values: &'a [f32],
    /// Number of classes.
    pub classes: usize,
}

/// Result of [`regularise`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Regularised {
    /// Position of the class of each point.
    pub labels: Vec<u16>,
    /// Row-major `points x classes`: the probabilities that the decision is based on (of the point, its neighbourhood,
    /// or its segment).
    pub probabilities: Vec<f32>,
    /// The segments, if the method uses any.
    pub partition: Option<Partition>,
    /// Energy of the labels, if the method minimises one.
    pub energy: Option<f64>,
}

/// Regularised labels from class probabilities of points.
///
/// `descriptors` are linearity, planarity, scattering and verticality of each point ([`optimal_features`]); they are
/// computed if they are needed but not given. The result is the same bytes for any number of threads.
///
/// # Errors
/// If a parameter is out of range, there is not one row of probabilities a point, or the work was cancelled.
pub fn regularise(
    points: &Positions,
    given: Probabilities<'_>,
    descriptors: Option<&FeatureTable>,
    params: &RegulariseParams,
    monitor: &Monitor,
) -> Result<Regularised> {
    let scene = Scene::new(points, descriptors, params, monitor)?;
    scene.decide(given, params, monitor)
}

/// Graph of the points and segments: everything that does not depend on the probabilities.
#[derive(Debug)]
pub(super) struct Scene {
    points: usize,
    graph: Graph,
    segments: Option<Segments>,
}

impl Scene {
    pub(super) fn new(
        points: &Positions,
        descriptors: Option<&FeatureTable>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        let mut scene = Self::to_be_recut(points, descriptors, params, monitor)?;
        if scene.segments.is_some() {
            // Segments have a graph of their own; the large graph of the points is no longer needed.
            scene.graph = Graph::default();
        }
        Ok(scene)
    }

    /// The same, keeping the graph of the points for [`Scene::recut`].
    pub(super) fn to_be_recut(
        points: &Positions,
        descriptors: Option<&FeatureTable>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        params.validate()?;
        let mut scene = Self { points: points.len(), graph: Graph::default(), segments: None };
        if params.method == Regularise::None {
            return Ok(scene);
        }
        let near = knn(points, params.neighbours, monitor)?;
        scene.graph = knn_graph(points.len(), near, &params.adjacency, monitor)?;
        if matches!(params.method, Regularise::Consensus | Regularise::SegmentCrf) {
            let own;
            let table = match descriptors {
                Some(table) => table,
                None => {
                    own = optimal_features(points, &params.neighbourhood, monitor)?.table;
                    &own
                }
            };
            monitor.stage("segments", table.rows() as u64);
            let signal = Signal::new(&table.values, table.width())?;
            let input = PartitionInput { signal, graph: &scene.graph, points: Some(points), labels: None };
            let found = partition_by_intent(&input, &params.partition, monitor)?;
            scene.segments = Some(Segments::new(found, &scene.graph, monitor)?);
        }
        Ok(scene)
    }

    /// Frees what is only needed to cut segments without any of these points: the edges inside them.
    pub(super) fn only_recut_at(&mut self, points: impl Iterator<Item = u32>) {
        let Some(segments) = &self.segments else { return };
        let of = segments.of_points();
        let mut held = vec![false; segments.len()];
        points.for_each(|point| held[of[point as usize] as usize] = true);
        self.graph.retain(|[a, b]| {
            let [s, t] = [of[a as usize], of[b as usize]];
            s != t || held[s as usize]
        });
    }

    /// Segments some segments again, more finely.
    pub(super) fn recut(
        &mut self,
        descriptors: &FeatureTable,
        again: &Again<'_>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<()> {
        let Some(segments) = &mut self.segments else { return Ok(()) };
        monitor.stage("segments", descriptors.rows() as u64);
        let signal = Signal::new(&descriptors.values, descriptors.width())?;
        let scene = PartitionInput { signal, graph: &self.graph, points: None, labels: None };
        segments.recut(&scene, again, &params.partition, monitor)
    }

    /// Oracle accuracy, if there are segments and labels.
    pub(super) fn oracle_accuracy(&self, labels: &[Option<u8>]) -> Result<Option<f64>> {
        self.segments.as_ref().map_or(Ok(None), |segments| segments.oracle_accuracy(labels))
    }

    /// The labels for these probabilities.
    pub(super) fn decide(
        &self,
        given: Probabilities<'_>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Regularised> {
        if given.classes == 0 || given.values.len() != self.points * given.classes {
            return Err(Error::input(format!(
                "{} probabilities for {} points of {} classes",
                given.values.len(),
                self.points,
                given.classes
            )));
        }
        let smooth = smoothed(given, params.smoothing);
        let classes = given.classes;
        match (params.method, &self.segments) {
            (Regularise::None, _) => Ok(by_largest(smooth, classes)),
            (Regularise::Local, _) => Ok(by_largest(local_smoothing(&smooth, classes, &self.graph, monitor)?, classes)),
            (Regularise::PointCrf, _) => self.point_field(smooth, classes, params, monitor),
            (_, Some(segments)) => segments.decide(Probabilities { values: &smooth, classes }, params, monitor),
            (_, None) => Err(Error::input("segments are needed, but there are none")),
        }
    }

    fn point_field(
        &self,
        smooth: Vec<f32>,
        classes: usize,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Regularised> {
        monitor.stage("agree", self.points as u64);
        let costs: Vec<f32> = smooth.iter().map(|p| -p.ln()).collect();
        let costs = Costs { values: &costs, classes };
        let found = field(&costs, &self.graph, params.strength, monitor)?;
        let energy = Some(found.energy);
        Ok(Regularised { labels: found.labels, probabilities: smooth, partition: None, energy })
    }
}

/// Unary costs of nodes.
pub(super) struct Costs<'a> {
    /// Row-major `nodes x classes`.
    pub(super) values: &'a [f32],
    pub(super) classes: usize,
}

/// The labelling of lowest energy found by α-expansion.
pub(super) fn field(costs: &Costs<'_>, graph: &Graph, strength: f64, monitor: &Monitor) -> Result<Labelling> {
    let Costs { values: costs, classes } = *costs;
    if strength.is_finite() {
        let expansion = ExpansionParams { strength, ..ExpansionParams::default() };
        return alpha_expansion(costs, graph, &expansion, monitor);
    }
    let pieces = connected_components(graph, monitor)?;
    let mut sums = vec![0.0f64; pieces.count * classes];
    for (row, &piece) in costs.chunks_exact(classes).zip(&pieces.of) {
        let sum = &mut sums[piece as usize * classes..][..classes];
        sum.iter_mut().zip(row).for_each(|(sum, &cost)| *sum += f64::from(cost));
    }
    let cheapest = |row: &[f64]| (1..row.len()).fold(0, |best, c| if row[c] < row[best] { c } else { best });
    let of_piece: Vec<usize> = sums.chunks_exact(classes).map(cheapest).collect();
    let energy = of_piece.iter().enumerate().map(|(piece, &label)| sums[piece * classes + label]).sum();
    let labels = pieces.of.iter().map(|&piece| of_piece[piece as usize] as u16).collect();
    Ok(Labelling { labels, energy, trace: vec![energy], converged: true })
}

/// (1 − α) p + α / classes.
fn smoothed(given: Probabilities<'_>, alpha: f64) -> Vec<f32> {
    let floor = alpha / given.classes as f64;
    given.values.iter().map(|&p| ((1.0 - alpha) * f64::from(p) + floor) as f32).collect()
}

/// The most probable class of every row; ties go to the first class.
pub(super) fn by_largest(probabilities: Vec<f32>, classes: usize) -> Regularised {
    let labels = probabilities.chunks_exact(classes).map(largest).collect();
    Regularised { labels, probabilities, ..Regularised::default() }
}

/// Position of the largest value; the first of equal ones.
pub(super) fn largest(row: &[f32]) -> u16 {
    crate::classification::argmax(row) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;

    /// Two planes that meet, and noisy probabilities: class 0 on the floor, 1 on the wall, 2 nowhere.
    fn scene() -> (Positions, Vec<f32>, Vec<u16>) {
        let mut random = stream(3, 1);
        let (mut rows, mut values, mut truth) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..40 {
            for j in 0..40 {
                for wall in [false, true] {
                    let (a, b) = (f64::from(i) * 0.2, f64::from(j) * 0.2 + 0.2);
                    rows.push(if wall { [a, 0.0, b] } else { [a, b, 0.0] });
                    let sure = 0.3 + 0.5 * random.uniform();
                    let rest = (1.0 - sure) * random.uniform();
                    let p = [sure, rest, 1.0 - sure - rest].map(|p| p as f32);
                    values.extend(if wall { [p[1], p[0], p[2]] } else { p });
                    truth.push(u16::from(wall));
                }
            }
        }
        (Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions, values, truth)
    }

    fn run(params: &RegulariseParams) -> (Regularised, Vec<u16>) {
        let (points, values, truth) = scene();
        let given = Probabilities { values: &values, classes: 3 };
        (regularise(&points, given, None, params, &Monitor::default()).unwrap(), truth)
    }

    fn wrong(method: Regularise) -> usize {
        let (found, truth) = run(&RegulariseParams { method, ..RegulariseParams::default() });
        found.labels.iter().zip(&truth).filter(|(a, b)| a != b).count()
    }

    #[test]
    fn agreement_removes_errors() {
        let alone = wrong(Regularise::None);
        assert!(alone > 200, "{alone}");
        for method in [Regularise::Local, Regularise::PointCrf, Regularise::Consensus, Regularise::SegmentCrf] {
            assert!(wrong(method) * 4 < alone, "{method:?}: {} of {alone}", wrong(method));
        }
    }

    #[test]
    fn smoothed_probabilities_are_positive_and_sum_to_one() {
        let (found, _) = run(&RegulariseParams { smoothing: 0.03, ..RegulariseParams::default() });
        for row in found.probabilities.chunks_exact(3) {
            assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5 && row.iter().all(|&p| p >= 0.00999), "{row:?}");
        }
    }

    #[test]
    fn without_strength_segments_decide_alone_and_with_all_of_it_connected_parts_do() {
        let with = |method, strength| run(&RegulariseParams { method, strength, ..RegulariseParams::default() }).0;
        assert_eq!(with(Regularise::SegmentCrf, 0.0).labels, with(Regularise::Consensus, 1.0).labels);
        for method in [Regularise::PointCrf, Regularise::SegmentCrf] {
            let one = with(method, f64::INFINITY).labels;
            assert!(one.iter().all(|l| *l == one[0]));
            assert_eq!(one, with(method, 1e6).labels);
        }
    }

    #[test]
    fn the_mean_of_the_logs_gives_the_point_fields_energy_of_constant_segments() {
        let params = RegulariseParams {
            method: Regularise::SegmentCrf,
            posterior: Posterior::MeanOfLogs,
            partition: PartitionParams { intent: Intent::Strength(0.3), ..PartitionParams::default() },
            ..RegulariseParams::default()
        };
        let (points, values, _) = scene();
        let given = Probabilities { values: &values, classes: 3 };
        let found = regularise(&points, given, None, &params, &Monitor::default()).unwrap();
        let smooth = smoothed(given, params.smoothing);
        let graph = knn_graph(
            points.len(),
            knn(&points, 10, &Monitor::default()).unwrap(),
            &params.adjacency,
            &Monitor::default(),
        )
        .unwrap();
        let unary: f64 =
            found.labels.iter().zip(smooth.chunks_exact(3)).map(|(l, p)| -f64::from(p[usize::from(*l)]).ln()).sum();
        let cut = graph.edges().iter().filter(|[a, b]| found.labels[*a as usize] != found.labels[*b as usize]).count();
        // The segments' costs are relative to that of their cheapest label.
        let partition = found.partition.unwrap();
        let shift: f64 = (0..partition.len())
            .map(|s| {
                let of = |c: usize| {
                    partition.members(s).iter().map(|&i| -f64::from(smooth[3 * i as usize + c]).ln()).sum::<f64>()
                };
                (0..3).map(of).fold(f64::INFINITY, f64::min)
            })
            .sum();
        let expected = unary + cut as f64;
        assert!((found.energy.unwrap() + shift - expected).abs() < 1e-3 * expected, "{expected}");
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        let (points, values, _) = scene();
        let given = Probabilities { values: &values, classes: 3 };
        let refused = |given: Probabilities<'_>, params: RegulariseParams| {
            regularise(&points, given, None, &params, &Monitor::default()).unwrap_err().to_string()
        };
        let params = || RegulariseParams { method: Regularise::PointCrf, ..RegulariseParams::default() };
        assert!(refused(given, RegulariseParams { strength: -1.0, ..params() }).contains("strength"));
        assert!(refused(given, RegulariseParams { smoothing: 0.0, ..params() }).contains("smoothing"));
        assert!(refused(given, RegulariseParams { neighbours: 0, ..params() }).contains("neighbours"));
        assert!(refused(Probabilities { values: &values[3..], classes: 3 }, params()).contains("probabilities"));
    }
}
