//! Lines from accepted candidates: the union of their paths, cut at junctions.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.3: overlapping
//! candidates share their nodes, so that their union is a graph whose nodes of degree two are inside lines.

use super::linking::Candidate;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::graph::{Adjacency, Graph, Parallel, WeightedPairs};
use crate::parallel::{Monitor, watched};
use serde::{Deserialize, Serialize};

/// A line of straight segments in space.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Polyline {
    /// The vertices in order, metres; the last equals the first if the line is closed.
    pub vertices: Vec<[f32; 3]>,
    /// Probability of the likeliest candidate along each piece of the line, mean by length, 0 to 1.
    pub confidence: f32,
    /// The points of the cloud that the line runs along, in order, before it was simplified.
    pub nodes: Vec<u32>,
}

impl Polyline {
    /// Length in metres.
    pub fn length(&self) -> f64 {
        self.vertices.windows(2).map(|w| distance(w[0], w[1])).sum()
    }

    /// Whether the last vertex is the first one, and others lie between.
    pub fn is_closed(&self) -> bool {
        self.vertices.len() > 3 && self.vertices.first() == self.vertices.last()
    }
}

/// Distance of two positions, metres.
pub(super) fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2)).sum::<f64>().sqrt()
}

/// The union of accepted paths.
#[derive(Clone, Debug, Default)]
pub(super) struct PathUnion {
    /// The edges of all paths; weights are the highest probability of a candidate that runs along them.
    pub(super) graph: Graph,
    /// Sum of the probabilities of the candidates along each edge.
    pub(super) support: Vec<f32>,
}

/// Candidates that are chosen, or not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen<'a> {
    pub(super) candidates: &'a [Candidate],
    /// Whether each candidate is part of a contour.
    pub(super) active: &'a [bool],
    /// Probability of each candidate.
    pub(super) probabilities: &'a [f32],
}

impl PathUnion {
    /// The union of the chosen paths among `nodes` nodes. O(m log m) for m edges of all paths, of which 12 bytes each are
    /// held while they are united.
    ///
    /// # Errors
    /// If a path has a node that does not exist or twice in a row, or the work was cancelled.
    pub(super) fn new(nodes: usize, chosen: &Chosen<'_>, monitor: &Monitor) -> Result<Self> {
        let all = chosen.candidates.iter().zip(chosen.active).zip(chosen.probabilities);
        let (mut pairs, mut weights) = (Vec::new(), Vec::new());
        for ((candidate, _), &probability) in all.filter(|((_, active), _)| **active) {
            pairs.extend(candidate.path.windows(2).map(|w| [w[0].min(w[1]), w[0].max(w[1])]));
            weights.resize(pairs.len(), probability);
        }
        let of =
            |parallel| Graph::from_pairs(nodes, &WeightedPairs { pairs: &pairs, weights: &weights, parallel }, monitor);
        Ok(Self { support: of(Parallel::Sum)?.into_edges().1, graph: of(Parallel::Greatest)? })
    }
}

/// A path of nodes between junctions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Strand {
    /// The nodes in order; the last is the first if the strand is closed.
    pub(super) path: Vec<u32>,
    /// Mean weight of its edges, by length.
    pub(super) confidence: f32,
}

impl Strand {
    /// Length in metres.
    pub(super) fn length(&self, positions: &Positions) -> f64 {
        let at = |node: u32| positions.xyz(node as usize);
        self.path.windows(2).map(|w| distance(at(w[0]), at(w[1]))).sum()
    }
}

/// The paths between nodes of a degree other than two, each once, ascending by their first node and edge; then the
/// closed ones without such a node. O(n + m).
///
/// # Errors
/// If there is not one position a node, or the work was cancelled.
pub(super) fn strands(graph: &Graph, positions: &Positions, monitor: &Monitor) -> Result<Vec<Strand>> {
    if positions.len() != graph.len() {
        return Err(Error::input(format!("{} positions for {} nodes", positions.len(), graph.len())));
    }
    let adjacency = graph.adjacency_watched(monitor)?;
    let mut walk = Walk { graph, positions, adjacency: &adjacency, used: vec![false; graph.edges().len()] };
    let mut found = Vec::new();
    for ends in [true, false] {
        for piece in watched(graph.len(), monitor) {
            for node in piece? {
                // The second time only closed paths are left.
                if (degree(&adjacency, node) != 2) == ends {
                    let from = adjacency.offsets[node]..adjacency.offsets[node + 1];
                    found.extend(from.filter_map(|slot| walk.from(node as u32, slot)));
                }
            }
        }
    }
    Ok(found)
}

