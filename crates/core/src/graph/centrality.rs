//! How central the nodes of a graph are.

use super::Graph;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// A measure of centrality.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Centrality {
    /// The share of time that a random walk along the edges spends at the node (L. Page, S. Brin, R. Motwani, T.
    /// Winograd, *The PageRank citation ranking*, Stanford 1999).
    #[default]
    PageRank,
    /// The sum of the weights of its edges, divided by the sum over all nodes.
    WeightedDegree,
    /// Its entry in the first eigenvector of the matrix of weights (P. Bonacich, *Power and centrality*, American Journal
    /// of Sociology 92(5), 1987, doi:10.1086/228631), of length 1.
    Eigenvector,
}

/// Probability that the walk follows an edge; else it goes on at any node.
const DAMPING: f64 = 0.85;
/// Iterations end when the values of all nodes together change by less than this, a node.
const TOLERANCE: f64 = 1e-10;
/// Most iterations.
const MOST: usize = 10_000;

/// The centrality of each node; edges are followed in proportion to their weight.
///
/// PageRank has a damping of 0.85 and sums to 1; a node without edges goes on at any node. The first eigenvector is
/// found by iterations of A + 1, so that graphs with two sides have one too; of a graph in several parts it is nearly 0
/// but on the part of the largest eigenvalue. O(iterations · m). Iterations end at a total change of 1e-10 a node, or
/// after 10,000.
///
/// # Errors
/// If the weights of all edges sum to infinity, or the work was cancelled.
///
/// ```
/// use scansion_core::graph::{Centrality, Graph, centrality};
/// // A star: its middle is the most central.
/// let star = Graph::new(4, &[[0, 1], [0, 2], [0, 3]], &[1.0; 3])?;
/// let found = centrality(&star, Centrality::WeightedDegree, &Default::default())?;
/// assert_eq!(found[0], 0.5);
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn centrality(graph: &Graph, measure: Centrality, monitor: &Monitor) -> Result<Vec<f64>> {
    let mut degrees = vec![0.0; graph.len()];
    for (&[a, b], &weight) in graph.edges().iter().zip(graph.weights()) {
        degrees[a as usize] += f64::from(weight);
        degrees[b as usize] += f64::from(weight);
    }
    let total: f64 = degrees.iter().sum();
    if !total.is_finite() {
        return Err(Error::input("the weights of the graph sum to infinity (allowed: finite sums)"));
    }
    let uniform = 1.0 / graph.len().max(1) as f64;
    match measure {
        Centrality::PageRank => converge(graph, monitor, |before| page_rank(graph, &degrees, before)),
        Centrality::WeightedDegree if total > 0.0 => Ok(degrees.iter().map(|d| d / total).collect()),
        Centrality::WeightedDegree => Ok(vec![uniform; graph.len()]),
        Centrality::Eigenvector => converge(graph, monitor, |before| eigenvector(graph, before)),
    }
}

/// Repeats a step from equal values until little changes.
fn converge(graph: &Graph, monitor: &Monitor, step: impl Fn(&[f64]) -> Vec<f64>) -> Result<Vec<f64>> {
    let mut values = vec![1.0 / graph.len().max(1) as f64; graph.len()];
    for _ in 0..MOST {
        monitor.check()?;
        let next = step(&values);
        let change: f64 = next.iter().zip(&values).map(|(a, b)| (a - b).abs()).sum();
        values = next;
        if change < TOLERANCE * graph.len() as f64 {
            break;
        }
    }
    Ok(values)
}

fn page_rank(graph: &Graph, degrees: &[f64], before: &[f64]) -> Vec<f64> {
    let stranded: f64 = before.iter().zip(degrees).filter(|(_, d)| **d <= 0.0).map(|(value, _)| value).sum();
    let share = (1.0 - DAMPING + DAMPING * stranded) / graph.len().max(1) as f64;
    let mut next = vec![share; graph.len()];
    for (&[a, b], &weight) in graph.edges().iter().zip(graph.weights()) {
        let (a, b, weight) = (a as usize, b as usize, f64::from(weight));
        if weight > 0.0 {
            next[b] += DAMPING * before[a] * weight / degrees[a];
            next[a] += DAMPING * before[b] * weight / degrees[b];
        }
    }
    next
}

fn eigenvector(graph: &Graph, before: &[f64]) -> Vec<f64> {
    let mut next = before.to_vec();
    for (&[a, b], &weight) in graph.edges().iter().zip(graph.weights()) {
        next[b as usize] += before[a as usize] * f64::from(weight);
        next[a as usize] += before[b as usize] * f64::from(weight);
    }
    let length = next.iter().map(|v| v * v).sum::<f64>().sqrt();
    next.iter().map(|v| if length > 0.0 { v / length } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(graph: &Graph, measure: Centrality) -> Vec<f64> {
        centrality(graph, measure, &Monitor::default()).unwrap()
    }

    /// Two triangles on a bridge, a tail, and a node alone.
    fn scene() -> Graph {
        let pairs = [[0, 1], [1, 2], [0, 2], [2, 3], [3, 4], [4, 5], [3, 5], [5, 6]];
        Graph::new(8, &pairs, &[1.0, 2.0, 0.5, 3.0, 1.5, 2.5, 4.0, 0.25]).unwrap()
    }

    /// networkx 3.6.1: `pagerank(G, alpha=0.85, tol=1e-14, max_iter=10000)` and `eigenvector_centrality(G, tol=1e-14,
    /// max_iter=100000, weight="weight")` of [`scene`].
    const PAGE_RANK: [f64; 8] = [
        0.0675634185861,
        0.115126194659,
        0.180727529792,
        0.251224544135,
        0.125245077573,
        0.211496955799,
        0.0276372584764,
        0.020979020979,
    ];
    const EIGENVECTOR: [f64; 8] = [
        0.0480175601481,
        0.121203123524,
        0.349513613134,
        0.629279681851,
        0.382014602411,
        0.564262760162,
        0.0228869842423,
        2.25089915974e-46,
    ];

    #[test]
    fn values_are_those_of_networkx() {
        let (rank, vector) = (of(&scene(), Centrality::PageRank), of(&scene(), Centrality::Eigenvector));
        for v in 0..8 {
            assert!((rank[v] - PAGE_RANK[v]).abs() < 2e-9, "{rank:?}");
            assert!((vector[v] - EIGENVECTOR[v]).abs() < 2e-7, "{vector:?}");
        }
        assert!((rank.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn nodes_of_a_ring_are_equal_and_a_graph_without_edges_has_equal_nodes() {
        let ring = Graph::new(6, &[[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [0, 5]], &[2.0; 6]).unwrap();
        for measure in [Centrality::PageRank, Centrality::WeightedDegree, Centrality::Eigenvector] {
            let found = of(&ring, measure);
            assert!(found.iter().all(|v| (v - found[0]).abs() < 1e-12 && *v > 0.0), "{measure:?}");
            let bare = of(&Graph::new(3, &[], &[]).unwrap(), measure);
            assert!(bare.iter().all(|v| (v - bare[0]).abs() < 1e-15 && *v > 0.0), "{measure:?}");
            assert!(of(&Graph::default(), measure).is_empty());
        }
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(centrality(&ring, Centrality::PageRank, &monitor).is_err());
    }
}
