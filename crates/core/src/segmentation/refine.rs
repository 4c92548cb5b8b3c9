//! Boundary nodes move to the segment in which they cost least.

use super::Partition;
use super::Signal;
use super::regions::Regions;
use crate::error::Result;
use crate::graph::{Adjacency, Graph};
use crate::parallel::Monitor;
use std::collections::VecDeque;

/// The state of the moves.
struct Moves<'a> {
    signal: &'a Signal<'a>,
    graph: &'a Graph,
    adjacency: &'a Adjacency,
    strength: f64,
    segment: Vec<u32>,
    regions: Regions,
    /// Boundary cost from the node at hand to each segment around it.
    around: Vec<(u32, f64)>,
}

/// Moves single nodes between segments that touch while Q falls (J. A. Hartigan, *Clustering Algorithms*, 1975: the
/// gain counts how both means shift). A move never empties a segment. Segments that fall apart are parted.
/// O(moves · degree · width).
pub(super) fn move_boundary_nodes(
    signal: &Signal,
    (graph, adjacency): (&Graph, &Adjacency),
    (partition, strength): (&Partition, f64),
    monitor: &Monitor,
) -> Result<Partition> {
    let segment = partition.segments().to_vec();
    let regions = Regions::of_segments(signal, partition);
    let mut moves = Moves { signal, graph, adjacency, strength, segment, regions, around: Vec::new() };
    let mut waiting = vec![false; graph.len()];
    for &[a, b] in graph.edges() {
        if moves.segment[a as usize] != moves.segment[b as usize] {
            (waiting[a as usize], waiting[b as usize]) = (true, true);
        }
    }
    let mut queue: VecDeque<u32> = (0u32..).zip(&waiting).filter(|(_, w)| **w).map(|(v, _)| v).collect();
    let mut steps = 0u32;
    // Every move lowers Q; the bound is for rounding errors that would let two nodes change places for ever.
    let most = graph.len().saturating_mul(20);
    let mut moved = 0usize;
    while let Some(node) = queue.pop_front() {
        waiting[node as usize] = false;
        steps = steps.wrapping_add(1);
        if steps.is_multiple_of(4096) {
            monitor.check()?;
        }
        if moved < most && moves.improve(node) {
            moved += 1;
            for (other, _) in adjacency.of(node as usize) {
                if !waiting[other as usize] {
                    waiting[other as usize] = true;
                    queue.push_back(other);
                }
            }
        }
    }
    let segment = moves.segment;
    super::connected_partition(graph, |_, [a, b]| segment[a as usize] == segment[b as usize])
}

impl Moves<'_> {
    /// Moves a node where Q falls most; false if it stays.
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
        for (other, edge) in self.adjacency.of(node as usize) {
            let cost = self.strength * f64::from(self.graph.weights()[edge as usize]);
            let segment = self.segment[other as usize];
            match self.around.iter_mut().find(|(s, _)| *s == segment) {
                Some((_, sum)) => *sum += cost,
                None => self.around.push((segment, cost)),
            }
        }
    }
}
