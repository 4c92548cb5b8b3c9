//! Comparing a result with the truth.

mod confusion;
mod partition;
pub mod report;
mod scores;

pub use confusion::Confusion;
pub use partition::{BoundaryScores, SizeBin, boundary_scores, oracle_accuracy, purities, size_histogram};
pub use scores::{ClassScores, Scores};
