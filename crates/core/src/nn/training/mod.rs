//! Training: optimisers, schedules of the learning rate.

mod optimiser;
mod schedule;

pub use optimiser::{Optimiser, OptimiserState};
pub use schedule::Schedule;
