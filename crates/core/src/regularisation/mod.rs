//! Regularisation: labellings of least energy, in which neighbouring nodes tend to have the same label.
//!
//! `costs of labels + Graph -> Labelling`. An [`Energy`] is what is minimised,
//!
//! `E(l) = Σ_i D_i(l_i) + strength · Σ_(i,j) w_ij V(l_i, l_j)`,
//!
//! where `D` is the unary cost of a label at a node, `w` the weight of an edge and `V` the distance of two labels: 1
//! for any two different ones (Potts), or a table. A label may also have a cost of its own, paid once if any node has
//! it.
//!
//! [`alpha_expansion`] gives the lowest energies and is the default. [`alpha_beta_swap`] accepts distances that are not
//! a metric; [`iterated_conditional_modes`] and [`local_smoothing`] are simpler, and their labellings are worse.

mod energy;
mod expansion;
mod icm;
mod local;
mod moves;
mod persistency;
mod swap;

#[cfg(test)]
mod instance;

pub use energy::{Energy, Pairwise};
pub use expansion::{ExpansionParams, alpha_expansion};
pub use icm::{IcmParams, iterated_conditional_modes};
pub use local::local_smoothing;
pub use swap::{SwapParams, alpha_beta_swap};

/// A label for every node, and the energy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Labelling {
    /// Label of each node.
    pub labels: Vec<u16>,
    /// Energy of the labelling.
    pub energy: f64,
    /// Energy after each round over all labels, beginning with the initial labelling (α-expansion with Potts distances:
    /// once the persistent labels are set).
    pub trace: Vec<f64>,
    /// True if the last round changed nothing; false if the largest number of rounds was reached.
    pub converged: bool,
}
