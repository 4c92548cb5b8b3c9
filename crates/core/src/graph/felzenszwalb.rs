//! Graph-based segmentation of Felzenszwalb and Huttenlocher.

use super::{Components, Graph, Parallel, UnionFind};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, sort_watched, watched};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// The meaning of an edge weight.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeMeaning {
    /// Dissimilarity of its ends, 0 for alike, as in the paper.
    #[default]
    Dissimilarity,
    /// Similarity of its ends, 0..=1, 1 for alike. The same as the dissimilarity 1 − w.
    Similarity,
}

/// Parameters of [`felzenszwalb`].
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct FelzenszwalbParams {
    /// k: larger values give larger components; in units of the weights, ≥ 0. Infinite gives the connected components.
    #[serde(deserialize_with = "crate::settings::number")]
    pub k: f64,
    /// The meaning of the edge weights.
    pub meaning: EdgeMeaning,
}

impl Default for FelzenszwalbParams {
    fn default() -> Self {
        Self { k: 0.9, meaning: EdgeMeaning::Dissimilarity }
    }
}

impl FelzenszwalbParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If k is negative or not a number.
    pub fn validate(&self) -> Result<()> {
        if self.k >= 0.0 { Ok(()) } else { Err(Error::parameter("k", self.k, "0 or more")) }
    }
}

/// Graph-based segmentation: two components stay apart if the difference between them is larger than the differences
/// within them.
///
/// P. F. Felzenszwalb, D. P. Huttenlocher, *Efficient graph-based image segmentation*, IJCV 59(2), 2004,
/// doi:10.1023/B:VISI.0000022288.19776.77. Edges are processed by ascending dissimilarity δ, ties in the graph's order.
/// Int of a component is its internal difference: the largest dissimilarity in its minimum spanning tree, 0 for a
/// single node. An edge δ merges two components if δ ≤ min(Int1 + k/|C1|, Int2 + k/|C2|). For similarities w = 1 − δ
/// that is w ≥ max(Int1 − k/|C1|, Int2 − k/|C2|), with Int = 1 for a single node.
///
/// Returns the component of each node. O(m log m). The graph of edges that may be given twice is
/// [`Graph::from_pairs`] with [`EdgeMeaning::parallel`].
///
/// ```
/// use scansion_core::graph::{FelzenszwalbParams, Graph, felzenszwalb};
/// use scansion_core::parallel::Monitor;
///
/// let graph = Graph::new(4, &[[0, 1], [1, 2], [2, 3]], &[0.1, 0.9, 0.2])?;
/// let params = FelzenszwalbParams { k: 0.5, ..Default::default() };
/// let parts = felzenszwalb(&graph, &params, &Monitor::default())?;
/// assert_eq!(parts.of, [0, 0, 1, 1]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
///
/// # Errors
/// If k is negative or not a number, or the work was cancelled.
pub fn felzenszwalb(graph: &Graph, params: &FelzenszwalbParams, monitor: &Monitor) -> Result<Components> {
    params.validate()?;
    // Rank and number of each edge.
    let mut order: Vec<(u32, u32)> = Vec::with_capacity(graph.edges().len());
    for piece in watched(graph.edges().len(), monitor) {
        order.extend(piece?.map(|e| (params.rank(graph.weights()[e]), e as u32)));
    }
    sort_watched(&mut order, monitor)?;
    let mut merger = FelzenszwalbMerger::default();
    merger.begin(graph.len(), params);
    for piece in watched(order.len(), monitor) {
        for e in order[piece?].iter().map(|&(_, e)| e as usize) {
            merger.join(Edge { ends: graph.edges()[e], weight: f64::from(graph.weights()[e]) }, params);
        }
    }
    Components::numbered(graph.len(), |node| merger.component(node), monitor)
}

impl EdgeMeaning {
    /// What edges that are given more than once weigh: the paper's edges are a set, of which the most alike merges first.
    pub fn parallel(self) -> Parallel {
        match self {
            Self::Dissimilarity => Parallel::Least,
            Self::Similarity => Parallel::Greatest,
        }
    }
}

