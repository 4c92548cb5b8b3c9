//! What belongs together: partitions of a cloud into segments.

mod connected;
mod cut_pursuit;
mod cutoff;
mod merge;
mod partition;
mod refine;
mod regions;
mod signal;

pub use connected::connected_partition;
pub use cut_pursuit::{CutPursuit, CutPursuitParams, Preset, Start, cut_pursuit};
pub use merge::{Merge, MergeParams, merge};
pub use partition::Partition;
pub use signal::Signal;
