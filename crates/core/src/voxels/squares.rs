//! The squares in plan that hold points: the ground that a scan covers, and its density.

use super::cells::cell_of;
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, sort_watched};

/// Edge in metres of the squares by which covered ground is measured.
const EDGE: f64 = 2.0;

/// Points per occupied square metre, measured on squares of 2 m. 0 if there is no point. O(n log n), 8 temporary bytes
/// a point.
///
/// # Errors
/// If the work was cancelled.
pub fn planar_density(points: &Positions, monitor: &Monitor) -> Result<f64> {
    let area = covered_area(points, monitor)?;
    Ok(if area > 0.0 { points.len() as f64 / area } else { 0.0 })
}

/// Area in plan that holds points, in m²: that of the occupied squares of 2 m. O(n log n), 8 temporary bytes a point.
///
/// # Errors
/// If the work was cancelled.
pub(crate) fn covered_area(points: &Positions, monitor: &Monitor) -> Result<f64> {
    let square = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / EDGE));
    let mut squares = map_watched(points.len(), monitor, square)?;
    sort_watched(&mut squares, monitor)?;
    squares.dedup();
    Ok(squares.len() as f64 * (EDGE * EDGE))
}
