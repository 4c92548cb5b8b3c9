//! Partitions some segments of a partition again, more finely.

use super::by_intent::{PartitionInput, PartitionParams, partition_by_intent};
use super::signal::Signal;
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::Partition;

/// Some segments of a partition.
#[derive(Clone, Copy, Debug)]
pub struct ChosenSegments<'a> {
    /// The partition.
    pub partition: &'a Partition,
    /// Numbers of the chosen segments.
    pub chosen: &'a [u32],
}

/// Partitions each of the `segments` again with `params`; the others stay as they are.
///
/// Only edges within the chosen segments are used, so that no segment grows beyond its former extent. Positions and
/// labels of the input are not used: the intent must be a strength. Costs as much as partitioning the chosen segments
/// alone, and O(n + m).
///
/// # Errors
/// If the partition is not one of the input's nodes, `chosen` names a segment that does not exist, a parameter is out of range,
/// or the work was cancelled.
pub fn recut(
    input: &PartitionInput<'_>,
    segments: ChosenSegments<'_>,
    params: &PartitionParams,
    monitor: &Monitor,
) -> Result<Partition> {
    let ChosenSegments { partition, chosen } = segments;
    if partition.nodes() != input.graph.len() {
        return Err(Error::input(format!(
            "a partition of {} nodes for a graph of {}",
            partition.nodes(),
            input.graph.len()
        )));
    }
    let mut is_chosen = vec![false; partition.len()];
    for &segment in chosen {
        match is_chosen.get_mut(segment as usize) {
            Some(slot) => *slot = true,
            None => {
                return Err(Error::input(format!("segment {segment} of a partition of {} segments", partition.len())));
            }
        }
    }
    let piece = SegmentsGraph::new(input, partition, &is_chosen, monitor)?;
    let found = piece.cut(input.signal.width(), params, monitor)?;
    let mut labels = partition.segments().to_vec();
    let first = partition.len() as u32;
    piece.nodes.iter().zip(found.segments()).for_each(|(&node, &part)| labels[node as usize] = first + part);
    Partition::from_labels_watched(&labels, monitor)
}

/// The chosen segments as a graph of their own.
struct SegmentsGraph {
    /// Their nodes, ascending.
    nodes: Vec<u32>,
    values: Vec<f32>,
    weights: Vec<f32>,
    graph: Graph,
}

impl SegmentsGraph {
    fn new(input: &PartitionInput<'_>, partition: &Partition, is_chosen: &[bool], monitor: &Monitor) -> Result<Self> {
        let of = partition.segments();
        let nodes: Vec<u32> = (0..).zip(of).filter(|(_, s)| is_chosen[**s as usize]).map(|(node, _)| node).collect();
        // Both ends of an edge within one segment are chosen, or neither is.
        let graph = input.graph.induced(&nodes, |[a, b]| of[a as usize] == of[b as usize], monitor)?;
        Ok(Self {
            graph,
            values: nodes.iter().flat_map(|&node| input.signal.row(node as usize)).copied().collect(),
            weights: nodes.iter().map(|&node| input.signal.weight(node as usize) as f32).collect(),
            nodes,
        })
    }

    fn cut(&self, width: usize, params: &PartitionParams, monitor: &Monitor) -> Result<Partition> {
        let signal = Signal::new(&self.values, width)?.with_weights(&self.weights)?;
        let input = PartitionInput { signal, graph: &self.graph, points: None, labels: None };
        Ok(partition_by_intent(&input, params, monitor)?.partition)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::segmentation::Intent;

    /// A strip of 60 x 8 nodes: values near 0, 0.3, 0.6, 0.9 by quarters, with noise.
    fn strip() -> (Vec<f32>, Graph) {
        let mut random = stream(5, 0);
        let at = |x: u32, y: u32| x * 8 + y;
        let values = (0..480u32).map(|v| (v / 8 / 15) as f32 * 0.3 + 0.02 * random.uniform() as f32).collect();
        let along = (0..59).flat_map(|x| (0..8).map(move |y| [at(x, y), at(x + 1, y)]));
        let across = (0..60).flat_map(|x| (0..7).map(move |y| [at(x, y), at(x, y + 1)]));
        let pairs: Vec<[u32; 2]> = along.chain(across).collect();
        let weights = vec![1.0; pairs.len()];
        (values, Graph::new(480, &pairs, &weights).unwrap())
    }

    fn at(strength: f64) -> PartitionParams {
        PartitionParams { intent: Intent::Strength(strength), ..PartitionParams::default() }
    }

    #[test]
    fn all_segments_of_one_are_the_partition_itself() {
        let (values, graph) = strip();
        let input =
            PartitionInput { signal: Signal::new(&values, 1).unwrap(), graph: &graph, points: None, labels: None };
        let one = Partition::from_labels(&[0; 480]).unwrap();
        let monitor = Monitor::default();
        let expected = partition_by_intent(&input, &at(0.05), &monitor).unwrap().partition;
        assert_eq!(expected.len(), 4);
        assert_eq!(
            recut(&input, ChosenSegments { partition: &one, chosen: &[0] }, &at(0.05), &monitor).unwrap(),
            expected
        );
    }

    #[test]
    fn only_chosen_segments_are_cut_and_none_grows() {
        let (values, graph) = strip();
        let input =
            PartitionInput { signal: Signal::new(&values, 1).unwrap(), graph: &graph, points: None, labels: None };
        let halves: Vec<u32> = (0..480).map(|v| v / 240).collect();
        let halves = Partition::from_labels(&halves).unwrap();
        let found =
            recut(&input, ChosenSegments { partition: &halves, chosen: &[1] }, &at(0.05), &Monitor::default()).unwrap();
        let expected: Vec<u32> = (0..480u32).map(|v| (v / 120).saturating_sub(1)).collect();
        assert_eq!(found.segments(), expected);
        let same =
            recut(&input, ChosenSegments { partition: &halves, chosen: &[] }, &at(0.05), &Monitor::default()).unwrap();
        assert_eq!(same, halves);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let (values, graph) = strip();
        let input =
            PartitionInput { signal: Signal::new(&values, 1).unwrap(), graph: &graph, points: None, labels: None };
        let few = Partition::from_labels(&[0; 479]).unwrap();
        let one = Partition::from_labels(&[0; 480]).unwrap();
        let refused = |partition, chosen: &[u32]| {
            recut(&input, ChosenSegments { partition, chosen }, &at(0.1), &Monitor::default()).unwrap_err().to_string()
        };
        assert!(refused(&few, &[0]).contains("479 nodes for a graph of 480"));
        assert!(refused(&one, &[1]).contains("segment 1 of a partition of 1"));
    }
}
