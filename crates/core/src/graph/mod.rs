//! Undirected weighted graphs on points and on segments, and algorithms on them.

mod build;
mod centrality;
mod components;
mod felzenszwalb;
mod incidence;
mod max_flow;
mod orientation;
mod spanning_tree;
mod union_find;
mod weight;

pub use build::{KnnGraphParams, Multiplicity, knn_graph};
pub use centrality::{Centrality, centrality};
pub use components::{Components, connected_components};
pub use felzenszwalb::{EdgeMeaning, FelzenszwalbMerger, FelzenszwalbParams, felzenszwalb};
pub use incidence::Incidence;
pub use max_flow::MaxFlow;
pub use orientation::{NormalParams, Orientation};
pub use spanning_tree::minimum_spanning_tree;
pub(crate) use union_find::UnionFind;
pub use weight::{EdgeWeight, metric_share};

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::memory;
use crate::parallel::{Held, Monitor, sort_watched, watched};

/// An undirected graph: every edge once, as `[smaller node, larger node]`, in ascending order, with a weight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    nodes: usize,
    edges: Vec<[u32; 2]>,
    weights: Vec<f32>,
}

/// The edges at each node: `neighbours[offsets[v]..offsets[v + 1]]` ascending, with the edge that leads there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adjacency {
    /// Where the edges of each node begin; one more than there are nodes.
    pub offsets: Vec<usize>,
    /// Node at the other end.
    pub neighbours: Vec<u32>,
    /// Index into [`Graph::edges`].
    pub edges: Vec<u32>,
}

impl Graph {
    /// From pairs in any order and direction; pairs that occur more than once become one edge with the sum of weights.
    ///
    /// O(m log m). Weights are finite and not negative.
    ///
    /// # Errors
    /// If a node is not below `nodes`, an edge joins a node with itself, lengths differ, a weight is negative or not
    /// finite, there are more than 2^32 - 1 nodes or pairs, or more nodes than memory has room for.
    pub fn new(nodes: usize, pairs: &[[u32; 2]], weights: &[f32]) -> Result<Self> {
        Self::new_watched(nodes, pairs, weights, &Monitor::default())
    }

    /// Like [`Graph::new`], and can be cancelled.
    ///
    /// # Errors
    /// As [`Graph::new`], and if the work was cancelled.
    pub fn new_watched(nodes: usize, pairs: &[[u32; 2]], weights: &[f32], monitor: &Monitor) -> Result<Self> {
        Self::from_pairs(nodes, &WeightedPairs { pairs, weights, parallel: Parallel::Sum }, monitor)
    }

    /// Like [`Graph::new_watched`], with the weight of parallel edges as the pairs say. O(m log m).
    ///
    /// # Errors
    /// As [`Graph::new_watched`].
    pub fn from_pairs(nodes: usize, given: &WeightedPairs<'_>, monitor: &Monitor) -> Result<Self> {
        let WeightedPairs { pairs, weights, parallel } = *given;
        if nodes > u32::MAX as usize {
            return Err(Error::input(format!("{nodes} nodes in one graph; at most {} are possible", u32::MAX)));
        }
        if pairs.len() > u32::MAX as usize {
            return Err(Error::input(format!("{} edges in one graph; at most {} are possible", pairs.len(), u32::MAX)));
        }
        // Components, trees and merging need this much per node.
        memory::require(24 * nodes as u64, &format!("a graph of {nodes} nodes"))?;
        if pairs.len() != weights.len() {
            return Err(Error::input(format!("{} edges but {} weights", pairs.len(), weights.len())));
        }
        let mut rows: Held<Vec<Row>> = Held::new(Vec::with_capacity(pairs.len()), monitor);
        for piece in watched(pairs.len(), monitor) {
            for e in piece? {
                rows.push((checked(nodes, pairs[e], weights[e])?, e as u32));
            }
        }
        // The weights of parallel edges are summed in the order of the pairs.
        sort_watched(&mut rows, monitor)?;
        let mut graph = Held::new(Self { nodes, ..Self::default() }, monitor);
        let Self { edges, weights: sums, .. } = &mut *graph;
        for piece in watched(rows.len(), monitor) {
            for &(edge, pair) in &rows[piece?] {
                let weight = weights[pair as usize];
                match sums.last_mut() {
                    Some(last) if edges.last() == Some(&edge) => *last = parallel.of(*last, weight),
                    _ => {
                        edges.push(edge);
                        sums.push(weight);
                    }
                }
            }
        }
        Ok(graph.into_inner())
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes
    }

