//! Local smoothing: the weighted mean over the neighbours.

use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use rayon::prelude::*;

/// Replaces each node's row by the weighted mean of it and its neighbours' rows: p'(i) = (p(i) + Σ w_ij p(j)) / (1 + Σ
/// w_ij).
///
/// `probabilities` are row-major `nodes x classes`, and so is the result; rows that sum to 1 give rows that sum to 1.
/// Weights of 1 give the plain mean, a node without neighbours keeps its row. O((n + m) · classes). K. Schindler, *An
/// overview and comparison of smooth labeling methods for land-cover classification*, IEEE TGRS 50(11), 2012, section
/// III-A: the simplest of the methods compared there.
///
/// # Errors
/// If there is not one row a node, or the work was cancelled.
pub fn local_smoothing(probabilities: &[f32], classes: usize, graph: &Graph, monitor: &Monitor) -> Result<Vec<f32>> {
    if probabilities.len() != graph.len() * classes {
        return Err(Error::input(format!(
            "{} probabilities for {} nodes of {classes} classes",
            probabilities.len(),
            graph.len()
        )));
    }
    if classes == 0 {
        return Ok(Vec::new());
    }
    let adjacency = graph.adjacency_watched(monitor)?;
    let mut smooth = vec![0.0; probabilities.len()];
    smooth.par_chunks_mut(classes).enumerate().try_for_each(|(node, row)| {
        monitor.check()?;
        let range = adjacency.offsets[node]..adjacency.offsets[node + 1];
        let mut sum = probabilities[node * classes..][..classes].iter().map(|&p| f64::from(p)).collect::<Vec<_>>();
        let mut total = 1.0;
        for (&other, &edge) in adjacency.neighbours[range.clone()].iter().zip(&adjacency.edges[range]) {
            let weight = f64::from(graph.weights()[edge as usize]);
            total += weight;
            let theirs = &probabilities[other as usize * classes..][..classes];
            sum.iter_mut().zip(theirs).for_each(|(sum, &p)| *sum += weight * f64::from(p));
        }
        row.iter_mut().zip(&sum).for_each(|(p, sum)| *p = (sum / total) as f32);
        Ok(())
    })?;
    Ok(smooth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_takes_the_mean_of_itself_and_its_neighbours() {
        let graph = Graph::new(4, &[[0, 1], [1, 2]], &[1.0, 2.0]).unwrap();
        let rows = [1.0, 0.0, 0.5, 0.5, 0.0, 1.0, 0.3, 0.7];
        let smooth = local_smoothing(&rows, 2, &graph, &Monitor::default()).unwrap();
        let expected = [0.75, 0.25, 0.375, 0.625, 0.5 / 1.5, 1.0 - 0.5 / 1.5, 0.3, 0.7];
        for (found, expected) in smooth.iter().zip(expected) {
            assert!((found - expected as f32).abs() < 1e-6, "{smooth:?}");
        }
        assert!(local_smoothing(&rows, 3, &graph, &Monitor::default()).is_err());
    }
}
