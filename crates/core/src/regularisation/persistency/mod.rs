//! Persistency (partial optimality): nodes whose optimal label is known before any move.
//!
//! I. Kovtun, *Partial optimal labeling search for a NP-hard subclass of (max,+) problems*, DAGM 2003. For Potts
//! distances and one label α, give every other label the unary cost of the cheapest of them. The nodes that take α in
//! the minimum cut with the smallest source side of this two-label problem have α in every labelling of least energy,
//! and changing them to α never raises the energy of a labelling.

pub(super) mod reduced_problem;

use super::energy::Problem;
use super::moves::binary_move::{BinaryMove, State};
use super::moves::cuts::Components;
use crate::error::Result;
use crate::parallel::{Held, Looks, watched};

/// The persistent labels, and the two least costs of each node.
#[derive(Clone, Debug, Default)]
pub(super) struct PartialLabelling {
    /// The optimal label of each node where it is proved.
    pub(super) labels: Vec<Option<u16>>,
    least: Vec<TwoLeast>,
}

/// The cheapest label of a node, its cost, and the second least cost.
#[derive(Clone, Copy, Debug)]
struct TwoLeast {
    label: u16,
    first: f32,
    second: f32,
}

impl TwoLeast {
    fn of(costs: &[f32]) -> Self {
        let none = Self { label: 0, first: f32::INFINITY, second: f32::INFINITY };
        costs.iter().zip(0..).fold(none, |least, (&cost, label)| match cost < least.first {
            true => Self { label, first: cost, second: least.first },
            false => Self { second: least.second.min(cost), ..least },
        })
    }
}

impl PartialLabelling {
    /// Solves the two-label problem of every label, for 2 labels or more. O(labels · (nodes + edges)) and the cuts.
    pub(super) fn find(problem: &Problem<'_>) -> Result<Held<Self>> {
        let (energy, monitor) = (&problem.energy, problem.monitor);
        let mut least = Vec::with_capacity(energy.graph.len());
        for piece in watched(energy.graph.len(), monitor) {
            least.extend(piece?.map(|node| TwoLeast::of(&energy.unary[node * energy.labels..][..energy.labels])));
        }
        let mut partial = Held::new(Self { labels: vec![None; energy.graph.len()], least }, monitor);
        let mut binary = Held::new(BinaryMove::default(), monitor);
        let mut components = Held::new(Components::default(), monitor);
        monitor.stage("known labels", energy.labels as u64);
        for alpha in 0..energy.labels as u16 {
            binary.set_one_against_the_rest(problem, &partial, alpha)?;
            components.collect(&binary, problem)?;
            let taken = components.minimum_cuts(&binary, problem)?;
            let taken = taken.into_iter().chain(binary.settled(State::Takes));
            taken.for_each(|node| partial.labels[node as usize] = Some(alpha));
            monitor.advance(1);
        }
        Ok(partial)
    }

    /// The least unary cost of all labels but `alpha`.
    pub(super) fn least_but(&self, node: usize, alpha: u16) -> f64 {
        let TwoLeast { label, first, second } = self.least[node];
        f64::from(if label == alpha { second } else { first })
    }
}

impl BinaryMove {
    /// Sets up the two-label problem of persistency for `alpha` (Potts), where some labels are known already: the costs
    /// of all other labels are replaced by their minimum.
    ///
    /// # Errors
    /// If the work was cancelled.
    fn set_one_against_the_rest(&mut self, problem: &Problem<'_>, known: &PartialLabelling, alpha: u16) -> Result<()> {
        let (energy, monitor) = (&problem.energy, problem.monitor);
        let (nodes, mut looks) = (known.labels.len(), Looks::at(monitor));
        self.theta.clear();
        self.state.clear();
        for piece in watched(nodes, monitor) {
            let piece = piece?;
            self.theta.extend(piece.clone().map(|i| energy.cost(i, alpha) - known.least_but(i, alpha)));
            self.state.extend(piece.map(|i| known.labels[i].map_or(State::Open, |_| State::Stays)));
        }
        self.clear_edges(problem, nodes)?;
        let edges = energy.graph.edges().iter().zip(energy.graph.weights());
        for ((&[i, j], &weight), coupling) in edges.zip(&mut self.coupling) {
            looks.step()?;
            let (i, j) = (i as usize, j as usize);
            let cost = energy.strength * f64::from(weight);
            match (self.state[i], self.state[j]) {
                (State::Open, State::Open) => {
                    *coupling = cost;
                    self.slack[i] += cost;
                    self.slack[j] += cost;
                }
                (State::Open, _) => self.theta[i] += cost,
                (_, State::Open) => self.theta[j] += cost,
                _ => {}
            }
        }
        self.affected.clear();
        self.affected.resize(nodes, true);
        self.first_auxiliary = nodes;
        self.reduce(problem.adjacency, monitor)
    }
}
