//! Training: optimisers, schedules of the learning rate, checkpoints.

pub mod checkpoint;
mod optimiser;
mod schedule;

pub use optimiser::{Optimiser, OptimiserState};
pub use schedule::Schedule;
