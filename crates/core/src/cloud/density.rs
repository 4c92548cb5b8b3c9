//! Density of a scan as seen from above.

use super::{Cloud, Points};
use crate::error::Result;
use crate::parallel::{Monitor, sort_watched, watched};

/// Points per occupied square metre, measured on cells of 2 m. 0 for an empty cloud.
///
/// # Errors
/// If the work was cancelled.
pub fn planar_density(cloud: &Cloud, metres: f64, monitor: &Monitor) -> Result<f64> {
    let points = Points::from_cloud_watched(cloud, metres, monitor)?;
    let cell = |v: f32| (v / 2.0).floor() as i32;
    let mut cells: Vec<(i32, i32)> = Vec::with_capacity(points.len());
    for piece in watched(points.len(), monitor) {
        cells.extend(piece?.map(|i| (cell(points.positions.x[i]), cell(points.positions.y[i]))));
    }
    let n = cells.len();
    sort_watched(&mut cells, monitor)?;
    cells.dedup();
    Ok(if cells.is_empty() { 0.0 } else { n as f64 / (4.0 * cells.len() as f64) })
}
