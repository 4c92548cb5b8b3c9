//! The edges at each node in a third of the memory of an [`Adjacency`](super::Adjacency).

use super::Graph;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// The edges at each node. Edges to larger nodes are consecutive in the graph, so that only the others need a list. 4
/// bytes an edge and 8 a node.
#[derive(Clone, Debug)]
pub struct Incidence<'a> {
    graph: &'a Graph,
    /// Index of the first edge to a larger node, for each node.
    larger: Vec<u32>,
    /// Index in `edges` of the first edge to a smaller node, for each node.
    smaller: Vec<u32>,
    edges: Vec<u32>,
}

impl<'a> Incidence<'a> {
    /// O(n + m).
    pub(super) fn new(graph: &'a Graph, monitor: &Monitor) -> Result<Self> {
        let mut larger = vec![0u32; graph.len() + 1];
        let mut smaller = vec![0u32; graph.len() + 2];
        for piece in watched(graph.edges().len(), monitor) {
            for &[a, b] in &graph.edges()[piece?] {
                larger[a as usize + 1] += 1;
                smaller[b as usize + 2] += 1;
            }
        }
        for table in [&mut larger, &mut smaller] {
            (1..table.len()).for_each(|node| table[node] += table[node - 1]);
        }
        let mut edges = vec![0u32; graph.edges().len()];
        for piece in watched(graph.edges().len(), monitor) {
            for edge in piece? {
                let slot = &mut smaller[graph.edges()[edge][1] as usize + 1];
                edges[*slot as usize] = edge as u32;
                *slot += 1;
            }
        }
        smaller.pop();
        Ok(Self { graph, larger, smaller, edges })
    }

    /// Neighbours of a node, ascending, with the edge that leads there.
    pub fn of(&self, node: usize) -> impl Iterator<Item = (u32, u32)> + '_ {
        let smaller = &self.edges[self.smaller[node] as usize..self.smaller[node + 1] as usize];
        smaller.iter().map(|&edge| (self.graph.edges()[edge as usize][0], edge)).chain(self.larger(node))
    }

    /// Larger neighbours of a node, ascending, with the edge that leads there.
    pub fn larger(&self, node: usize) -> impl Iterator<Item = (u32, u32)> + '_ {
        let range = self.larger[node]..self.larger[node + 1];
        let ends = &self.graph.edges()[range.start as usize..range.end as usize];
        ends.iter().map(|ends| ends[1]).zip(range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn it_names_the_same_neighbours_as_the_adjacency() {
        let mut random = stream(3, 0);
        let all = (0..50u32).flat_map(|b| (0..b).map(move |a| [a, b]));
        let pairs: Vec<[u32; 2]> = all.filter(|_| random.below(6) == 0).collect();
        let graph = Graph::new(52, &pairs, &vec![1.0; pairs.len()]).unwrap();
        let (incidence, adjacency) = (graph.incidence(&Monitor::default()).unwrap(), graph.adjacency());
        for node in 0..52 {
            let expected: Vec<(u32, u32)> = adjacency.of(node).collect();
            assert_eq!(incidence.of(node).collect::<Vec<_>>(), expected);
            let larger: Vec<(u32, u32)> = expected.into_iter().filter(|(other, _)| *other as usize > node).collect();
            assert_eq!(incidence.larger(node).collect::<Vec<_>>(), larger);
        }
        assert_eq!(Graph::default().incidence(&Monitor::default()).unwrap().edges.len(), 0);
    }
}
