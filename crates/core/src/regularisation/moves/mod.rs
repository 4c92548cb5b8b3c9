//! Moves: a labelling is improved by changes of many nodes at once, of which the best is found by minimum cuts.

pub(super) mod binary_move;
pub(super) mod cuts;
mod fusion;
pub(super) mod label_costs;
pub(super) mod move_making;