impl FelzenszwalbParams {
    /// A number that ascends in the order in which edges are processed; the weight is not negative.
    fn rank(&self, weight: f32) -> u32 {
        // The bits of numbers that are not negative ascend like the numbers; the sum makes 0 of -0.
        let bits = (weight + 0.0).to_bits();
        match self.meaning {
            EdgeMeaning::Similarity => !bits,
            EdgeMeaning::Dissimilarity => bits,
        }
    }

    /// The order in which edges are processed: ascending dissimilarity.
    fn order(&self) -> fn(&Edge, &Edge) -> Ordering {
        match self.meaning {
            EdgeMeaning::Similarity => |a, b| b.weight.total_cmp(&a.weight),
            EdgeMeaning::Dissimilarity => |a, b| a.weight.total_cmp(&b.weight),
        }
    }
}

/// An edge between two nodes.
#[derive(Clone, Copy, Debug)]
struct Edge {
    ends: [u32; 2],
    weight: f64,
}

/// Scratch memory for many small segmentations.
#[derive(Clone, Debug, Default)]
pub struct FelzenszwalbMerger {
    edges: Vec<Edge>,
    components: UnionFind,
    /// Number of nodes of the component of each root.
    size: Vec<u32>,
    /// Internal difference of the component of each root.
    internal: Vec<f64>,
}

impl FelzenszwalbMerger {
    /// Segments nodes `0..nodes` by the edges between them, like [`felzenszwalb`] but without checks of the parameters.
    pub fn merge(&mut self, nodes: usize, edges: impl Iterator<Item = ([u32; 2], f64)>, params: &FelzenszwalbParams) {
        self.edges.clear();
        self.edges.extend(edges.map(|(ends, weight)| Edge { ends, weight }));
        // Stable sort: ties keep the order of the edges.
        self.edges.sort_by(params.order());
        self.begin(nodes, params);
        for at in 0..self.edges.len() {
            self.join(self.edges[at], params);
        }
    }

    /// Starts with every node as a component.
    fn begin(&mut self, nodes: usize, params: &FelzenszwalbParams) {
        let similar = params.meaning == EdgeMeaning::Similarity;
        self.components.reset(nodes);
        self.size.clear();
        self.size.resize(nodes, 1);
        self.internal.clear();
        self.internal.resize(nodes, if similar { 1.0 } else { 0.0 });
    }

    /// Processes the next edge in order.
    fn join(&mut self, edge: Edge, params: &FelzenszwalbParams) {
        let (weight, [a, b]) = (edge.weight, edge.ends.map(|node| self.component(node)));
        let share = |c: u32| params.k / f64::from(self.size[c as usize]);
        let within = |c: u32| self.internal[c as usize];
        let joins = match params.meaning {
            EdgeMeaning::Similarity => weight >= (within(a) - share(a)).max(within(b) - share(b)),
            EdgeMeaning::Dissimilarity => weight <= (within(a) + share(a)).min(within(b) + share(b)),
        };
        if joins && let Some((kept, gone)) = self.components.unite(a, b) {
            self.size[kept as usize] += self.size[gone as usize];
            self.internal[kept as usize] = weight;
        }
    }

