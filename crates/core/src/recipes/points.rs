//! The points of a cloud as recipes see them.

use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// Local coordinates of a cloud's points that are finite and not stray, metres; `metres` in one unit if somebody said so, else what the cloud says.
///
/// # Errors
/// If no point has finite coordinates, they are degrees, or the work was cancelled.
pub(super) fn points_of(cloud: &Cloud, metres: Option<f64>, monitor: &Monitor) -> Result<Points> {
    let points = Points::from_cloud_watched(cloud, cloud.metres(metres)?, monitor)?;
    match points.is_empty() {
        true => Err(Error::input("the cloud has no point with finite coordinates")),
        false => Ok(points),
    }
}

/// Keeps what is odd about clouds that are learned from, for the user.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn note_oddities<'a>(clouds: impl IntoIterator<Item = &'a Cloud>, monitor: &Monitor) -> Result<()> {
    for cloud in clouds {
        cloud.oddities(monitor)?.into_iter().for_each(|text| monitor.warn(text));
    }
    Ok(())
}
