//! Local smoothing: every node takes the mean of the probabilities around it.
//!
//! Schindler, *An overview and comparison of smooth labeling methods for land-cover classification*, IEEE TGRS 50(11), 2012.

use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::{Monitor, map_ordered};
use serde::{Deserialize, Serialize};

/// Nodes that are smoothed in one go.
const BLOCK: usize = 8192;

/// Parameters of [`local_smoothing`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocalParams {
    /// Weight of the node itself; an edge counts with its own weight. 0 or more.
    pub own_weight: f64,
    /// How often, each time from what came out before; 1 or more.
    pub rounds: usize,
}

impl Default for LocalParams {
    fn default() -> Self {
        Self { own_weight: 1.0, rounds: 1 }
    }
}

impl LocalParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.own_weight >= 0.0 && self.own_weight.is_finite()) {
            return Err(Error::parameter("own_weight", self.own_weight, "0 or more, finite"));
        }
        match self.rounds {
            0 => Err(Error::parameter("rounds", 0, "1 or more")),
            _ => Ok(()),
        }
    }
}

/// Probabilities (`nodes x classes`, row-major) as the weighted mean of each node's own and those of its neighbours.
///
/// Rows that sum to 1 still do; a node without any weight keeps its row. O(rounds · classes · (nodes + edges)), in parallel,
/// the same bytes for any number of threads.
///
/// ```
/// use scansion_core::graph::Graph;
/// use scansion_core::parallel::Monitor;
/// use scansion_core::regularisation::{LocalParams, local_smoothing, most_probable};
///
/// let graph = Graph::new(3, &[[0, 1], [1, 2]], &[1.0, 1.0])?;
/// let smooth = local_smoothing(&[0.9, 0.1, 0.4, 0.6, 0.8, 0.2], &graph, &LocalParams::default(), &Monitor::default())?;
/// assert_eq!(most_probable(&smooth, 2), [0, 0, 0]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
///
/// # Errors
/// Lengths that do not fit, probabilities that are not finite, a parameter outside its range, cancellation.
pub fn local_smoothing(
    probabilities: &[f32],
    graph: &Graph,
    params: &LocalParams,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    params.validate()?;
    let classes = probabilities.len().checked_div(graph.len()).unwrap_or(0);
    if probabilities.len() != classes * graph.len() || (classes == 0 && !graph.is_empty()) {
        return Err(Error::input(format!(
            "{} probabilities are not rows for {} nodes",
            probabilities.len(),
            graph.len()
        )));
    }
    if let Some(found) = probabilities.iter().find(|p| !p.is_finite()) {
        return Err(Error::input(format!("probability {found} is not finite")));
    }
    let adjacency = graph.adjacency();
    let mut rows = probabilities.to_vec();
    monitor.stage("smoothing", params.rounds as u64);
    for _ in 0..params.rounds {
        let smooth = |node: usize, sum: &mut Vec<f64>| {
            let of = |at: usize| rows[at * classes..(at + 1) * classes].iter();
            sum.clear();
            sum.extend(of(node).map(|p| params.own_weight * f64::from(*p)));
            let mut total = params.own_weight;
            for (other, edge) in adjacency.of(node) {
                let weight = f64::from(graph.weights()[edge as usize]);
                total += weight;
                sum.iter_mut().zip(of(other as usize)).for_each(|(s, p)| *s += weight * f64::from(*p));
            }
            let mean = |(s, own): (&f64, &f32)| if total > 0.0 { (s / total) as f32 } else { *own };
            sum.iter().zip(of(node)).map(mean).collect::<Vec<f32>>()
        };
        let blocks = map_ordered(graph.len().div_ceil(BLOCK), monitor, |block| {
            let mut sum = Vec::with_capacity(classes);
            let nodes = block * BLOCK..((block + 1) * BLOCK).min(graph.len());
            Ok(nodes.flat_map(|node| smooth(node, &mut sum)).collect::<Vec<f32>>())
        })?;
        rows = blocks.concat();
        monitor.advance(1);
    }
    Ok(rows)
}

/// The class with the largest probability of every row, the first of equals; `classes` is the length of a row.
pub fn most_probable(probabilities: &[f32], classes: usize) -> Vec<u16> {
    let best = |row: &[f32]| (1..row.len()).fold(0, |best, l| if row[l] > row[best] { l } else { best }) as u16;
    probabilities.chunks_exact(classes.max(1)).map(best).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_weighted_by_the_edges() {
        let graph = Graph::new(4, &[[0, 1], [1, 2]], &[2.0, 1.0]).unwrap();
        let rows = [1.0, 0.0, 0.25, 0.75, 0.0, 1.0, 0.5, 0.5];
        let params = LocalParams { own_weight: 4.0, rounds: 1 };
        let smooth = local_smoothing(&rows, &graph, &params, &Monitor::default()).unwrap();
        // Node 0: (4·1 + 2·0.25)/6; node 1: (4·0.25 + 2·1 + 1·0)/7; node 2: 0.25/5; node 3 is alone.
        let expected = [0.75, 3.0 / 7.0, 0.05, 0.5];
        for (row, first) in smooth.chunks(2).zip(expected) {
            assert!((row[0] - first).abs() < 1e-6 && (row[0] + row[1] - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn many_rounds_lead_to_one_row_for_each_component() {
        let graph = Graph::new(4, &[[0, 1], [1, 2], [0, 2]], &[1.0; 3]).unwrap();
        let params = LocalParams { rounds: 50, ..LocalParams::default() };
        let smooth = local_smoothing(&[1.0, 0.0, 0.5, 0.7], &graph, &params, &Monitor::default()).unwrap();
        assert!(smooth[..3].iter().all(|p| (p - 0.5).abs() < 1e-6));
        assert_eq!(smooth[3], 0.7);
    }

    #[test]
    fn a_node_without_weight_keeps_its_row_and_nonsense_is_refused() {
        let graph = Graph::new(2, &[[0, 1]], &[0.0]).unwrap();
        let params = LocalParams { own_weight: 0.0, rounds: 1 };
        let run = |rows: &[f32], params: &LocalParams| local_smoothing(rows, &graph, params, &Monitor::default());
        assert_eq!(run(&[0.25, 0.75], &params).unwrap(), [0.25, 0.75]);
        assert!(run(&[0.25, 0.75, 1.0], &params).is_err());
        assert!(run(&[], &params).is_err());
        assert!(run(&[f32::NAN, 0.0], &params).is_err());
        assert!(run(&[0.0, 0.0], &LocalParams { rounds: 0, ..params.clone() }).is_err());
        assert!(run(&[0.0, 0.0], &LocalParams { own_weight: -1.0, ..params }).is_err());
        assert!(
            local_smoothing(&[], &Graph::default(), &LocalParams::default(), &Monitor::default()).unwrap().is_empty()
        );
    }
}
