//! Values averaged over the graph, to tell which nodes belong together in spite of noise.

use super::super::Signal;
use crate::graph::{Adjacency, Graph};
use crate::segmentation::Partition;
use rayon::prelude::*;

/// Each pass averages over the nodes one hop away: two reach some dozens of nodes, as many as average noise out but
/// too few to wash small objects away.
const PASSES: usize = 2;

/// Means over each node and its neighbours in the same segment (over edges of positive weight), twice.
/// O(m · width).
pub(super) fn smoothed(signal: &Signal, (graph, adjacency): (&Graph, &Adjacency), partition: &Partition) -> Vec<f32> {
    let width = signal.width();
    let segments = partition.segments();
    let mut values: Vec<f32> = (0..signal.len()).flat_map(|node| signal.row(node)).copied().collect();
    for _ in 0..PASSES {
        let mut means = vec![0.0; values.len()];
        means.par_chunks_mut(width).enumerate().for_each(|(node, mean)| {
            let near = adjacency.of(node).filter(|&(other, edge)| {
                segments[other as usize] == segments[node] && graph.weights()[edge as usize] > 0.0
            });
            let mut total = 0.0;
            for other in std::iter::once(node).chain(near.map(|(other, _)| other as usize)) {
                let weight = signal.weight(other) as f32;
                total += weight;
                mean.iter_mut().zip(&values[other * width..]).for_each(|(m, v)| *m += weight * v);
            }
            mean.iter_mut().for_each(|m| *m /= total);
        });
        values = means;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_stay_within_segments_and_leave_out_edges_without_weight() {
        let signal = Signal::new(&[0.0, 3.0, 9.0, 5.0], 1).unwrap();
        let graph = Graph::new(4, &[[0, 1], [1, 2], [2, 3]], &[1.0, 1.0, 0.0]).unwrap();
        let partition = Partition::from_labels(&[0, 0, 1, 1]).unwrap();
        assert_eq!(smoothed(&signal, (&graph, &graph.adjacency()), &partition), [1.5, 1.5, 9.0, 5.0]);
        let whole = Partition::from_labels(&[0; 4]).unwrap();
        // First 1.5, 4, 6, 5; then:
        assert_eq!(smoothed(&signal, (&graph, &graph.adjacency()), &whole)[..3], [2.75, 11.5 / 3.0, 5.0]);
    }
}
