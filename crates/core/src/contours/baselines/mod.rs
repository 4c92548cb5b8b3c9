//! Simpler methods to find contours, for comparison: a threshold, and an edge detector after J. Canny.
//!
//! Both take a strength of each point, such as a curvature or a measure of boundaries scaled to 0..1, in place of the
//! likelihood, and link neighbouring points to lines without candidates and without a random field.

mod canny;
mod linked;
mod threshold;

pub use canny::{CannyParams, canny};
pub use linked::LinkedParams;
pub use threshold::{ThresholdParams, threshold};