    /// True if there is no node.
    pub fn is_empty(&self) -> bool {
        self.nodes == 0
    }

    /// The edges, each once, `[smaller, larger]`, ascending.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Weight of each edge.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The edges and their weights without copying them.
    pub fn into_edges(self) -> (Vec<[u32; 2]>, Vec<f32>) {
        (self.edges, self.weights)
    }

    /// The same edges with other weights.
    ///
    /// # Errors
    /// If there is not one finite weight that is not negative for each edge.
    pub fn with_weights(self, weights: Vec<f32>) -> Result<Self> {
        if weights.len() != self.edges.len() || weights.iter().any(|w| !(*w >= 0.0 && w.is_finite())) {
            return Err(Error::input(format!(
                "{} weights for {} edges (allowed: one each, finite, not negative)",
                weights.len(),
                self.edges.len()
            )));
        }
        Ok(Self { weights, ..self })
    }

    /// Multiplies each weight by the [`metric_share`] of the edge's length; node i is point i. O(m).
    ///
    /// # Errors
    /// If there is not one point a node, or the work was cancelled.
    pub fn weakened(mut self, points: &Positions, near: f64, monitor: &Monitor) -> Result<Self> {
        if points.len() != self.nodes {
            return Err(Error::input(format!("{} points for {} nodes", points.len(), self.nodes)));
        }
        for piece in watched(self.edges.len(), monitor) {
            for e in piece? {
                let [a, b] = self.edges[e].map(|node| points.xyz(node as usize));
                let squared: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2)).sum();
                self.weights[e] = (f64::from(self.weights[e]) * metric_share(squared, near)) as f32;
            }
        }
        Ok(self)
    }

    /// Removes the edges that are not `kept` and frees their memory. O(m).
    pub fn retain(&mut self, kept: impl Fn([u32; 2]) -> bool) {
        let mut left = 0;
        for edge in 0..self.edges.len() {
            if kept(self.edges[edge]) {
                self.edges[left] = self.edges[edge];
                self.weights[left] = self.weights[edge];
                left += 1;
            }
        }
        self.edges.truncate(left);
        self.weights.truncate(left);
        self.edges.shrink_to_fit();
        self.weights.shrink_to_fit();
    }

    /// The induced subgraph of some nodes, given in ascending order: `nodes[i]` becomes node i; only edges that are `kept`
    /// remain. O(n + m) time, 4 bytes a node beside the result.
    ///
    /// # Errors
    /// If a node does not exist or they do not ascend, or the work was cancelled.
    pub fn induced(&self, nodes: &[u32], kept: impl Fn([u32; 2]) -> bool, monitor: &Monitor) -> Result<Self> {
        if let Some(pair) = nodes.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(Error::input(format!("node {} stands before {} (allowed: ascending nodes)", pair[0], pair[1])));
        }
        if let Some(last) = nodes.last().filter(|last| **last as usize >= self.nodes) {
            return Err(Error::input(format!("node {last} of a graph of {} nodes", self.nodes)));
        }
        let mut place = vec![u32::MAX; self.nodes];
        nodes.iter().zip(0..).for_each(|(&node, at)| place[node as usize] = at);
        let there = |ends: [u32; 2]| ends.iter().all(|end| place[*end as usize] != u32::MAX) && kept(ends);
        let mut count = 0;
        for piece in watched(self.edges.len(), monitor) {
            count += self.edges[piece?].iter().filter(|ends| there(**ends)).count();
        }
        let graph = Self { nodes: nodes.len(), edges: Vec::with_capacity(count), weights: Vec::with_capacity(count) };
        let mut graph = Held::new(graph, monitor);
        for piece in watched(self.edges.len(), monitor) {
            for e in piece?.filter(|&e| there(self.edges[e])) {
                graph.edges.push(self.edges[e].map(|end| place[end as usize]));
                graph.weights.push(self.weights[e]);
            }
        }
        Ok(graph.into_inner())
    }

    /// The edges at each node, in less memory than [`Graph::adjacency`]. O(n + m).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn incidence(&self, monitor: &Monitor) -> Result<Incidence<'_>> {
        Incidence::new(self, monitor)
    }

    /// The edges at each node. O(nodes + edges).
    pub fn adjacency(&self) -> Adjacency {
        // A new monitor cannot have been cancelled.
        self.adjacency_watched(&Monitor::default()).unwrap_or_default().into_inner()
    }

    /// Like [`Graph::adjacency`], and can be cancelled.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn adjacency_watched(&self, monitor: &Monitor) -> Result<Held<Adjacency>> {
        Adjacency::new(self.nodes, &self.edges, monitor)
    }
}

