//! Chooses the strength for a wanted number of segments, size of objects or accuracy.

mod params;
mod search;

pub use params::{Intent, Method, PartitionParams};
pub use search::{Aim, Candidate, StrengthSearch, Trial, search_strength};

use super::Signal;
use super::cut_pursuit::{CutPursuitParams, cut_pursuit};
use super::merge::{MergeParams, merge};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::{Partition, oracle_accuracy};
use crate::voxels::covered_area;

/// Square metres of a hectare.
const HECTARE: f64 = 10_000.0;
/// A number of segments within this factor of the wanted one is accepted.
const CLOSE: f64 = 1.05;
/// Share of the nodes that may lie in segments that are too small.
const SMALL_SHARE: f64 = 0.05;

/// The data to be partitioned.
#[derive(Clone, Copy, Debug)]
pub struct PartitionInput<'a> {
    /// The values that should be nearly constant within a segment.
    pub signal: Signal<'a>,
    /// Which nodes are adjacent.
    pub graph: &'a Graph,
    /// Position of each node, for intents in metres and hectares.
    pub points: Option<&'a Positions>,
    /// Label of each node where it is known, for the oracle accuracy.
    pub labels: Option<&'a [Option<u8>]>,
}

/// The partition that fulfils an intent, with a table of all trials.
///
/// Costs one partition a trial, at most [`PartitionParams::trials`] of them.
///
/// # Errors
/// If a parameter is out of range, the intent needs positions or labels that are missing, lengths differ, or the work
/// was cancelled.
pub fn partition_by_intent(
    input: &PartitionInput,
    params: &PartitionParams,
    monitor: &Monitor,
) -> Result<StrengthSearch> {
    params.validate()?;
    let nodes = input.graph.len();
    for (found, what) in [(input.points.map(Positions::len), "points"), (input.labels.map(<[_]>::len), "labels")] {
        if let Some(found) = found.filter(|found| *found != nodes) {
            return Err(Error::input(format!("{found} {what} for a graph of {nodes} nodes")));
        }
    }
    let aim = aim(input, params, monitor)?;
    let first = match aim {
        Aim::Strength(strength) => strength,
        _ => typical_strength(input),
    };
    search_strength(&aim, params.trials, first, |strength| {
        let (partition, energy) = solve(input, params, strength, monitor)?;
        let oracle_accuracy = match input.labels {
            Some(labels) => oracle_accuracy(&partition, labels)?,
            None => None,
        };
        let small_share = small_share(input, params.intent, &partition);
        Ok(Candidate { partition, energy, small_share, oracle_accuracy })
    })
}

fn solve(
    input: &PartitionInput,
    params: &PartitionParams,
    strength: f64,
    monitor: &Monitor,
) -> Result<(Partition, f64)> {
    let PartitionParams { cutoff, seed, .. } = *params;
    match params.method {
        Method::CutPursuit => {
            let params = CutPursuitParams { strength, cutoff, seed, steps: params.cut_pursuit.clone() };
            cut_pursuit(&input.signal, input.graph, &params, monitor).map(|found| (found.partition, found.energy))
        }
        Method::Merge => merge(&input.signal, input.graph, &MergeParams { strength, cutoff }, monitor)
            .map(|found| (found.partition, found.energy)),
    }
}

fn aim(input: &PartitionInput, params: &PartitionParams, monitor: &Monitor) -> Result<Aim> {
    let need = |there: bool, what: &str| {
        if there { Ok(()) } else { Err(Error::input(format!("intent {} needs {what}", params.intent))) }
    };
    match params.intent {
        Intent::Strength(strength) => Ok(Aim::Strength(strength)),
        Intent::SegmentsPerHectare(wanted) => {
            need(input.points.is_some(), "the positions of the nodes")?;
            let area = input.points.map_or(Ok(0.0), |points| covered_area(points, monitor))?;
            Ok(Aim::Segments { count: wanted * (area / HECTARE), close: CLOSE })
        }
        Intent::SmallestObject(_) => {
            need(input.points.is_some(), "the positions of the nodes")?;
            Ok(Aim::SmallShare(SMALL_SHARE))
        }
        Intent::SmallestObjectPoints(_) => Ok(Aim::SmallShare(SMALL_SHARE)),
        Intent::OracleAccuracy(loss) => {
            let any = input.labels.is_some_and(|labels| labels.iter().any(Option::is_some));
            need(any, "at least one label")?;
            Ok(Aim::OracleLoss(loss))
        }
    }
}

