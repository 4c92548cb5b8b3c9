//! Labels as hard constraints: a segment classified differently from a label in it is segmented more finely.

use super::examples::{Example, WeakLabels};
use super::learned::LabelledPosition;
use crate::classes::ClassTable;
use crate::cloud::{Cloud, Points};
use crate::error::Result;
use crate::features::FeatureTable;
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::regularise::{Probabilities, RegulariseParams, Regularised, Scene};
use crate::recipes::segments::Again;

/// The labels of a cloud that is classified, and what is needed to segment again.
pub(super) struct Known {
    /// The descriptors that segments are based on.
    pub(super) descriptors: FeatureTable,
    /// The labelled points with the position of their class.
    pub(super) labels: Vec<(u32, u16)>,
    /// Share of the strength with which contradicted segments are segmented again.
    pub(super) step: f64,
}

/// A cloud in which labelled positions are searched.
pub(super) struct LabelScene<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: &'a Points,
    /// Metres per unit of its coordinates.
    pub(super) metres: f64,
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
        scene: &LabelScene<'_>,
        classes: &ClassTable,
        monitor: &Monitor,
    ) -> Result<Vec<(u32, u16)>> {
        if !self.hold || labels.is_empty() {
            return Ok(Vec::new());
        }
        let Some([low, high]) = scene.cloud.bounds_watched(monitor)? else { return Ok(Vec::new()) };
        let rim = self.hold_within / scene.metres;
        let inside = |at: &[f64; 3]| (0..3).all(|a| (low[a] - rim..=high[a] + rim).contains(&at[a]));
        let labels: Vec<&LabelledPosition> = labels.iter().filter(|label| inside(&label.at)).collect();
        if labels.is_empty() {
            return Ok(Vec::new());
        }
        let rows: Vec<[f64; 3]> = labels.iter().map(|label| label.at).collect();
        let places = Points::with_strays(&Cloud::from_rows(&rows)?, scene.metres, monitor)?;
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

/// Probabilities, and how labels follow from them.
#[derive(Clone, Copy)]
pub(super) struct Question<'a> {
    pub(super) given: Probabilities<'a>,
    pub(super) params: &'a RegulariseParams,
}

/// The labels for these probabilities. Segments that contradict a label in them are segmented more finely, and
/// everything is classified again.
///
/// # Errors
/// As [`Scene::decide`].
pub(super) fn decide(
    mut scene: Scene,
    question: &Question<'_>,
    known: &Known,
    monitor: &Monitor,
) -> Result<Regularised> {
    let Question { given, params } = *question;
    let found = scene.decide(given, params, monitor)?;
    let against = named_against(&found, &known.labels);
    if against.is_empty() {
        return Ok(found);
    }
    // All segments are classified again; this result holds memory that is needed for them.
    drop(found);
    let again = Again { segments: &against, step: known.step };
    scene.recut(&known.descriptors, &again, params, monitor)?;
    scene.decide(given, params, monitor)
}

/// Segments whose class differs from a label in them, ascending.
fn named_against(found: &Regularised, labels: &[(u32, u16)]) -> Vec<u32> {
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
            let scene = Scene::to_be_recut(&points.positions, Some(&found.table), &params, &monitor).unwrap();
            let known = Known { descriptors: found.table.clone(), labels: labels.to_vec(), step: 0.03 };
            let question = Question { given, params: &params };
            let found = decide(scene, &question, &known, &monitor).unwrap();
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
            let points = Points::from_cloud(cloud, metres);
            let scene = LabelScene { cloud, points: &points, metres };
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
