//! Values averaged over neighbouring nodes, to reduce noise before the graph is coarsened.

use super::super::Signal;
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::{Looks, Monitor, watched};
use crate::segmentation::Partition;
use rayon::prelude::*;

/// Each pass averages over the adjacent nodes. Two passes reach some dozens of nodes: enough to average noise out, too
/// few to blur small objects.
const PASSES: usize = 2;

/// Most threads that share a pass: each of them reads all edges.
const MOST_SHARES: usize = 8;

/// The mean over each node and its neighbours in the same segment (edges of positive weight), applied twice. O(m ·
/// width); 8 bytes a value.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn smoothed(signal: &Signal, graph: &Graph, partition: &Partition, monitor: &Monitor) -> Result<Vec<f32>> {
    let width = signal.width();
    let segments = partition.segments();
    let inside = |[a, b]: [u32; 2]| segments[a as usize] == segments[b as usize];
    let mut values: Vec<f32> = Vec::with_capacity(signal.len() * width);
    for piece in watched(signal.len(), monitor) {
        values.extend(piece?.flat_map(|node| signal.row(node)));
    }
    // Every thread reads all edges and adds up the sums of its own nodes.
    let own = signal.len().div_ceil(rayon::current_num_threads().min(MOST_SHARES)).max(1);
    for _ in 0..PASSES {
        let mut means = vec![0.0f32; values.len()];
        means.par_chunks_mut(own * width).enumerate().try_for_each(|(share, means)| {
            let mut looks = Looks::at(monitor);
            let first = share * own;
            let mut totals = vec![0.0f32; means.len() / width];
            let mut add = |to: usize, from: usize| {
                let Some(total) = totals.get_mut(to.wrapping_sub(first)) else { return };
                let weight = signal.weight(from) as f32;
                *total += weight;
                let mean = &mut means[(to - first) * width..][..width];
                add_row(mean, &values[from * width..][..width], weight);
            };
            for node in first..(first + own).min(signal.len()) {
                looks.step()?;
                add(node, node);
            }
            // Edges are sorted, so that every node adds its neighbours in ascending order.
            for (&ends, &weight) in graph.edges().iter().zip(graph.weights()) {
                looks.step()?;
                if weight > 0.0 && inside(ends) {
                    let [a, b] = ends.map(|end| end as usize);
                    add(a, b);
                    add(b, a);
                }
            }
            let rows = means.chunks_exact_mut(width).zip(&totals);
            rows.for_each(|(row, total)| row.iter_mut().for_each(|m| *m /= total));
            Ok(())
        })?;
        values = means;
    }
    Ok(values)
}

/// mean += weight · row, with a special case of fixed length for four descriptors.
#[inline(always)]
fn add_row(mean: &mut [f32], row: &[f32], weight: f32) {
    match (mean.as_mut_array::<4>(), row.as_array::<4>()) {
        (Some(mean), Some(row)) => mean.iter_mut().zip(row).for_each(|(m, v)| *m += weight * v),
        _ => mean.iter_mut().zip(row).for_each(|(m, v)| *m += weight * v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_stay_within_segments_and_leave_out_edges_without_weight() {
        let signal = Signal::new(&[0.0, 3.0, 9.0, 5.0], 1).unwrap();
        let graph = Graph::new(4, &[[0, 1], [1, 2], [2, 3]], &[1.0, 1.0, 0.0]).unwrap();
        let partition = Partition::from_labels(&[0, 0, 1, 1]).unwrap();
        assert_eq!(smoothed(&signal, &graph, &partition, &Monitor::default()).unwrap(), [1.5, 1.5, 9.0, 5.0]);
        let whole = Partition::from_labels(&[0; 4]).unwrap();
        // After the first pass 1.5, 4, 6, 5; after the second:
        assert_eq!(smoothed(&signal, &graph, &whole, &Monitor::default()).unwrap()[..3], [2.75, 11.5 / 3.0, 5.0]);
    }
}
