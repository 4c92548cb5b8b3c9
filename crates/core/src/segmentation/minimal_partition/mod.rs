//! The minimal partition: a signal on a graph, constant on few connected segments (documents 000 and 001).
//!
//! Landrieu and Obozinski 2017: minimise Σ_v m_v‖g_v − f_v‖² + ρ Σ_E w_ij [g_i ≠ g_j]; segments are the connected pieces on
//! which g is constant.

mod by_intent;
mod cut_pursuit;
mod cutoff;
mod links;
mod merge;
mod recut;
mod refine;
mod regions;
mod signal;

pub use by_intent::{
    Aim, Candidate, Intent, Method, PartitionParams, Scene, Search, Trial, partition_by_intent, search_strength,
};
pub use cut_pursuit::{CutPursuit, CutPursuitParams, Preset, cut_pursuit};
pub(super) use links::{Cost, EdgeLinks, contract};
pub use merge::{Merge, MergeParams, merge};
pub use recut::recut;
pub use signal::Signal;
