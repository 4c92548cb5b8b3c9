//! Connected components of a graph some of whose edges are ignored.

use super::Partition;
use crate::error::Result;
use crate::graph::{Graph, UnionFind};
use crate::parallel::{Monitor, watched};

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
    let mut sets = UnionFind::new(graph.len());
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