/// The weight of several edges between the same two nodes, in either direction.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Parallel {
    /// The sum: costs of a cut.
    #[default]
    Sum,
    /// The least: lengths and dissimilarities.
    Least,
    /// The greatest: similarities.
    Greatest,
}

impl Parallel {
    fn of(self, a: f32, b: f32) -> f32 {
        match self {
            Self::Sum => a + b,
            Self::Least => a.min(b),
            Self::Greatest => a.max(b),
        }
    }
}

/// Edges to build a graph of.
#[derive(Clone, Copy, Debug, Default)]
pub struct WeightedPairs<'a> {
    /// The nodes of each edge, in any order.
    pub pairs: &'a [[u32; 2]],
    /// The weight of each edge; finite, 0 or more.
    pub weights: &'a [f32],
    /// The weight of edges that are given more than once.
    pub parallel: Parallel,
}

/// An edge while a graph is built: `[smaller node, larger node]` and the number of the pair.
type Row = ([u32; 2], u32);

/// Checks a pair and its weight and puts the smaller node first.
fn checked(nodes: usize, [a, b]: [u32; 2], weight: f32) -> Result<[u32; 2]> {
    if a == b || a as usize >= nodes || b as usize >= nodes {
        return Err(Error::input(format!("edge {a}-{b} does not join two of the {nodes} nodes")));
    }
    match weight >= 0.0 && weight.is_finite() {
        true => Ok([a.min(b), a.max(b)]),
        false => Err(Error::input(format!("weight {weight} of edge {a}-{b} (allowed: finite, not negative)"))),
    }
}

impl Adjacency {
    /// From ascending edges `[smaller node, larger node]` between nodes below `nodes`.
    fn new(nodes: usize, pairs: &[[u32; 2]], monitor: &Monitor) -> Result<Held<Self>> {
        let ends = || vec![0; 2 * pairs.len()];
        let mut found = Held::new(Self { offsets: vec![0; nodes + 1], neighbours: ends(), edges: ends() }, monitor);
        let Self { offsets, neighbours, edges } = &mut *found;
        for piece in watched(pairs.len(), monitor) {
            pairs[piece?].iter().flatten().for_each(|&node| offsets[node as usize + 1] += 1);
        }
        for node in 0..nodes {
            offsets[node + 1] += offsets[node];
        }
        let mut next = offsets.clone();
        let mut put = |from: u32, to: u32, edge: usize| {
            let slot = &mut next[from as usize];
            (neighbours[*slot], edges[*slot]) = (to, edge as u32);
            *slot += 1;
        };
        // The smaller ends first, then the larger: every node's neighbours come in ascending order.
        for piece in watched(pairs.len(), monitor) {
            piece?.for_each(|e| put(pairs[e][1], pairs[e][0], e));
        }
        for piece in watched(pairs.len(), monitor) {
            piece?.for_each(|e| put(pairs[e][0], pairs[e][1], e));
        }
        Ok(found)
    }

