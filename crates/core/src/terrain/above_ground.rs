//! Heights of points above the ground that the ground filter finds.

use super::elevation::{ElevationParams, Ground, Holes, check_mask, heights_above_surface};
use super::ground_filter::{GroundParams, ground_points};
use super::sites::by_site;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// How the ground is found, and its model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeightParams {
    /// The ground filter.
    pub filter: GroundParams,
    /// The elevation model of the ground points.
    pub elevation: ElevationParams,
}

impl HeightParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        self.filter.validate()?;
        self.elevation.validate()
    }

    fn cell(&self) -> f64 {
        self.filter.cell.min(self.elevation.cell)
    }
}

/// What the ground filter finds of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointAboveGround {
    /// Its height above the ground, metres; negative below it.
    pub height: f32,
    /// Whether it is ground.
    pub is_ground: bool,
}

/// Height of every point above the ground, and whether it is ground. The ground is found by [`ground_points`], on each
/// site of a scattered cloud alone. O(n log n + cells).
///
/// # Errors
/// If there is no point, a parameter is out of range, or the work was cancelled.
pub fn points_above_ground(points: &Points, params: &HeightParams, monitor: &Monitor) -> Result<Vec<PointAboveGround>> {
    params.validate()?;
    by_site(points, params.cell(), monitor, |site| {
        let is_ground = ground_points(site, &params.filter, monitor)?;
        let ground = Ground { points: site, is_ground: &is_ground, params: &params.elevation, holes: Holes::Nearest };
        let heights = heights_above_surface(&ground, monitor)?;
        Ok(heights
            .into_iter()
            .zip(is_ground)
            .map(|(height, is_ground)| PointAboveGround { height, is_ground })
            .collect())
    })
}

/// The heights of [`points_above_ground`].
///
/// # Errors
/// As [`points_above_ground`].
pub fn filtered_heights(points: &Points, params: &HeightParams, monitor: &Monitor) -> Result<Vec<f32>> {
    Ok(points_above_ground(points, params, monitor)?.into_iter().map(|point| point.height).collect())
}

/// Height of every point above the points marked as ground, between which a membrane is stretched; a cloud without any has the
/// ground of the filter.
///
/// # Errors
/// As [`points_above_ground`].
pub fn heights_above(
    points: &Points,
    is_ground: &[bool],
    params: &HeightParams,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    check_mask(points.len(), is_ground)?;
    if !is_ground.contains(&true) {
        return filtered_heights(points, params, monitor);
    }
    let ground = Ground { points, is_ground, params: &params.elevation, holes: Holes::Membrane };
    match heights_above_surface(&ground, monitor) {
        // Too wide for one raster.
        Err(Error::InvalidParameter { .. }) => filtered_heights(points, params, monitor),
        found => found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    #[test]
    fn a_roof_has_its_height_above_a_slope() {
        let slope = |x: f64| 100.0 + 0.3 * x;
        let rows: Vec<[f64; 3]> = (0..3600)
            .map(|i| (f64::from(i % 60), f64::from(i / 60)))
            .map(|(x, y)| {
                [x, y, slope(x) + if (20.0..28.0).contains(&x) && (20.0..28.0).contains(&y) { 6.0 } else { 0.0 }]
            })
            .collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let (params, monitor) = (HeightParams::default(), Monitor::default());
        let found = filtered_heights(&points, &params, &monitor).unwrap();
        let both = points_above_ground(&points, &params, &monitor).unwrap();
        assert!(both.iter().map(|point| point.height).eq(found.iter().copied()));
        // No point of the roof is ground, and most others are: 3,536 in all.
        assert!(rows.iter().zip(&both).all(|(p, point)| !point.is_ground || p[2] - slope(p[0]) < 1.0));
        assert!(both.iter().filter(|point| point.is_ground).count() > 3200);
        let truth: Vec<bool> = rows.iter().map(|p| p[2] - slope(p[0]) < 1.0).collect();
        let given = heights_above(&points, &truth, &params, &monitor).unwrap();
        for ((p, found), given) in rows.iter().zip(found).zip(given) {
            let height = p[2] - slope(p[0]);
            let [found, given] = [found, given].map(|found| (f64::from(found) - height).abs());
            // A hole of 8 m with the height of its nearest border, and a membrane over it.
            assert!(found < 1.8 && given < 0.2, "{p:?} {found} {given}");
        }
        assert!(heights_above(&points, &[true], &params, &monitor).is_err());
    }
}
