//! Connected components of a graph some of whose edges are ignored.

use super::Partition;
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::{Monitor, watched};

/// Disjoint sets (union-find) in which the root is always the smallest member.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub(super) fn new(len: usize) -> Self {
        Self((0..len as u32).collect())
    }

    /// Smallest member of the set of `node`; halves the path on its way.
    pub(super) fn root(&mut self, mut node: u32) -> u32 {
        loop {
            let parent = self.0[node as usize];
            if parent == node {
                return node;
            }
            let grand = self.0[parent as usize];
            self.0[node as usize] = grand;
            node = grand;
        }
    }

    /// Merges two sets; returns the roots as (kept, absorbed), or nothing if they are one set already.
    pub(super) fn unite(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return None;
        }
        let (kept, gone) = (a.min(b), a.max(b));
        self.0[gone as usize] = kept;
        Some((kept, gone))
    }

    /// Root of every member.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn roots(&mut self, monitor: &Monitor) -> Result<Vec<u32>> {
        let mut roots = Vec::with_capacity(self.0.len());
        for piece in watched(self.0.len(), monitor) {
            roots.extend(piece?.map(|node| self.root(node as u32)));
        }
        Ok(roots)
    }
}

/// The connected components of the graph that has only the edges for which `kept(edge index, ends)` is true, as
/// segments. O(n + m).
///
/// # Errors
/// If the work was cancelled.
pub fn connected_partition(
    graph: &Graph,
    mut kept: impl FnMut(usize, [u32; 2]) -> bool,
    monitor: &Monitor,
) -> Result<Partition> {
    let mut sets = Sets::new(graph.len());
    for piece in watched(graph.edges().len(), monitor) {
        for e in piece? {
            let [a, b] = graph.edges()[e];
            if kept(e, [a, b]) {
                sets.unite(a, b);
            }
        }
    }
    Partition::from_labels_watched(&sets.roots(monitor)?, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn left_out_edges_part_the_graph() {
        let graph = Graph::new(6, &[[0, 5], [5, 3], [1, 2], [2, 3]], &[1.0; 4]).unwrap();
        let whole = connected_partition(&graph, |_, _| true, &Monitor::default()).unwrap();
        assert_eq!(whole.segments(), [0, 0, 0, 0, 1, 0]);
        let parted = connected_partition(&graph, |_, ends| ends != [2, 3], &Monitor::default()).unwrap();
        assert_eq!(parted.segments(), [0, 1, 1, 0, 2, 0]);
    }
}
