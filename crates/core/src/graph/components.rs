//! Connected components.

use super::Graph;
use super::union_find::UnionFind;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Which component each node belongs to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Components {
    /// Component of each node, below [`Components::count`]; components are numbered in the order of their smallest node.
    pub of: Vec<u32>,
    /// Number of components.
    pub count: usize,
}

/// The connected components of a graph; edges of any weight connect, also of weight 0. O(nodes + edges), nearly.
///
/// ```
/// use scansion_core::graph::{Graph, connected_components};
/// use scansion_core::parallel::Monitor;
///
/// let graph = Graph::new(5, &[[3, 1], [4, 2]], &[1.0, 1.0])?;
/// let components = connected_components(&graph, &Monitor::default())?;
/// assert_eq!(components.of, [0, 1, 2, 1, 2]);
/// assert_eq!(components.count, 3);
/// # Ok::<(), scansion_core::Error>(())
/// ```
///
/// # Errors
/// If the work was cancelled.
pub fn connected_components(graph: &Graph, monitor: &Monitor) -> Result<Components> {
    let mut sets = UnionFind::new(graph.len());
    for piece in watched(graph.edges().len(), monitor) {
        for &[a, b] in &graph.edges()[piece?] {
            sets.unite(a, b);
        }
    }
    Components::numbered(graph.len(), |node| sets.root(node), monitor)
}

impl Components {
    /// From the node that stands for the component of each node.
    pub(crate) fn numbered(nodes: usize, mut root: impl FnMut(u32) -> u32, monitor: &Monitor) -> Result<Self> {
        const UNSEEN: u32 = u32::MAX;
        let mut name = vec![UNSEEN; nodes];
        let mut count = 0;
        let mut of = Vec::with_capacity(nodes);
        for piece in watched(nodes, monitor) {
            of.extend(piece?.map(|node| {
                let slot = &mut name[root(node as u32) as usize];
                if *slot == UNSEEN {
                    *slot = count;
                    count += 1;
                }
                *slot
            }));
        }
        Ok(Self { of, count: count as usize })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// Replaces the label of both ends of every edge by the smaller one until nothing changes.
    fn slow(graph: &Graph) -> Vec<u32> {
        let mut smallest: Vec<u32> = (0..graph.len() as u32).collect();
        for _ in 0..graph.len() {
            for &[a, b] in graph.edges() {
                let least = smallest[a as usize].min(smallest[b as usize]);
                (smallest[a as usize], smallest[b as usize]) = (least, least);
            }
        }
        smallest
    }

    #[test]
    fn components_are_those_of_the_slow_way_numbered_by_their_smallest_node() {
        for seed in 0..50 {
            let mut random = stream(seed, 3);
            let mut draw = || (random.uniform() * 40.0) as u32;
            let pairs: Vec<[u32; 2]> = (0..25).map(|_| [draw(), draw()]).filter(|[a, b]| a != b).collect();
            let graph = Graph::new(40, &pairs, &vec![0.0; pairs.len()]).unwrap();
            let (found, smallest) = (connected_components(&graph, &Monitor::default()).unwrap(), slow(&graph));
            let mut names = smallest.clone();
            names.sort_unstable();
            names.dedup();
            assert_eq!(found.count, names.len());
            let expected = smallest.iter().map(|s| names.iter().position(|n| n == s).unwrap() as u32);
            assert_eq!(found.of, expected.collect::<Vec<_>>(), "seed {seed}");
        }
    }

    #[test]
    fn no_nodes_no_components() {
        let components = |graph: &Graph| connected_components(graph, &Monitor::default()).unwrap();
        assert_eq!(components(&Graph::default()), Components::default());
        let alone = Graph::new(2, &[], &[]).unwrap();
        assert_eq!(components(&alone).of, [0, 1]);
    }
}