fn degree(adjacency: &Adjacency, node: usize) -> usize {
    adjacency.offsets[node + 1] - adjacency.offsets[node]
}

struct Walk<'a> {
    graph: &'a Graph,
    positions: &'a Positions,
    adjacency: &'a Adjacency,
    /// Whether each edge belongs to a strand.
    used: Vec<bool>,
}

impl Walk<'_> {
    /// The strand from a node along the edge in a slot of the adjacency, if it is new.
    fn from(&mut self, start: u32, mut slot: usize) -> Option<Strand> {
        let mut strand = Strand { path: vec![start], confidence: 0.0 };
        let (mut sum, mut length, mut node) = (0.0, 0.0, start);
        while !std::mem::replace(&mut self.used[self.adjacency.edges[slot] as usize], true) {
            let next = self.adjacency.neighbours[slot];
            let step = distance(self.positions.xyz(node as usize), self.positions.xyz(next as usize));
            sum += step * f64::from(self.graph.weights()[self.adjacency.edges[slot] as usize]);
            length += step;
            strand.path.push(next);
            node = next;
            if node == start || degree(self.adjacency, node as usize) != 2 {
                break;
            }
            let slots = self.adjacency.offsets[node as usize]..self.adjacency.offsets[node as usize + 1];
            slot = slots.into_iter().find(|&s| !self.used[self.adjacency.edges[s] as usize])?;
        }
        strand.confidence = if length > 0.0 { (sum / length) as f32 } else { 0.0 };
        Some(strand).filter(|strand| strand.path.len() > 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn line(n: usize) -> Positions {
        (0..n).map(|i| [i as f32, (i * i % 7) as f32, 0.0]).collect()
    }

    fn paths(n: usize, edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
        let weights = vec![0.5; edges.len()];
        let given = WeightedPairs { pairs: edges, weights: &weights, parallel: Parallel::Least };
        let graph = Graph::from_pairs(n, &given, &Monitor::default()).unwrap();
        let found = strands(&graph, &line(n), &Monitor::default()).unwrap();
        assert!(found.iter().all(|s| s.confidence == 0.5));
        found.into_iter().map(|s| s.path).collect()
    }

    #[test]
    fn lines_end_at_junctions_and_closed_ones_where_they_begin() {
        assert_eq!(paths(5, &[[0, 1], [1, 2], [2, 3], [3, 4]]), [[0, 1, 2, 3, 4]]);
        // A crossing of two lines.
        assert_eq!(paths(5, &[[0, 2], [1, 2], [2, 3], [2, 4]]), [[0, 2], [1, 2], [2, 3], [2, 4]]);
        // A ring, and a ring on a stalk.
        assert_eq!(paths(4, &[[0, 1], [1, 2], [2, 3], [0, 3]]), [[0, 1, 2, 3, 0]]);
        assert_eq!(paths(4, &[[0, 1], [1, 2], [2, 3], [1, 3]]), [vec![0, 1], vec![1, 2, 3, 1]]);
        assert!(paths(3, &[]).is_empty());
    }

    #[test]
    fn every_edge_is_in_exactly_one_strand() {
        for seed in 0..50 {
            let mut random = stream(seed, 2);
            let edges: Vec<[u32; 2]> =
                (0..45).map(|_| [random.below(40) as u32, random.below(40) as u32]).filter(|[a, b]| a != b).collect();
            let graph = Graph::new(40, &edges, &vec![0.5; edges.len()]).unwrap();
            let mut seen: Vec<[u32; 2]> = paths(40, &edges)
                .iter()
                .flat_map(|path| path.windows(2).map(|w| [w[0].min(w[1]), w[0].max(w[1])]).collect::<Vec<_>>())
                .collect();
            seen.sort_unstable();
            assert_eq!(seen, graph.edges(), "seed {seed}");
        }
    }

    #[test]
    fn overlapping_candidates_are_one_line() {
        let of = |path: &[u32]| Candidate { path: path.to_vec(), ..Candidate::default() };
        let candidates = [of(&[0, 1, 2]), of(&[3, 2, 1]), of(&[0, 4])];
        let chosen = Chosen { candidates: &candidates, active: &[true, true, false], probabilities: &[0.5, 0.75, 0.9] };
        let union = PathUnion::new(5, &chosen, &Monitor::default()).unwrap();
        assert_eq!(union.graph.edges(), [[0, 1], [1, 2], [2, 3]]);
        assert_eq!((union.graph.weights(), &union.support[..]), (&[0.5, 0.75, 0.75][..], &[0.5, 1.25, 0.75][..]));
    }
}
