//! Comparing a result with the truth.

mod confusion;
pub mod report;
mod scores;

pub use confusion::Confusion;
pub use scores::{ClassScores, Scores};
