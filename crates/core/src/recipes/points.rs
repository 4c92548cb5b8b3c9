//! The points of a cloud, as recipes use them.

use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// Local coordinates in metres of a cloud's points that are finite and not stray; `metres` per unit if given, else what
/// the cloud says.
///
/// # Errors
/// If no point has finite coordinates, the coordinates are degrees, or the work was cancelled.
pub(super) fn points_of(cloud: &Cloud, metres: Option<f64>, monitor: &Monitor) -> Result<Points> {
    let points = Points::from_cloud_watched(cloud, cloud.metres(metres)?, monitor)?;
    match points.is_empty() {
        true => Err(Error::input("the cloud has no point with finite coordinates")),
        false => Ok(points),
    }
}

/// Records warnings about the clouds used for training.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn note_oddities<'a>(clouds: impl IntoIterator<Item = &'a Cloud>, monitor: &Monitor) -> Result<()> {
    for cloud in clouds {
        cloud.oddities(monitor)?.into_iter().for_each(|text| monitor.warn(text));
    }
    Ok(())
}
