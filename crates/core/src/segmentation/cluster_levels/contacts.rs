//! Which segments touch, and by how many pairs of points.

use super::first::NONE;
use crate::error::Result;
use crate::graph::Graph;
use crate::neighbours::stacks::{Ball, Stacks};
use crate::parallel::{Monitor, map_ordered_with};

/// Points that one task examines.
const BLOCK: usize = 4096;

/// The graph of segments: an edge between two segments (label − 1) with at least one pair of points within the radius of
/// each other; its weight is the number of such pairs. O(m) for m neighbours of all points.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn contacts(stacks: &Stacks, labels: &[u32], radius: f64, monitor: &Monitor) -> Result<Graph> {
    let count = labels.iter().copied().max().unwrap_or(0) as usize;
    monitor.stage("contacts", labels.len() as u64);
    let parts = map_ordered_with(0..labels.len().div_ceil(BLOCK), monitor, Vec::new, |runs, block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(labels.len());
        monitor.advance(range.len() as u64);
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for i in range.filter(|&i| labels[i] != NONE) {
            let ball = Ball { at: stacks.positions.xyz(i), radius };
            stacks.around(ball, runs, |j| {
                let (a, b) = (labels[i], labels[j as usize]);
                if j as usize > i && b != NONE && a != b {
                    pairs.push([a.min(b) - 1, a.max(b) - 1]);
                }
            });
        }
        pairs.sort_unstable();
        let counted = pairs.chunk_by(|a, b| a == b).map(|group| (group[0], group.len() as f32));
        Ok(counted.collect::<Vec<_>>())
    })?;
    let (pairs, weights): (Vec<[u32; 2]>, Vec<f32>) = parts.into_iter().flatten().unzip();
    Graph::new_watched(count, &pairs, &weights, monitor)
}

/// The graph of groups of nodes: weights of edges between the same two groups are summed, those inside a group left out.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn grouped(graph: &Graph, group: &[u32], groups: usize, monitor: &Monitor) -> Result<Graph> {
    let ends = |&[a, b]: &[u32; 2]| [group[a as usize], group[b as usize]];
    let edges = graph.edges().iter().map(ends).zip(graph.weights().iter().copied());
    let (pairs, weights): (Vec<[u32; 2]>, Vec<f32>) = edges.filter(|([a, b], _)| a != b).unzip();
    Graph::new_watched(groups, &pairs, &weights, monitor)
}
