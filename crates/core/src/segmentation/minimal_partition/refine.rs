//! Moves boundary nodes to the adjacent segment in which they cost least.

use super::Signal;
use super::regions::{Objective, Regions};
use crate::error::Result;
use crate::graph::{Graph, Incidence};
use crate::parallel::{Monitor, watched};
use crate::segmentation::Partition;
use crate::segmentation::connected::connected_partition;
use std::collections::VecDeque;

/// The state of the moves.
struct Moves<'a> {
    signal: &'a Signal<'a>,
    graph: &'a Graph,
    incidence: &'a Incidence<'a>,
    strength: f64,
    segment: Vec<u32>,
    regions: Regions,
    /// Boundary cost between the current node and each adjacent segment.
    around: Vec<(u32, f64)>,
}

/// Largest number of moves of a node, so that rounding errors cannot cause an endless loop.
const MOVES_A_NODE: usize = 20;

/// Moves single nodes between adjacent segments while Q falls (J. A. Hartigan, *Clustering Algorithms*, 1975: the gain
/// takes into account how both means shift). A move never empties a segment. Segments that become disconnected are
/// split. O(moves · degree · (degree + width)).
pub(super) fn move_boundary_nodes(
    objective: Objective<'_>,
    incidence: &Incidence<'_>,
    partition: &Partition,
    monitor: &Monitor,
) -> Result<Partition> {
    let Objective { signal, graph, strength } = objective;
    let segment = partition.segments().to_vec();
    let regions = Regions::of_segments(signal, partition, monitor)?;
    let mut moves = Moves { signal, graph, incidence, strength, segment, regions, around: Vec::new() };
    moves.run(monitor)?;
    let segment = moves.segment;
    connected_partition(graph, |_, [a, b]| segment[a as usize] == segment[b as usize], monitor)
}

impl Moves<'_> {
    /// Visits the nodes at boundaries in order, then again the neighbours of each node that moved.
    fn run(&mut self, monitor: &Monitor) -> Result<()> {
        let mut waiting = vec![false; self.graph.len()];
        for piece in watched(self.graph.edges().len(), monitor) {
            for &[a, b] in &self.graph.edges()[piece?] {
                if self.segment[a as usize] != self.segment[b as usize] {
                    (waiting[a as usize], waiting[b as usize]) = (true, true);
                }
            }
        }
        let mut queue: VecDeque<u32> = (0u32..).zip(&waiting).filter(|(_, w)| **w).map(|(v, _)| v).collect();
        let mut left = self.graph.len().saturating_mul(MOVES_A_NODE);
        let mut steps = 0u32;
        while let Some(node) = queue.pop_front() {
            waiting[node as usize] = false;
            steps = steps.wrapping_add(1);
            if steps.is_multiple_of(4096) {
                monitor.check()?;
            }
            if left == 0 || !self.improve(node) {
                continue;
            }
            left -= 1;
            for (other, _) in self.incidence.of(node as usize) {
                if !std::mem::replace(&mut waiting[other as usize], true) {
                    queue.push_back(other);
                }
            }
        }
        Ok(())
    }

    /// Moves a node to where Q falls most; false if it stays.
    fn improve(&mut self, node: u32) -> bool {
        let here = self.segment[node as usize];
        self.look_around(node);
        let (row, weight) = (self.signal.row(node as usize), self.signal.weight(node as usize));
        let rest = self.regions.weight(here) - weight;
        if rest <= weight * 1e-9 || self.around.iter().all(|(other, _)| *other == here) {
            return false;
        }
        let stay = self.around.iter().find(|(other, _)| *other == here).map_or(0.0, |(_, cost)| *cost);
        let leave = stay - self.regions.weight(here) * weight / rest * self.regions.square_distance(here, row);
        let mut best = (-1e-12 * (stay.abs() + 1.0), None);
        for &(other, cost) in &self.around {
            let size = self.regions.weight(other);
            let join = size * weight / (size + weight) * self.regions.square_distance(other, row) - cost;
            if other != here && leave + join < best.0 {
                best = (leave + join, Some(other));
            }
        }
        let Some(other) = best.1 else { return false };
        self.regions.shift(row, weight, [here, other]);
        self.segment[node as usize] = other;
        true
    }

    fn look_around(&mut self, node: u32) {
        self.around.clear();
        for (other, edge) in self.incidence.of(node as usize) {
            let cost = self.strength * f64::from(self.graph.weights()[edge as usize]);
            let segment = self.segment[other as usize];
            match self.around.iter_mut().find(|(s, _)| *s == segment) {
                Some((_, sum)) => *sum += cost,
                None => self.around.push((segment, cost)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::regions::energy;
    use super::*;
    use crate::random::stream;

    #[test]
    fn moves_lower_the_energy_and_in_the_end_no_single_one_would() {
        for seed in 0..30 {
            let mut random = stream(seed, 0);
            let values: Vec<f32> = (0..80).map(|_| random.uniform() as f32).collect();
            let weights: Vec<f32> = (0..40).map(|_| 0.5 + random.uniform() as f32).collect();
            let signal = Signal::new(&values, 2).unwrap().with_weights(&weights).unwrap();
            let all = (0..40u32).flat_map(|b| (0..b).map(move |a| [a, b]));
            let pairs: Vec<[u32; 2]> = all.filter(|_| random.below(8) == 0).collect();
            let graph = Graph::new(40, &pairs, &vec![1.0; pairs.len()]).unwrap();
            let labels: Vec<u32> = (0..40).map(|_| random.below(4) as u32).collect();
            let of = |labels: &[u32]| {
                connected_partition(&graph, |_, [a, b]| labels[a as usize] == labels[b as usize], &Monitor::default())
                    .unwrap()
            };
            let incidence = graph.incidence(&Monitor::default()).unwrap();
            let objective = Objective { signal: &signal, graph: &graph, strength: 0.05 };
            let (mut last, mut now) = (Partition::default(), of(&labels));
            // A move shifts means and may make other moves profitable: repeat until nothing moves.
            while now != last {
                let moved = move_boundary_nodes(objective, &incidence, &now, &Monitor::default()).unwrap();
                let fell = energy(objective, &now, &Monitor::default()).unwrap()
                    - energy(objective, &moved, &Monitor::default()).unwrap();
                assert!(if moved == now { fell == 0.0 } else { fell > 0.0 });
                (last, now) = (now, moved);
            }
            let least = energy(objective, &now, &Monitor::default()).unwrap();
            for &[a, b] in graph.edges() {
                for (node, to) in [(a, b), (b, a)] {
                    let mut moved = now.segments().to_vec();
                    let alone = moved.iter().filter(|s| **s == moved[node as usize]).count() == 1;
                    moved[node as usize] = moved[to as usize];
                    let there =
                        energy(objective, &Partition::from_labels(&moved).unwrap(), &Monitor::default()).unwrap();
                    assert!(alone || there >= least - 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_segment_keeps_its_last_node() {
        let signal = Signal::new(&[0.0, 0.1, 0.1], 1).unwrap();
        let graph = Graph::new(3, &[[0, 1], [1, 2]], &[1.0; 2]).unwrap();
        let partition = Partition::from_labels(&[0, 1, 2]).unwrap();
        let moved = move_boundary_nodes(
            Objective { signal: &signal, graph: &graph, strength: 10.0 },
            &graph.incidence(&Monitor::default()).unwrap(),
            &partition,
            &Monitor::default(),
        );
        assert_eq!(moved.unwrap(), partition);
    }
}
