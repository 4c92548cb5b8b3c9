//! The refined filter: the slope of a first terrain decides again which cells are objects, and cells that lie on the
//! resulting ground come back.

use super::GroundParams;
use super::blur::blurred;
use super::morphological::prominence;
use super::roofs::without_roofs;
use super::steepness;
use crate::cloud::Raster;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::terrain::membrane::membrane;

/// Cells on either side over which the terrain is averaged (twice) for its slope.
const AROUND: usize = 4;
/// Cells on either side over which the ground is averaged (twice) to find what stands out from it.
const NEAR: usize = 1;
/// Slope of the terrain above which objects are told from ground as on this slope.
const STEEPEST: f64 = 1.0;

/// The height of the ground at every cell, from the lowest heights (with holes).
pub(super) fn surface(lowest: Raster<f32>, params: &GroundParams, monitor: &Monitor) -> Result<Raster<f32>> {
    let most = prominence(membrane(lowest.clone(), monitor)?, params.window, monitor)?;
    let terrain = membrane(kept(&lowest, &most, |_| params.slope), monitor)?;
    let around = steepness(&blurred(terrain, AROUND, monitor)?, monitor)?;
    let ground = kept(&lowest, &most, |i| params.slope + params.relief * f64::from(around[i]).min(STEEPEST));
    drop((most, around));
    let ground = without_roofs(ground, params, monitor)?;
    let ground = membrane(without_bumps(ground, params, monitor)?, monitor)?;
    membrane(on_ground(lowest, &ground, params, monitor)?, monitor)
}

/// The heights of cells that no opening lowers by more than the slope of the cell; all heights if there is no such cell.
fn kept(lowest: &Raster<f32>, most: &[f32], slope: impl Fn(usize) -> f64) -> Raster<f32> {
    let values = lowest.values().iter().zip(most).enumerate();
    let kept: Vec<f32> = values.map(|(i, (&z, &most))| if f64::from(most) > slope(i) { f32::NAN } else { z }).collect();
    match kept.iter().all(|z| z.is_nan()) {
        true => lowest.clone(),
        false => Raster::of(lowest, kept),
    }
}

/// Without the cells that stand out from the averaged ground: vegetation and remains of walls.
fn without_bumps(mut ground: Raster<f32>, params: &GroundParams, monitor: &Monitor) -> Result<Raster<f32>> {
    let average = blurred(membrane(ground.clone(), monitor)?, NEAR, monitor)?;
    let slope = steepness(&average, monitor)?;
    let above = ground.values_mut().iter_mut().zip(average.values().iter().zip(&slope));
    let stands_out =
        |z: f32, average: f32, slope: f32| f64::from(z) - f64::from(average) > params.tolerance(slope.into());
    above.filter(|(z, (a, slope))| stands_out(**z, **a, **slope)).for_each(|(z, _)| *z = f32::NAN);
    Ok(ground)
}

/// All cells whose lowest height lies on the ground, those too that were taken for objects: edges of steep terrain.
fn on_ground(
    mut lowest: Raster<f32>,
    ground: &Raster<f32>,
    params: &GroundParams,
    monitor: &Monitor,
) -> Result<Raster<f32>> {
    let slope = steepness(ground, monitor)?;
    for (z, (g, slope)) in lowest.values_mut().iter_mut().zip(ground.values().iter().zip(slope)) {
        if (f64::from(*z) - f64::from(*g)).abs() > params.tolerance(slope.into()) {
            *z = f32::NAN;
        }
    }
    Ok(lowest)
}
