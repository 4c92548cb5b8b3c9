//! The points of a cloud as recipes see them.

use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};

/// Local coordinates of a cloud's finite points, metres; `metres` in one unit if somebody said so, else what the cloud says.
///
/// # Errors
/// If no point has finite coordinates.
pub(super) fn points_of(cloud: &Cloud, metres: Option<f64>) -> Result<Points> {
    let points = Points::from_cloud(cloud, metres.or(cloud.metres_per_unit).unwrap_or(1.0));
    match points.is_empty() {
        true => Err(Error::input("the cloud has no point with finite coordinates")),
        false => Ok(points),
    }
}
