//! Lines by the simpler methods, at the scale of the cloud.

use super::ContoursRecipe;
use super::extract::{Contours, Place};
use super::scaled::Scale;
use crate::cloud::{Cloud, MetricCloud};
use crate::contours::baselines::{CannyParams, ThresholdParams, canny, threshold};
use crate::contours::{Likely, TangentParams, tangents};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// A simpler method to find contours, for comparison. Lengths are those for voxels of 0.1 m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Baseline {
    /// All points above a threshold.
    Threshold(ThresholdParams),
    /// An edge detector after J. Canny.
    Canny(CannyParams),
}

/// How lines are found by a simpler method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineParams {
    /// The method.
    pub method: Baseline,
    /// Edge of a voxel, metres; `None`: from the spacing of the points, as in the recipe.
    pub voxel: Option<f64>,
    /// Metres per unit of the coordinates; `None`: the cloud's own, else 1.
    pub metres_per_unit: Option<f64>,
}

/// Lines by a simpler method from a strength of each point, 0 to 1: a curvature, or a probability. O(n log n).
///
/// # Errors
/// If there is not one strength from 0 to 1 a point, the cloud has no points with finite coordinates, a parameter is outside its
/// range, or the work was cancelled.
pub fn baseline_contours(
    cloud: &Cloud,
    strengths: &[f32],
    params: &BaselineParams,
    monitor: &Monitor,
) -> Result<Contours> {
    if strengths.len() != cloud.len() {
        let found = format!("{} strengths for {} points", strengths.len(), cloud.len());
        return Err(Error::input(format!("{found} (allowed: one each)")));
    }
    let recipe = ContoursRecipe { voxel: params.voxel, ..ContoursRecipe::default() };
    recipe.check_voxel()?;
    let original = MetricCloud::new(cloud, params.metres_per_unit, monitor)?;
    let scale = Scale::of(&recipe, &original, monitor)?;
    let points = scale.scene(&original).some_points(monitor)?;
    let likelihoods: Vec<f32> = points.frame.index.iter().map(|&i| strengths[i as usize]).collect();
    let least = match &params.method {
        Baseline::Threshold(own) => own.least,
        Baseline::Canny(own) => own.low,
    };
    let own = TangentParams { least, ..TangentParams::default() };
    let tangents = tangents(&points.positions, &likelihoods, &own, monitor)?;
    let likely = Likely { positions: points.positions, likelihoods, tangents };
    let lines = match &params.method {
        Baseline::Threshold(own) => threshold(&likely, own, monitor)?,
        Baseline::Canny(own) => canny(&likely, own, monitor)?,
    };
    let place = Place { origin: points.frame.origin, scale };
    let lines = lines.iter().map(|line| place.drawn(line, None)).collect();
    Ok(Contours { lines, voxel: scale.voxel, points: likely.len(), ..Contours::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strong_row_of_points_is_a_line_at_any_scale() {
        for step in [0.01, 1.0] {
            let rows: Vec<[f64; 3]> =
                (0..2500).map(|i| [f64::from(i % 50) * step, f64::from(i / 50) * step, 0.0]).collect();
            let strengths: Vec<f32> = rows.iter().map(|row| if row[1] == 25.0 * step { 0.9 } else { 0.1 }).collect();
            let cloud = Cloud::from_rows(&rows).unwrap();
            for method in [Baseline::Threshold(Default::default()), Baseline::Canny(Default::default())] {
                let params = BaselineParams { method, voxel: None, metres_per_unit: None };
                let found = baseline_contours(&cloud, &strengths, &params, &Monitor::default()).unwrap();
                assert_eq!(found.lines.len(), 1, "{params:?}");
                assert!((found.lines[0].length - 49.0 * step).abs() < 2.0 * step);
                assert!(baseline_contours(&cloud, &[], &params, &Monitor::default()).is_err());
            }
        }
    }
}
