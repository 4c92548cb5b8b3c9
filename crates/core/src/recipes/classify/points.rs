//! The points of a cloud, as recipes use them.

use crate::cloud::{MetricCloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// The points of a cloud in metres.
///
/// # Errors
/// If no point has finite coordinates, or the work was cancelled.
pub(in crate::recipes) fn points_of(scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Points> {
    let points = scene.points(monitor)?;
    match points.is_empty() {
        true => Err(Error::input("the cloud has no point with finite coordinates")),
        false => Ok(points),
    }
}