    /// Neighbours of a node and the edges that lead to them, ascending by neighbour.
    pub fn of(&self, node: usize) -> impl Iterator<Item = (u32, u32)> + '_ {
        let range = self.offsets[node]..self.offsets[node + 1];
        self.neighbours[range.clone()].iter().copied().zip(self.edges[range].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_directions_are_one_edge_with_the_summed_weight() {
        let graph = Graph::new(4, &[[2, 1], [0, 3], [1, 2], [0, 1]], &[1.0, 2.0, 0.5, 4.0]).unwrap();
        assert_eq!(graph.edges(), [[0, 1], [0, 3], [1, 2]]);
        assert_eq!(graph.weights(), [4.0, 2.0, 1.5]);
        let adjacency = graph.adjacency();
        assert_eq!(adjacency.of(1).collect::<Vec<_>>(), [(0, 0), (2, 2)]);
        assert_eq!(adjacency.of(0).collect::<Vec<_>>(), [(1, 0), (3, 1)]);
    }

    #[test]
    fn parallel_edges_have_the_weight_that_was_asked_for() {
        let (pairs, weights) = (&[[2, 1], [0, 1], [1, 2], [1, 2]][..], &[0.5, 2.0, 0.25, 0.75][..]);
        for (parallel, expected) in [(Parallel::Sum, 1.5), (Parallel::Least, 0.25), (Parallel::Greatest, 0.75)] {
            let given = WeightedPairs { pairs, weights, parallel };
            assert_eq!(Graph::from_pairs(3, &given, &Monitor::default()).unwrap().weights(), [2.0, expected]);
        }
    }

    #[test]
    fn some_nodes_keep_the_edges_between_them() {
        let graph = Graph::new(5, &[[0, 1], [1, 2], [1, 4], [2, 4], [3, 4]], &[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        let found = graph.induced(&[1, 2, 4], |ends| ends != [1, 4], &Monitor::default()).unwrap();
        assert_eq!(found, Graph::new(3, &[[0, 1], [1, 2]], &[2.0, 4.0]).unwrap());
        let all_of = |nodes: &[u32]| graph.induced(nodes, |_| true, &Monitor::default());
        assert_eq!(all_of(&[0, 1, 2, 3, 4]).unwrap(), graph);
        assert!(all_of(&[]).unwrap().is_empty());
        assert!(all_of(&[1, 1]).is_err() && all_of(&[1, 5]).is_err());
    }

    #[test]
    fn edges_that_are_not_kept_are_forgotten() {
        let graph = Graph::new(4, &[[0, 1], [1, 2], [2, 3]], &[1.0, 2.0, 3.0]).unwrap();
        let mut found = graph.clone();
        found.retain(|_| true);
        assert_eq!(found, graph);
        found.retain(|ends| ends != [1, 2]);
        assert_eq!(found, Graph::new(4, &[[0, 1], [2, 3]], &[1.0, 3.0]).unwrap());
    }

    #[test]
    fn loops_unknown_nodes_and_bad_weights_are_refused() {
        assert!(Graph::new(2, &[[1, 1]], &[1.0]).is_err());
        assert!(Graph::new(2, &[[0, 2]], &[1.0]).is_err());
        assert!(Graph::new(2, &[[0, 1]], &[-1.0]).is_err());
        assert!(Graph::new(2, &[[0, 1]], &[f32::NAN]).is_err());
        assert!(Graph::new(2, &[[0, 1]], &[]).is_err());
    }

    #[test]
    fn cancelled_work_ends_in_an_error() {
        let monitor = Monitor::default();
        let graph = Graph::new(3, &[[0, 1], [1, 2]], &[1.0, 2.0]).unwrap();
        monitor.cancel();
        assert!(Graph::new_watched(3, graph.edges(), graph.weights(), &monitor).is_err());
        assert!(graph.adjacency_watched(&monitor).is_err() && graph.incidence(&monitor).is_err());
        assert!(graph.induced(&[0, 1], |_| true, &monitor).is_err());
        assert!(connected_components(&graph, &monitor).is_err());
        assert!(felzenszwalb(&graph, &FelzenszwalbParams::default(), &monitor).is_err());
        assert!(minimum_spanning_tree(&graph, &monitor).is_err());
    }
}
