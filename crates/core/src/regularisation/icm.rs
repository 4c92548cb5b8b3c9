//! Iterated conditional modes: node after node takes the label of least cost given the labels of its neighbours.
//!
//! J. Besag, *On the statistical analysis of dirty pictures*, Journal of the Royal Statistical Society B 48(3), 1986.
//! Fast, but stops in poor local minima; a baseline for comparison.

use super::energy::Problem;
use super::{Energy, Labelling, Pairwise};
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Number of nodes between two checks for cancellation.
const BLOCK: usize = 65536;

/// Parameters of [`iterated_conditional_modes`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IcmParams {
    /// Factor of the edge weights. Larger: fewer changes of label between neighbours. 0 or more.
    pub strength: f64,
    /// Distance of two labels, symmetric.
    pub pairwise: Pairwise,
    /// Largest number of rounds over all nodes, 1 or more.
    pub max_rounds: usize,
}

impl Default for IcmParams {
    fn default() -> Self {
        Self { strength: 1.0, pairwise: Pairwise::Potts, max_rounds: 100 }
    }
}

impl IcmParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        super::energy::check_strength(self.strength)?;
        match self.max_rounds {
            0 => Err(Error::parameter("max_rounds", 0, "1 or more")),
            _ => Ok(()),
        }
    }
}

/// The labelling that no change of a single node improves, from unary costs (`nodes x labels`, row-major) and a graph.
///
/// Starts from the cheapest label of every node and goes through the nodes in their order; a node changes only if that
/// lowers the energy. A round is O(labels · (nodes + edges)).
///
/// # Errors
/// If lengths do not fit, a cost is not finite, the distances are not symmetric, a parameter is outside its range, or
/// the work was cancelled.
pub fn iterated_conditional_modes(
    unary: &[f32],
    graph: &Graph,
    params: &IcmParams,
    monitor: &Monitor,
) -> Result<Labelling> {
    params.validate()?;
    let energy = Energy::new(unary, graph, params.strength, &params.pairwise)?;
    let adjacency = graph.adjacency_watched(monitor)?;
    let problem = Problem { energy, adjacency: &adjacency, monitor };
    let mut labels = energy.cheapest(monitor)?;
    let mut trace = vec![energy.of_watched(&labels, monitor)?];
    let mut costs = vec![0.0; energy.labels];
    let mut converged = false;
    monitor.stage("labels", params.max_rounds as u64);
    while !converged && trace.len() <= params.max_rounds {
        converged = true;
        for node in 0..labels.len() {
            if node % BLOCK == 0 {
                monitor.check()?;
            }
            let best = best_label(&problem, &labels, node, &mut costs);
            converged &= best == labels[node];
            labels[node] = best;
        }
        trace.push(energy.of_watched(&labels, monitor)?);
        monitor.advance(1);
    }
    let energy = trace.last().copied().unwrap_or_default();
    Ok(Labelling { labels, energy, trace, converged })
}

/// The label of least cost of a node given its neighbours; its current label if none costs less. `costs` receives the
/// cost of each label.
fn best_label(problem: &Problem<'_>, labels: &[u16], node: usize, costs: &mut [f64]) -> u16 {
    let energy = &problem.energy;
    for (label, cost) in costs.iter_mut().enumerate() {
        *cost = energy.cost(node, label as u16);
    }
    for (other, edge) in problem.adjacency.of(node) {
        for (label, cost) in costs.iter_mut().enumerate() {
            *cost += energy.edge_cost(edge as usize, label as u16, labels[other as usize]);
        }
    }
    let own = labels[node];
    (0..costs.len()).fold(own, |best, l| if costs[l] < costs[usize::from(best)] { l as u16 } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regularisation::instance::random;
    use crate::regularisation::{ExpansionParams, alpha_expansion};

    #[test]
    fn no_change_of_one_node_improves_the_result_and_expansion_is_at_least_as_good_on_the_whole() {
        let mut sums = [0.0; 2];
        for seed in 0..60 {
            let instance = random(seed, 30, 4);
            let same = ExpansionParams::default();
            let result = iterated_conditional_modes(
                &instance.unary,
                &instance.graph,
                &IcmParams::default(),
                &Monitor::default(),
            );
            let result = result.unwrap();
            instance.verify(&same, &result);
            let energy = instance.energy(&same);
            for (node, label) in (0..30).flat_map(|node| (0..4).map(move |label| (node, label))) {
                let mut other = result.labels.clone();
                other[node] = label;
                assert!(energy.of(&other) >= result.energy - 1e-9, "seed {seed}");
            }
            sums[0] += result.energy;
            sums[1] += alpha_expansion(&instance.unary, &instance.graph, &same, &Monitor::default()).unwrap().energy;
        }
        assert!(sums[1] < sums[0]);
    }

    #[test]
    fn nodes_that_hold_each_other_are_caught_where_an_expansion_is_not() {
        // Two nodes slightly prefer label 1, but the heavy edge keeps both at 0: neither improves the energy alone.
        let graph = Graph::new(3, &[[0, 1], [1, 2]], &[5.0, 1.0]).unwrap();
        let costs = [0.0, 0.1, 0.0, 0.1, 9.0, 0.0];
        let caught = iterated_conditional_modes(&costs, &graph, &IcmParams::default(), &Monitor::default()).unwrap();
        let free = alpha_expansion(&costs, &graph, &ExpansionParams::default(), &Monitor::default()).unwrap();
        assert_eq!((caught.labels, free.labels), (vec![0, 0, 1], vec![1, 1, 1]));
    }

    #[test]
    fn nonsense_is_refused() {
        let graph = Graph::new(2, &[[0, 1]], &[1.0]).unwrap();
        let run = |unary: &[f32], params: &IcmParams| {
            iterated_conditional_modes(unary, &graph, params, &Monitor::default()).map(|_| ())
        };
        assert!(run(&[0.0; 3], &IcmParams::default()).is_err());
        assert!(run(&[f32::INFINITY; 4], &IcmParams::default()).is_err());
        assert!(run(&[0.0; 4], &IcmParams { strength: f64::NAN, ..IcmParams::default() }).is_err());
    }
}
