//! A segment copied out of the cloud: its values and inner edges lie together in memory, its nodes are numbered from 0.

use super::super::regions::Objective;
use crate::error::Result;
use crate::graph::{Incidence, UnionFind};
use crate::parallel::{Looks, Monitor, watched};
use crate::segmentation::Partition;

/// Buffers of a segment, reused from segment to segment.
#[derive(Default)]
pub(super) struct Piece {
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
    pub(super) weights: Vec<f64>,
    /// Inner edges, ascending, and what cutting them costs.
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) costs: Vec<f64>,
}

/// The problem that segments are copied from.
pub(super) struct WholeProblem<'a> {
    pub(super) objective: Objective<'a>,
    pub(super) incidence: Incidence<'a>,
}

/// The segments, and the position of each node among the members of its segment.
pub(super) struct Segments<'a> {
    pub(super) partition: &'a Partition,
    pub(super) position: &'a [u32],
}

impl Piece {
    /// Fills the buffers with one of the segments.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn gather(
        &mut self,
        source: &WholeProblem,
        segments: &Segments<'_>,
        segment: usize,
        monitor: &Monitor,
    ) -> Result<()> {
        let Objective { signal, graph, strength } = source.objective;
        let Segments { partition, position } = *segments;
        let mut looks = Looks::at(monitor);
        let Self { width, values, weights, edges, costs } = self;
        *width = signal.width();
        values.clear();
        weights.clear();
        edges.clear();
        costs.clear();
        for (here, &node) in (0u32..).zip(partition.members(segment)) {
            looks.step()?;
            values.extend_from_slice(signal.row(node as usize));
            weights.push(signal.weight(node as usize));
            for (other, edge) in source.incidence.larger(node as usize) {
                if partition.segments()[other as usize] as usize == segment {
                    edges.push([here, position[other as usize]]);
                    costs.push(strength * f64::from(graph.weights()[edge as usize]));
                }
            }
        }
        Ok(())
    }

    pub(super) fn len(&self) -> usize {
        self.weights.len()
    }

    /// Rows with their weights.
    pub(super) fn rows(&self) -> impl Iterator<Item = (&[f32], f64)> {
        self.values.chunks_exact(self.width).zip(self.weights.iter().copied())
    }

    /// The connected part of equal side that each node is in, given as the smallest node of the part.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn parts(&self, sides: &[bool], monitor: &Monitor) -> Result<Vec<u32>> {
        let mut sets = UnionFind::new(self.len());
        for piece in watched(self.edges.len(), monitor) {
            for &[a, b] in &self.edges[piece?] {
                if sides[a as usize] == sides[b as usize] {
                    sets.unite(a, b);
                }
            }
        }
        sets.roots(monitor)
    }

    /// Q of this segment alone for a labelling of its nodes (any labels below the number of nodes).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn energy(&self, labels: &[u32], monitor: &Monitor) -> Result<f64> {
        let mut looks = Looks::at(monitor);
        let mut weights = vec![0.0; self.len()];
        let mut sums = vec![0.0; self.len() * self.width];
        let mut squares = 0.0;
        for ((row, weight), &label) in self.rows().zip(labels) {
            looks.step()?;
            weights[label as usize] += weight;
            let sum = &mut sums[label as usize * self.width..][..self.width];
            for (s, &f) in sum.iter_mut().zip(row) {
                *s += weight * f64::from(f);
                squares += weight * f64::from(f).powi(2);
            }
        }
        let means = sums.chunks_exact(self.width).zip(&weights).filter(|(_, w)| **w > 0.0);
        let explained: f64 = means.map(|(sum, weight)| sum.iter().map(|s| s * s).sum::<f64>() / weight).sum();
        let mut boundary = 0.0;
        for (&[a, b], cost) in self.edges.iter().zip(&self.costs) {
            looks.step()?;
            if labels[a as usize] != labels[b as usize] {
                boundary += cost;
            }
        }
        Ok(squares - explained + boundary)
    }
}
