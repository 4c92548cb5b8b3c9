//! Regularisation: from class probabilities of single points to labels that are consistent among neighbours. Works with
//! any trained model.
//!
//! S. Guinard, L. Landrieu, *Weakly supervised segmentation-aided classification of urban scenes from 3D LiDAR point
//! clouds*, ISPRS Archives XLII-1/W1, 2017, doi:10.5194/isprs-archives-XLII-1-W1-151-2017, sections 3 and 4.
//! `docs/weak.md` has the equations.

mod choice;
mod field;
mod given;
mod on_segments;
mod params;
mod support;

pub use choice::ChoiceParams;
pub use given::{ClassDimension, RegularisedCloud, regularise_cloud};
pub(super) use on_segments::{Again, Segments};
pub(super) use params::automatic;
pub use params::{Posterior, Regularise, RegulariseParams};
pub(super) use support::{DescribedPoints, Support, adjacency, partition, point_graph};

use crate::classification::argmax;
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::segmentation::Partition;
use std::sync::Arc;

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
    /// Row-major, one value a class: the probabilities that the decision is based on. One row a segment if there are
    /// segments, else one row a point (its own, or the mean of its neighbourhood).
    pub rows: Vec<f32>,
    /// The segments, if the method uses any.
    pub partition: Option<Arc<Partition>>,
    /// Energy of the labels, if the method minimises one.
    pub energy: Option<f64>,
}

impl Regularised {
    /// The most probable class of every row; the first of equal ones. Rows are of segments, or of points.
    pub(super) fn by_largest(rows: Vec<f32>, classes: usize, partition: Option<Arc<Partition>>) -> Self {
        let best = rows.chunks_exact(classes).map(|row| argmax(row) as u16);
        let labels = match &partition {
            Some(partition) => spread(partition, &best.collect::<Vec<_>>()),
            None => best.collect(),
        };
        Self { labels, rows, partition, energy: None }
    }

    /// The probabilities, `classes` values, that the decision about a point is based on.
    pub fn row(&self, point: usize, classes: usize) -> &[f32] {
        let row = self.partition.as_ref().map_or(point, |partition| partition.segments()[point] as usize);
        &self.rows[row * classes..][..classes]
    }
}

/// The label of each node's segment.
fn spread(partition: &Partition, labels: &[u16]) -> Vec<u16> {
    partition.segments().iter().map(|&s| labels[s as usize]).collect()
}

/// Regularised labels from class probabilities of points.
///
/// The result is the same bytes for any number of threads.
///
/// # Errors
/// If a parameter is out of range, there is not one row of probabilities a point, or the work was cancelled.
pub fn regularise(
    points: &Positions,
    given: Probabilities<'_>,
    params: &RegulariseParams,
    monitor: &Monitor,
) -> Result<Regularised> {
    Support::new(points, None, params, monitor)?.decide(given, params, monitor)
}

#[cfg(test)]
mod tests {
    use super::support::smoothed;
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;
    use crate::segmentation::{Intent, PartitionParams};

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
        (regularise(&points, given, params, &Monitor::default()).unwrap(), truth)
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
        for row in found.rows.chunks_exact(3) {
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
        let found = regularise(&points, given, &params, &Monitor::default()).unwrap();
        let smooth = smoothed(given, params.smoothing);
        let graph = point_graph(&points, 10, &params.adjacency, &Monitor::default()).unwrap();
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
            regularise(&points, given, &params, &Monitor::default()).unwrap_err().to_string()
        };
        let params = || RegulariseParams { method: Regularise::PointCrf, ..RegulariseParams::default() };
        assert!(refused(given, RegulariseParams { strength: -1.0, ..params() }).contains("strength"));
        assert!(refused(given, RegulariseParams { starts: 3, ..params() }).contains("starts"));
        assert!(refused(given, RegulariseParams { smoothing: 0.0, ..params() }).contains("smoothing"));
        assert!(refused(given, RegulariseParams { neighbours: 0, ..params() }).contains("neighbours"));
        assert!(refused(Probabilities { values: &values[3..], classes: 3 }, params()).contains("probabilities"));
    }
}