    /// The smallest node of a node's component after [`FelzenszwalbMerger::merge`].
    pub fn component(&mut self, node: u32) -> u32 {
        self.components.root(node)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{WeightedPairs, connected_components};
    use crate::random::{Stream, stream};

    /// A graph of up to 20 nodes with similarities that are multiples of 1/1024.
    fn random_graph(s: &mut Stream) -> Graph {
        let nodes = 2 + s.below(19);
        let mut pairs: Vec<[u32; 2]> = (0..3 * nodes).map(|_| [s.below(nodes) as u32, s.below(nodes) as u32]).collect();
        pairs.iter_mut().for_each(|pair| pair.sort_unstable());
        pairs.retain(|[a, b]| a != b);
        pairs.sort_unstable();
        pairs.dedup();
        let weights: Vec<f32> = pairs.iter().map(|_| s.below(1025) as f32 / 1024.0).collect();
        Graph::new(nodes, &pairs, &weights).unwrap()
    }

    fn run(graph: &Graph, k: f64, meaning: EdgeMeaning) -> Components {
        felzenszwalb(graph, &FelzenszwalbParams { k, meaning }, &Monitor::default()).unwrap()
    }

    /// The method as the paper words it: components as lists, Int as the largest edge of their spanning tree.
    fn by_the_letter(graph: &Graph, k: f64) -> Vec<u32> {
        let mut order: Vec<usize> = (0..graph.edges().len()).collect();
        order.sort_by(|&a, &b| graph.weights()[a].total_cmp(&graph.weights()[b]).then(a.cmp(&b)));
        let mut parts: Vec<(Vec<u32>, f64)> = (0..graph.len() as u32).map(|v| (vec![v], 0.0)).collect();
        for e in order {
            let delta = f64::from(graph.weights()[e]);
            let [a, b] = graph.edges()[e].map(|v| parts.iter().position(|p| p.0.contains(&v)).unwrap());
            let bound = |p: usize| parts[p].1 + k / parts[p].0.len() as f64;
            if a != b && delta <= bound(a).min(bound(b)) {
                let gone = parts.remove(a.max(b));
                let kept = &mut parts[a.min(b)];
                kept.0.extend(gone.0);
                kept.1 = kept.1.max(gone.1).max(delta);
            }
        }
        let mut of = vec![0; graph.len()];
        parts.iter().for_each(|p| p.0.iter().for_each(|&v| of[v as usize] = *p.0.iter().min().unwrap()));
        of
    }

    #[test]
    fn similarities_give_what_dissimilarities_give() {
        let mut s = stream(21, 0);
        for round in 0..500 {
            let graph = random_graph(&mut s);
            let turned: Vec<f32> = graph.weights().iter().map(|w| 1.0 - w).collect();
            let turned = graph.clone().with_weights(turned).unwrap();
            let k = [0.05, 0.2, 0.5, 0.9, 2.0][round % 5];
            let expected = run(&turned, k, EdgeMeaning::Dissimilarity);
            assert_eq!(run(&graph, k, EdgeMeaning::Similarity), expected);
            let letter = by_the_letter(&turned, k);
            assert!(
                (0..graph.len())
                    .all(|a| (0..a).all(|b| { (letter[a] == letter[b]) == (expected.of[a] == expected.of[b]) }))
            );
        }
    }

    #[test]
    fn without_k_only_perfect_edges_join_and_with_much_all_that_hangs_together() {
        let mut s = stream(22, 0);
        let components = |graph: &Graph| connected_components(graph, &Monitor::default()).unwrap();
        for _ in 0..100 {
            let graph = random_graph(&mut s);
            assert_eq!(run(&graph, f64::INFINITY, EdgeMeaning::Similarity), components(&graph));
            let kept: Vec<[u32; 2]> =
                graph.edges().iter().zip(graph.weights()).filter(|(_, w)| **w == 1.0).map(|(e, _)| *e).collect();
            let perfect = Graph::new(graph.len(), &kept, &vec![1.0; kept.len()]).unwrap();
            assert_eq!(run(&graph, 0.0, EdgeMeaning::Similarity), components(&perfect));
        }
    }

    #[test]
    fn an_edge_that_is_given_twice_counts_once() {
        // Two edges of 0.3 merge at k = 0.4; their sum, 0.6, would not.
        for (meaning, weight) in [(EdgeMeaning::Dissimilarity, 0.3), (EdgeMeaning::Similarity, 0.7)] {
            let pairs = [[0, 1], [1, 0]];
            let given = WeightedPairs { pairs: &pairs, weights: &[weight; 2], parallel: meaning.parallel() };
            let graph = Graph::from_pairs(2, &given, &Monitor::default()).unwrap();
            assert_eq!(run(&graph, 0.4, meaning).count, 1);
        }
    }

    #[test]
    fn a_negative_k_is_refused() {
        let graph = Graph::new(2, &[[0, 1]], &[1.0]).unwrap();
        for k in [-1.0, f64::NAN] {
            let params = FelzenszwalbParams { k, ..Default::default() };
            assert!(felzenszwalb(&graph, &params, &Monitor::default()).is_err());
        }
    }
}
