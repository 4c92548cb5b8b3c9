//! αβ-swap: for one pair of labels after the other, the best redistribution of the two labels among the nodes that have
//! one of them.
//!
//! Y. Boykov, O. Veksler, R. Zabih, *Fast approximate energy minimization via graph cuts*, IEEE PAMI 23(11), 2001.
//! Distances of labels need not be a metric; in return there is no bound on the energy, and the work grows with the
//! square of the number of labels.

use super::energy::Problem;
use super::moves::binary_move::State;
use super::moves::move_making::{MoveMaking, Moves, Outcome};
use super::{Energy, Labelling, Pairwise};
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::{Looks, Monitor, sort_watched};
use serde::{Deserialize, Serialize};

/// Parameters of [`alpha_beta_swap`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SwapParams {
    /// Factor of the edge weights. Larger: fewer changes of label between neighbours. 0 or more.
    pub strength: f64,
    /// Distance of two labels, symmetric.
    pub pairwise: Pairwise,
    /// Largest number of rounds over all pairs of labels, 1 or more.
    pub max_rounds: usize,
}

impl Default for SwapParams {
    fn default() -> Self {
        Self { strength: 1.0, pairwise: Pairwise::Potts, max_rounds: 100 }
    }
}

impl SwapParams {
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

/// The labelling that no swap improves, from unary costs (`nodes x labels`, row-major) and a graph.
///
/// Starts from the cheapest label of every node, or from one label for all if that costs less. Returns a label for each
/// node and the energy after each round. Deterministic for any number of threads. A round is O(labels² · (nodes +
/// edges)) and the cuts.
///
/// ```
/// use scansion_core::graph::Graph;
/// use scansion_core::parallel::Monitor;
/// use scansion_core::regularisation::{SwapParams, alpha_beta_swap};
///
/// let graph = Graph::new(3, &[[0, 1], [1, 2]], &[1.0, 1.0])?;
/// let costs = [0.0, 1.0, 0.3, 0.0, 0.0, 1.0];
/// let smooth = alpha_beta_swap(&costs, &graph, &SwapParams::default(), &Monitor::default())?;
/// assert_eq!(smooth.labels, [0, 0, 0]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
///
/// # Errors
/// If lengths do not fit, a cost is not finite, the distances are not symmetric, a parameter is outside its range, or
/// the work was cancelled.
pub fn alpha_beta_swap(unary: &[f32], graph: &Graph, params: &SwapParams, monitor: &Monitor) -> Result<Labelling> {
    params.validate()?;
    let energy = Energy::new(unary, graph, params.strength, &params.pairwise)?;
    let adjacency = graph.adjacency_watched(monitor)?;
    let pairs = energy.labels * (energy.labels - 1) / 2;
    let problem = Problem { energy, adjacency: &adjacency, monitor };
    let mut search = MoveMaking::new(problem, energy.initial_labelling(monitor)?)?;
    let mut swaps = Moves::new(pairs, params.max_rounds);
    let converged = search.in_turn(&mut swaps, &mut swap_move)?;
    Ok(search.into_labelling(converged))
}

/// The pair of labels with a number: (0, 1), (0, 2), ..., (1, 2), ...
fn pair(number: usize, labels: usize) -> [u16; 2] {
    let (mut alpha, mut rest) = (0, number);
    while rest >= labels - 1 - alpha {
        rest -= labels - 1 - alpha;
        alpha += 1;
    }
    [alpha as u16, (alpha + 1 + rest) as u16]
}

/// The swap move of the pair of labels with a number.
fn swap_move(search: &mut MoveMaking<'_>, number: usize, since: u32) -> Result<Outcome> {
    let problem = search.problem;
    let pair = pair(number, problem.energy.labels);
    if !pair.iter().any(|&label| search.is_used(label)) {
        return Ok(Outcome::Nothing);
    }
    search.mark_affected(since);
    search.binary.set_swap(&problem, &search.labels, pair)?;
    search.components.collect(&search.binary, &problem)?;
    let takers = search.components.minimum_cuts(&search.binary, &problem)?;
    let [alpha, beta] = pair;
    // Nodes, and whether they take the first label. All nodes of the components are there, and the takers once more.
    let mut decided: Vec<(u32, bool)> = search.components.nodes().iter().map(|&node| (node, false)).collect();
    decided.extend(search.binary.settled(State::Stays).map(|node| (node, false)));
    decided.extend(search.binary.settled(State::Takes).chain(takers).map(|node| (node, true)));
    // The last entry of a node counts; nodes of other labels and nodes that keep their label are not moved.
    sort_watched(&mut decided, problem.monitor)?;
    let mut looks = Looks::at(problem.monitor);
    let mut moves: Vec<(u32, u16)> = Vec::new();
    for (node, takes) in decided {
        looks.step()?;
        let label = if takes { alpha } else { beta };
        match moves.last_mut().filter(|last| last.0 == node) {
            Some(last) => last.1 = label,
            None => moves.push((node, label)),
        }
    }
    let labels = &search.labels;
    moves.retain(|&(node, label)| pair.contains(&labels[node as usize]) && labels[node as usize] != label);
    search.apply(&moves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regularisation::ExpansionParams;
    use crate::regularisation::instance::{Instance, random};

    fn solve(instance: &Instance, params: &SwapParams) -> Labelling {
        let result = alpha_beta_swap(&instance.unary, &instance.graph, params, &Monitor::default()).unwrap();
        instance.verify(&same(params), &result);
        result
    }

    fn same(params: &SwapParams) -> ExpansionParams {
        let SwapParams { strength, pairwise, .. } = params.clone();
        ExpansionParams { strength, pairwise, ..ExpansionParams::default() }
    }

    #[test]
    fn two_labels_are_solved_exactly() {
        for seed in 0..80 {
            let instance = random(seed, 8, 2);
            let params = SwapParams { strength: 0.5, ..SwapParams::default() };
            assert_eq!(solve(&instance, &params).energy, instance.optimum(&same(&params)), "seed {seed}");
        }
    }

    #[test]
    fn no_single_swap_improves_the_result_even_without_a_metric() {
        // The distance of labels 0 and 2 violates the triangle inequality.
        let pairwise = Pairwise::Metric(vec![0.0, 1.0, 9.0, 1.0, 0.0, 1.5, 9.0, 1.5, 0.0]);
        for seed in 0..60 {
            let instance = random(seed, 8, 3);
            let params = SwapParams { pairwise: pairwise.clone(), ..SwapParams::default() };
            let result = solve(&instance, &params);
            let same = same(&params);
            let energy = instance.energy(&same);
            for ([alpha, beta], set) in
                [[0, 1], [0, 2], [1, 2]].into_iter().flat_map(|pair| (0..1u32 << 8).map(move |set| (pair, set)))
            {
                let share = |(i, &label): (usize, &u16)| match (label == alpha || label == beta, set >> i & 1 == 1) {
                    (true, true) => alpha,
                    (true, false) => beta,
                    (false, _) => label,
                };
                let other: Vec<u16> = result.labels.iter().enumerate().map(share).collect();
                assert!(energy.of(&other) >= result.energy - 1e-9, "seed {seed}, labels {alpha} and {beta}");
            }
        }
    }

    #[test]
    fn one_label_no_nodes_and_nonsense() {
        let graph = Graph::new(2, &[[0, 1]], &[1.0]).unwrap();
        let run = |unary: &[f32], graph: &Graph, params: &SwapParams| {
            alpha_beta_swap(unary, graph, params, &Monitor::default())
        };
        let one = run(&[0.5, 0.25], &graph, &SwapParams::default()).unwrap();
        assert!(one.converged && one.labels == [0, 0] && one.energy == 0.75);
        assert!(run(&[], &Graph::default(), &SwapParams::default()).unwrap().converged);
        let lopsided = Pairwise::Metric(vec![0.0, 1.0, 2.0, 0.0]);
        assert!(run(&[0.0; 4], &graph, &SwapParams { pairwise: lopsided, ..SwapParams::default() }).is_err());
        assert!(run(&[0.0; 4], &graph, &SwapParams { max_rounds: 0, ..SwapParams::default() }).is_err());
    }
}
