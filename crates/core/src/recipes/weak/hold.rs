//! Labels as hard constraints: a segment classified differently from a label in it is divided.

use super::describe::WeakScene;
use super::examples::{Example, WeakLabels};
use super::learned::LabelledPosition;
use crate::classes::ClassTable;
use crate::cloud::{Cloud, MetricCloud};
use crate::error::Result;
use crate::features::FeatureTable;
use crate::graph::Graph;
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::regularise::{
    Again, DescribedPoints, Probabilities, RegulariseParams, Regularised, Segments, Support, adjacency, partition,
};
use crate::segmentation::{PartitionInput, Signal};

/// The labelled points of a cloud that is classified, ascending.
#[derive(Clone, Copy)]
pub(super) struct KnownLabels<'a> {
    /// Each with the position of its class.
    pub(super) labels: &'a [(u32, u16)],
    /// Share of the strength with which contradicted segments are divided.
    pub(super) step: f64,
}

/// What labels are made consistent on, with known labels as hard constraints.
pub(super) struct Constrained {
    support: Support,
    /// Absent if no segment may be divided.
    divisible: Option<Divisible>,
}

/// What is needed to divide segments: the graph of the points, and their descriptors.
struct Divisible {
    graph: Graph,
    descriptors: FeatureTable,
    labels: Vec<(u32, u16)>,
    step: f64,
}

impl WeakLabels {
    /// The positions of the labelled points, at most `hold_most` of each class, spread evenly over them.
    pub(super) fn remember(&self, examples: &[Example], position: impl Fn(u32) -> [f64; 3]) -> Vec<LabelledPosition> {
        let mut labels = Vec::new();
        if self.hold {
            for same in examples.chunk_by(|a, b| a.code == b.code) {
                let step = same.len().div_ceil(self.hold_most).max(1);
                labels.extend(
                    same.iter().step_by(step).map(|e| LabelledPosition { at: position(e.point), code: e.code }),
                );
            }
        }
        labels
    }

    /// The points of a cloud at labelled positions, each with the position of its class, ascending.
    pub(super) fn found(
        &self,
        labels: &[LabelledPosition],
        scene: &WeakScene<'_>,
        classes: &ClassTable,
        monitor: &Monitor,
    ) -> Result<Vec<(u32, u16)>> {
        let MetricCloud { cloud, metres, .. } = *scene.metric;
        if !self.hold || labels.is_empty() {
            return Ok(Vec::new());
        }
        let Some([low, high]) = cloud.bounds_watched(monitor)? else { return Ok(Vec::new()) };
        let rim = self.hold_within / metres;
        let inside = |at: &[f64; 3]| (0..3).all(|a| (low[a] - rim..=high[a] + rim).contains(&at[a]));
        let labels: Vec<&LabelledPosition> = labels.iter().filter(|label| inside(&label.at)).collect();
        if labels.is_empty() {
            return Ok(Vec::new());
        }
        let rows: Vec<[f64; 3]> = labels.iter().map(|label| label.at).collect();
        let rows = Cloud::from_rows(&rows)?;
        let places = MetricCloud::new(&rows, Some(metres), monitor)?.points_and_strays(monitor)?;
        let places = places.moved_to(scene.points.frame.origin)?.positions;
        let near = nearest_of(&scene.points.positions, &places, 1, monitor)?;
        let close = (0..labels.len()).filter(|&q| f64::from(near.squared_distances(q)[0]).sqrt() <= self.hold_within);
        let named = close.filter_map(|q| Some((near.of(q)[0], classes.position(labels[q].code)? as u16)));
        let mut found: Vec<(u32, u16)> = named.collect();
        found.sort_unstable();
        found.dedup_by_key(|(point, _)| *point);
        Ok(found)
    }
}

impl Constrained {
    /// Support for `params.method`. The graph of the points is kept only if there are labels, and only where segments may
    /// be divided.
    pub(super) fn new(
        described: DescribedPoints<'_>,
        known: KnownLabels<'_>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        let DescribedPoints { points, descriptors, .. } = described;
        if !params.method.has_segments() || known.labels.is_empty() {
            let support = Support::new(points, Some(descriptors), params, monitor)?;
            return Ok(Self { support, divisible: None });
        }
        params.validate()?;
        let mut graph = adjacency(points, params, monitor)?;
        let segments = Segments::new(partition(described, &graph, &params.partition, monitor)?, &graph, monitor)?;
        keep_edges(&mut graph, &segments, known.labels);
        let KnownLabels { labels, step } = known;
        let divisible = Divisible { graph, descriptors: descriptors.clone(), labels: labels.to_vec(), step };
        Ok(Self { support: Support::Segments(segments), divisible: Some(divisible) })
    }

    /// The labels for these probabilities. Segments that contradict a label in them are divided, and everything is
    /// classified again.
    ///
    /// # Errors
    /// As [`Support::decide`].
    pub(super) fn decide(
        mut self,
        given: Probabilities<'_>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Regularised> {
        let found = self.support.decide(given, params, monitor)?;
        let (Some(divisible), Support::Segments(segments)) = (&self.divisible, &mut self.support) else {
            return Ok(found);
        };
        let contradicted = contradicted(&found, &divisible.labels);
        if contradicted.is_empty() {
            return Ok(found);
        }
        // All segments are classified again; this result holds memory that is needed for them.
        drop(found);
        let Divisible { graph, descriptors, step, .. } = divisible;
        monitor.stage("segments", descriptors.rows() as u64);
        let signal = Signal::new(&descriptors.values, descriptors.width())?;
        let input = PartitionInput { signal, graph, points: None, labels: None };
        let again = Again { segments: &contradicted, step: *step };
        segments.recut(&input, &again, &params.partition, monitor)?;
        self.support.decide(given, params, monitor)
    }
}