/// Share of the weight that lies in segments smaller than the smallest object of the intent; `None` for other intents.
fn small_share(input: &PartitionInput, intent: Intent, partition: &Partition) -> Option<f64> {
    let weight = |members: &[u32]| members.iter().map(|&node| input.signal.weight(node as usize)).sum::<f64>();
    let is_small = |members: &[u32]| match (intent, input.points) {
        (Intent::SmallestObject(metres), Some(points)) => Some(longest_side(points, members) < metres),
        (Intent::SmallestObjectPoints(count), _) => Some(weight(members) < count),
        _ => None,
    };
    let (mut small, mut all) = (0.0, 0.0);
    for members in partition.iter() {
        let own = weight(members);
        all += own;
        small += if is_small(members)? { own } else { 0.0 };
    }
    Some(if all > 0.0 { small / all } else { 0.0 })
}

/// Longest side of the box around some points, in metres.
fn longest_side(points: &Positions, members: &[u32]) -> f64 {
    let side = |axis: &[f32]| {
        let values = members.iter().map(|&i| axis[i as usize]);
        let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        f64::from(high) - f64::from(low)
    };
    side(&points.x).max(side(&points.y)).max(side(&points.z))
}

/// The first strength of the search: the mean over the edges of the squared difference of their ends.
fn typical_strength(input: &PartitionInput) -> f64 {
    let square = |[a, b]: [u32; 2]| -> f64 {
        let rows = input.signal.row(a as usize).iter().zip(input.signal.row(b as usize));
        rows.map(|(p, q)| (f64::from(*p) - f64::from(*q)).powi(2)).sum()
    };
    let mean = input.graph.edges().iter().map(|&e| square(e)).sum::<f64>() / input.graph.edges().len().max(1) as f64;
    if mean > 0.0 { mean } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// Squares of side `field` metres with different values, one point a metre, 48 x 48 m.
    fn fields(field: u32) -> (Positions, Vec<f32>, Graph, Vec<Option<u8>>) {
        let number = |v: u32| v % 48 / field + v / 48 / field * (48 / field);
        let mut random = stream(1, 0);
        let mean = |v: u32| (number(v) * 7 % 16) as f32 / 16.0;
        let values = (0..48 * 48).map(|v| mean(v) + 0.02 * random.uniform() as f32).collect();
        let across = (0..48 * 48u32).filter(|v| v % 48 < 47).map(|v| [v, v + 1]);
        let pairs: Vec<[u32; 2]> = across.chain((0..48 * 47).map(|v| [v, v + 48])).collect();
        let axis = |of: &dyn Fn(u32) -> u32| (0..48 * 48).map(|v| of(v) as f32).collect();
        let points = Positions { x: axis(&|v| v % 48), y: axis(&|v| v / 48), z: axis(&|_| 0) };
        let labels = (0..48 * 48).map(|v| (v % 7 == 0).then_some((number(v) % 5) as u8)).collect();
        (points, values, Graph::new(48 * 48, &pairs, &vec![1.0; pairs.len()]).unwrap(), labels)
    }

    fn search(intent: Intent, method: Method) -> StrengthSearch {
        let (points, values, graph, labels) = fields(12);
        let signal = Signal::new(&values, 1).unwrap();
        let input = PartitionInput { signal, graph: &graph, points: Some(&points), labels: Some(&labels) };
        let params = PartitionParams { intent, method, ..PartitionParams::default() };
        partition_by_intent(&input, &params, &Monitor::default()).unwrap()
    }

    #[test]
    fn the_wanted_number_of_segments_is_met() {
        for method in [Method::CutPursuit, Method::Merge] {
            // 48 x 48 m are 0.2304 hectares.
            let found = search(Intent::SegmentsPerHectare(16.0 / 0.2304), method);
            assert_eq!(found.partition.len(), 16, "{:?}", found.trials);
            assert!(found.trials.windows(2).all(|w| w[0].strength < w[1].strength));
            assert!(found.trials.iter().any(|t| t.strength == found.strength && t.oracle_accuracy == Some(1.0)));
        }
    }

    #[test]
    fn segments_are_no_smaller_than_the_smallest_object() {
        for intent in [Intent::SmallestObject(10.0), Intent::SmallestObjectPoints(100.0)] {
            let found = search(intent, Method::Merge);
            let chosen = found.trials.iter().find(|t| t.strength == found.strength).unwrap();
            assert!(chosen.small_share.unwrap() <= SMALL_SHARE, "{chosen:?}");
            let finer = found.trials.iter().filter(|t| t.strength < found.strength);
            assert!(finer.clone().count() > 1 && finer.clone().all(|t| t.small_share.unwrap() > SMALL_SHARE));
        }
        let found = search(Intent::SmallestObject(20.0), Method::Merge);
        let sides = found.partition.iter().map(|members| longest_side(&fields(12).0, members));
        assert!(sides.filter(|side| *side < 20.0).count() <= 1);
    }

    #[test]
    fn few_labels_choose_the_coarsest_partition_that_keeps_them_apart() {
        let found = search(Intent::OracleAccuracy(0.0), Method::CutPursuit);
        let chosen = found.trials.iter().find(|t| t.strength == found.strength).unwrap();
        assert_eq!(chosen.oracle_accuracy, Some(1.0));
        assert!((10..=16).contains(&chosen.segments), "{:?}", found.trials);
        assert!(found.trials.len() <= PartitionParams::default().trials);
    }

    #[test]
    fn a_given_strength_is_tried_once() {
        let found = search(Intent::Strength(0.3), Method::CutPursuit);
        assert_eq!((found.strength, found.trials.len()), (0.3, 1));
        assert_eq!(found.trials[0].segments, found.partition.len());
    }

    #[test]
    fn what_an_intent_needs_must_be_there() {
        let (points, values, graph, _) = fields(12);
        let signal = Signal::new(&values, 1).unwrap();
        let bare = PartitionInput { signal, graph: &graph, points: None, labels: None };
        let run = |input: &PartitionInput, intent| {
            let params = PartitionParams { intent, ..PartitionParams::default() };
            partition_by_intent(input, &params, &Monitor::default()).unwrap_err().to_string()
        };
        assert!(run(&bare, Intent::SegmentsPerHectare(3.0)).contains("segments-per-hectare = 3 needs the positions"));
        assert!(run(&bare, Intent::SmallestObject(3.0)).contains("needs the positions"));
        assert!(run(&bare, Intent::OracleAccuracy(0.1)).contains("at least one label"));
        assert!(run(&bare, Intent::OracleAccuracy(1.0)).contains("below 1"));
        assert!(run(&bare, Intent::SmallestObject(0.0)).contains("above 0"));
        let few = [Some(1)];
        assert!(run(&PartitionInput { labels: Some(&few), ..bare }, Intent::default()).contains("1 labels"));
        let mut fewer = points.clone();
        fewer.x.pop();
        assert!(run(&PartitionInput { points: Some(&fewer), ..bare }, Intent::default()).contains("2303 points"));
    }

    #[test]
    fn all_equal_values_end_the_search() {
        let (points, _, graph, labels) = fields(12);
        let values = vec![0.5; 48 * 48];
        let signal = Signal::new(&values, 1).unwrap();
        let input = PartitionInput { signal, graph: &graph, points: Some(&points), labels: Some(&labels) };
        for intent in [Intent::SegmentsPerHectare(100.0), Intent::SmallestObject(1.0), Intent::OracleAccuracy(0.1)] {
            let params = PartitionParams { intent, ..PartitionParams::default() };
            let found = partition_by_intent(&input, &params, &Monitor::default()).unwrap();
            assert_eq!(found.partition.len(), 1);
        }
    }

    #[test]
    fn parameters_read_like_a_recipe() {
        let text = r#"{"method":"merge","intent":{"smallest-object":0.5},"cutoff":10.0}"#;
        let params: PartitionParams = serde_json::from_str(text).unwrap();
        assert_eq!((params.method, params.intent), (Method::Merge, Intent::SmallestObject(0.5)));
        assert!(serde_json::from_str::<PartitionParams>(r#"{"metod":"merge"}"#).is_err());
    }
}
