//! Quality of a partition before classification: the accuracy that labelling whole segments can reach, and agreement of
//! boundaries.

use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::segmentation::{Partition, majorities};
use serde::Serialize;

pub use crate::segmentation::oracle_accuracy;

/// Share of each segment's labelled nodes that have its most frequent label, 0..=1; `None` for a segment without
/// labels. O(n).
///
/// # Errors
/// If there is not one label (or `None`) for each node.
pub fn purities(partition: &Partition, labels: &[Option<u8>]) -> Result<Vec<Option<f64>>> {
    let purity = |labelled: u32, votes: u32| (labelled > 0).then(|| f64::from(votes) / f64::from(labelled));
    Ok(majorities(partition, labels)?.iter().map(|m| purity(m.labelled, m.votes)).collect())
}

/// Agreement between the boundaries of segments and those of labels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BoundaryScores {
    /// Edges whose ends have different labels.
    pub true_edges: u64,
    /// Edges between labelled nodes of different segments.
    pub found_edges: u64,
    /// Boundary recall: share of the true edges that are found; NaN if there are none.
    pub recall: f64,
    /// Boundary precision: share of the found edges that are true; NaN if there are none.
    pub precision: f64,
}

/// Compares the boundaries of a partition with those between labels. With a tolerance of 0 hops an edge matches only
/// itself, with r > 0 also any edge that has an end at most r − 1 hops away from one of its own. Edges with an
/// unlabelled end are ignored. O(n + m) a hop.
///
/// # Errors
/// If the partition, the labels and the graph differ in the number of nodes.
pub fn boundary_scores(
    graph: &Graph,
    partition: &Partition,
    labels: &[Option<u8>],
    hops: usize,
) -> Result<BoundaryScores> {
    if graph.len() != partition.nodes() || graph.len() != labels.len() {
        let (nodes, parted, labelled) = (graph.len(), partition.nodes(), labels.len());
        return Err(Error::input(format!("a graph of {nodes} nodes, {parted} in segments, {labelled} labels")));
    }
    let segments = partition.segments();
    let label_pairs = graph.edges().iter().map(|e| e.map(|v| labels[v as usize]));
    let known: Vec<bool> = label_pairs.map(|[a, b]| a.is_some() && b.is_some()).collect();
    let edges = || graph.edges().iter().zip(&known);
    let truth: Vec<bool> = edges().map(|(&[a, b], k)| *k && labels[a as usize] != labels[b as usize]).collect();
    let found: Vec<bool> = edges().map(|(&[a, b], k)| *k && segments[a as usize] != segments[b as usize]).collect();
    Ok(BoundaryScores {
        true_edges: count(&truth),
        found_edges: count(&found),
        recall: met(graph, &truth, &found, hops),
        precision: met(graph, &found, &truth, hops),
    })
}

fn count(marks: &[bool]) -> u64 {
    marks.iter().filter(|m| **m).count() as u64
}

/// Share of the wanted edges that match one of the others; NaN if there are none.
fn met(graph: &Graph, wanted: &[bool], others: &[bool], hops: usize) -> f64 {
    let near = (hops > 0).then(|| nodes_near(graph, others, hops - 1));
    let is_met = |edge: usize| {
        others[edge] || near.as_ref().is_some_and(|near| graph.edges()[edge].iter().any(|&v| near[v as usize]))
    };
    let hits = (0..wanted.len()).filter(|&edge| wanted[edge] && is_met(edge)).count();
    hits as f64 / count(wanted) as f64
}

/// Nodes at most `hops` away from an end of a marked edge. Each hop is one pass over the edges, which needs two bytes a
/// node; lists of neighbours would need much more memory.
fn nodes_near(graph: &Graph, marked: &[bool], hops: usize) -> Vec<bool> {
    let mut near = vec![false; graph.len()];
    let ends = graph.edges().iter().zip(marked).filter(|(_, marked)| **marked).flat_map(|(ends, _)| ends);
    ends.for_each(|&node| near[node as usize] = true);
    for _ in 0..hops {
        let before = near.clone();
        for &[a, b] in graph.edges() {
            near[a as usize] |= before[b as usize];
            near[b as usize] |= before[a as usize];
        }
        if near == before {
            break;
        }
    }
    near
}