/// Removes the edges inside segments that contain none of these points: such segments are not divided.
fn keep_edges(graph: &mut Graph, segments: &Segments, labels: &[(u32, u16)]) {
    let of = segments.of_points();
    let mut held = vec![false; segments.len()];
    labels.iter().for_each(|(point, _)| held[of[*point as usize] as usize] = true);
    graph.retain(|[a, b]| {
        let [s, t] = [of[a as usize], of[b as usize]];
        s != t || held[s as usize]
    });
}

/// Segments whose class differs from a label in them, ascending.
fn contradicted(found: &Regularised, labels: &[(u32, u16)]) -> Vec<u32> {
    let Some(partition) = &found.partition else { return Vec::new() };
    let wrong = labels.iter().filter(|&&(point, class)| found.labels[point as usize] != class);
    let mut segments: Vec<u32> = wrong.map(|&(point, _)| partition.segments()[point as usize]).collect();
    segments.sort_unstable();
    segments.dedup();
    segments
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Points;
    use crate::features::optimal_features;
    use crate::random::stream;
    use crate::recipes::Regularise;
    use crate::segmentation::{Intent, PartitionParams};

    /// A floor and a wall that meet, and noisy probabilities: the floor is class 0, the wall 1.
    fn scene() -> (Cloud, Vec<f32>, Vec<u16>) {
        let mut random = stream(3, 1);
        let (mut rows, mut values, mut truth) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..40 {
            for j in 0..40 {
                for wall in [false, true] {
                    let (a, b) = (f64::from(i) * 0.2, f64::from(j) * 0.2 + 0.2);
                    rows.push(if wall { [a, 0.0, b * 0.5] } else { [a, b, 0.0] });
                    let sure = (0.4 + 0.5 * random.uniform()) as f32;
                    values.extend(if wall { [1.0 - sure, sure] } else { [sure, 1.0 - sure] });
                    truth.push(u16::from(wall));
                }
            }
        }
        (Cloud::from_rows(&rows).unwrap(), values, truth)
    }

    #[test]
    fn a_segment_that_is_named_against_a_label_is_cut() {
        let (cloud, values, truth) = scene();
        let points = Points::from_cloud(&cloud, 1.0);
        let monitor = Monitor::default();
        let params = RegulariseParams {
            method: Regularise::SegmentCrf,
            partition: PartitionParams { intent: Intent::Strength(30.0), ..PartitionParams::default() },
            ..RegulariseParams::default()
        };
        let found = optimal_features(&points.positions, &params.neighbourhood, &monitor).unwrap();
        let given = Probabilities { values: &values, classes: 2 };
        let wrong = |labels: &[(u32, u16)]| {
            let described = DescribedPoints { points: &points.positions, descriptors: &found.table, labels: None };
            let known = KnownLabels { labels, step: 0.03 };
            let constrained = Constrained::new(described, known, &params, &monitor).unwrap();
            let found = constrained.decide(given, &params, &monitor).unwrap();
            let wrong = found.labels.iter().zip(&truth).filter(|(a, b)| a != b).count();
            (wrong, found.partition.unwrap().len())
        };
        assert_eq!(wrong(&[]), (1600, 1), "one segment, one name");
        let (with, segments) = wrong(&[(1600, 0), (1601, 1)]);
        assert!(with < 100 && segments > 1, "{with} wrong, {segments} segments");
    }

    #[test]
    fn places_are_found_in_their_own_cloud_only() {
        let (cloud, _, truth) = scene();
        let classes = ClassTable::from_codes(&[2, 6]);
        let examples: Vec<Example> = [5, 900, 17]
            .map(|point| Example { code: if truth[point as usize] == 0 { 2 } else { 6 }, point })
            .into_iter()
            .collect();
        let params = WeakLabels::default();
        let labels = params.remember(&examples, |point| cloud.xyz(point as usize));
        let found = |cloud: &Cloud, metres: f64, params: &WeakLabels| {
            let metric = MetricCloud::new(cloud, Some(metres), &Monitor::default()).unwrap();
            let points = metric.points(&Monitor::default()).unwrap();
            let scene = WeakScene { metric: &metric, points, local: FeatureTable::default() };
            params.found(&labels, &scene, &classes, &Monitor::default()).unwrap()
        };
        for metres in [1.0, 0.3048] {
            assert_eq!(found(&cloud, metres, &params), [(5, 1), (17, 1), (900, 0)]);
        }
        let off = WeakLabels { hold: false, ..params.clone() };
        assert!(found(&cloud, 1.0, &off).is_empty() && off.remember(&examples, |_| [0.0; 3]).is_empty());
        for by in [0.05, 1000.0] {
            let moved: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i).map(|v| v + by)).collect();
            assert!(found(&Cloud::from_rows(&moved).unwrap(), 1.0, &params).is_empty());
        }
    }

    #[test]
    fn no_more_than_the_most_places_of_a_class_travel() {
        let examples: Vec<Example> =
            (0..2600).map(|point| Example { code: if point < 1600 { 2 } else { 6 }, point }).collect();
        let labels = WeakLabels::default().remember(&examples, |point| [f64::from(point), 0.0, 0.0]);
        let count = |code| labels.iter().filter(|label| label.code == code).count();
        assert_eq!((count(2), count(6)), (400, 500));
    }
}
