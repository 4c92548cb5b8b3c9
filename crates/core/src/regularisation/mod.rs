//! Neighbours agree: labellings of least energy.
//!
//! `costs of labels + Graph -> Labelling`. An [`Energy`] is what is minimised,
//!
//! `E(l) = Σ_i D_i(l_i) + strength · Σ_(i,j) w_ij V(l_i, l_j)`,
//!
//! where `D` are the costs of every label at every node, `w` the weights of the graph's edges and `V` the distance of two
//! labels: 1 for any two different ones (Potts), or a table.

mod energy;
mod expansion;
mod local;
mod reduce;
mod solve;

pub use energy::{Energy, Pairwise};
pub use expansion::{ExpansionParams, alpha_expansion};
pub use local::local_smoothing;

/// A label for every node and what it costs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Labelling {
    /// Label of each node.
    pub labels: Vec<u16>,
    /// Energy of the labels.
    pub energy: f64,
    /// Energy after each round over all labels, beginning with that of the start.
    pub trace: Vec<f64>,
    /// Whether the last round changed nothing; otherwise the rounds were used up.
    pub converged: bool,
}