/// One bin of the histogram of segment sizes.
#[derive(Clone, Copy, Debug, Eq, PartialEq, Serialize)]
pub struct SizeBin {
    /// Least number of nodes of a segment in this bin, a power of two; the next bin begins at twice as many.
    pub from: u64,
    /// Number of segments of this size.
    pub segments: u64,
    /// Number of nodes in them.
    pub nodes: u64,
}

/// Histogram of segment sizes: 1, 2-3, 4-7, 8-15, ... nodes, up to the largest. O(segments).
pub fn size_histogram(partition: &Partition) -> Vec<SizeBin> {
    let mut bins: Vec<SizeBin> = Vec::new();
    for members in partition.iter() {
        let place = members.len().ilog2() as usize;
        while bins.len() <= place {
            bins.push(SizeBin { from: 1 << bins.len(), segments: 0, nodes: 0 });
        }
        bins[place].segments += 1;
        bins[place].nodes += members.len() as u64;
    }
    bins
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(nodes: u32) -> Graph {
        let pairs: Vec<[u32; 2]> = (1..nodes).map(|v| [v - 1, v]).collect();
        Graph::new(nodes as usize, &pairs, &vec![1.0; pairs.len()]).unwrap()
    }

    #[test]
    fn purity_is_the_share_of_the_commonest_label() {
        let partition = Partition::from_labels(&[0, 0, 0, 0, 1, 2]).unwrap();
        let labels = [Some(1), Some(1), Some(1), Some(2), Some(7), None];
        assert_eq!(purities(&partition, &labels).unwrap(), [Some(0.75), Some(1.0), None]);
        assert_eq!(oracle_accuracy(&partition, &labels).unwrap(), Some(0.8));
    }

    #[test]
    fn boundaries_that_are_off_are_met_within_the_tolerance() {
        // Labels change after nodes 2 and 6, segments after 3 and 9.
        let labels = [1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 3].map(Some);
        let partition = Partition::from_labels(&[0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 2, 2]).unwrap();
        let at = |hops| boundary_scores(&chain(12), &partition, &labels, hops).unwrap();
        let scores = |recall, precision| BoundaryScores { true_edges: 2, found_edges: 2, recall, precision };
        assert_eq!(at(0), scores(0.0, 0.0));
        assert_eq!(at(1), scores(0.5, 0.5), "edge 3-4 shares a node with 2-3");
        assert_eq!(at(2), scores(0.5, 0.5));
        assert_eq!(at(3), scores(1.0, 1.0), "edge 9-10 is two nodes beyond 6-7, edge 6-7 two beyond 3-4");
    }

    #[test]
    fn perfect_segments_meet_every_boundary_and_unknown_labels_do_not_count() {
        let partition = Partition::from_labels(&[0, 0, 1, 1, 2]).unwrap();
        let labels = [Some(0), Some(0), Some(1), Some(1), None];
        let scores = boundary_scores(&chain(5), &partition, &labels, 0).unwrap();
        assert_eq!(scores, BoundaryScores { true_edges: 1, found_edges: 1, recall: 1.0, precision: 1.0 });
        let none = boundary_scores(&chain(5), &partition, &[None; 5], 0).unwrap();
        assert_eq!((none.true_edges, none.found_edges), (0, 0));
        assert!(none.recall.is_nan() && none.precision.is_nan());
        assert!(boundary_scores(&chain(4), &partition, &labels, 0).is_err());
    }

    #[test]
    fn sizes_fall_into_powers_of_two() {
        let partition = Partition::from_labels(&[0, 1, 1, 2, 2, 2, 3, 3, 3, 3, 3]).unwrap();
        let bin = |from, segments, nodes| SizeBin { from, segments, nodes };
        assert_eq!(size_histogram(&partition), [bin(1, 1, 1), bin(2, 2, 5), bin(4, 1, 5)]);
        assert!(size_histogram(&Partition::from_labels(&[]).unwrap()).is_empty());
    }
}
