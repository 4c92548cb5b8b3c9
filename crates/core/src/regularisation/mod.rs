//! Neighbours agree: labellings of least energy.
//!
//! `costs of labels + Graph -> Labelling`. An [`Energy`] is what is minimised,
//!
//! `E(l) = Σ_i D_i(l_i) + strength · Σ_(i,j) w_ij V(l_i, l_j)`,
//!
//! where `D` are the costs of every label at every node, `w` the weights of the graph's edges and `V` the distance of two
//! labels: 1 for any two different ones (Potts), or a table. Labels may cost something themselves, once, if any node has
//! them.
//!
//! [`alpha_expansion`] is the one to take. [`alpha_beta_swap`] allows distances that are no metric,
//! [`iterated_conditional_modes`] and [`local_smoothing`] are faster and worse.

mod energy;
mod expansion;
mod hubs;
mod icm;
mod join;
mod kernel;
mod known;
mod local;
mod reduce;
mod search;
mod solve;
mod swap;

#[cfg(test)]
mod instance;

pub use energy::{Energy, Pairwise};
pub use expansion::{ExpansionParams, alpha_expansion};
pub use icm::{IcmParams, iterated_conditional_modes};
pub use local::local_smoothing;
pub use swap::{SwapParams, alpha_beta_swap};

/// A label for every node and what it costs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Labelling {
    /// Label of each node.
    pub labels: Vec<u16>,
    /// Energy of the labels.
    pub energy: f64,
    /// Energy after each round over all labels, beginning with that of the start (α-expansion of Potts costs: once the
    /// labels that are known without a search are in their places).
    pub trace: Vec<f64>,
    /// Whether the last round changed nothing; otherwise the rounds were used up.
    pub converged: bool,
}
