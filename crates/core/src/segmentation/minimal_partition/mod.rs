//! The minimal partition: approximates a signal on a graph by one that is constant on few connected segments.
//!
//! Landrieu & Obozinski 2017: minimise Σ_v m_v‖g_v − f_v‖² + ρ Σ_E w_ij [g_i ≠ g_j]; the segments are the connected
//! components on which g is constant. Guinard & Landrieu 2017 apply it to points, Li 2018 to supervoxels.

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
    Aim, Candidate, Intent, Method, PartitionInput, PartitionParams, StrengthSearch, Trial, partition_by_intent,
    search_strength,
};
pub use cut_pursuit::{CutPursuit, CutPursuitParams, CutPursuitSteps, Preset, cut_pursuit};
pub(super) use links::{Cost, EdgeLinks, contract};
pub use merge::{Merge, MergeParams, merge};
pub use recut::{ChosenSegments, recut};
pub use signal::Signal;
