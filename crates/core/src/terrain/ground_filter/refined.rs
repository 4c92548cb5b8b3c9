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
pub(super) fn surface(lowest: &Raster, params: &GroundParams, monitor: &Monitor) -> Result<Raster> {
    let most = prominence(membrane(lowest.clone(), monitor)?, params.window, monitor)?;
    let terrain = membrane(kept(lowest, &most, |_| params.slope), monitor)?;
    let around = steepness(&blurred(terrain, AROUND, monitor)?, monitor)?;
    let ground = kept(lowest, &most, |i| params.slope + params.relief * around[i].min(STEEPEST));
    drop((most, around));
    let ground = without_roofs(ground, params, monitor)?;
    let ground = membrane(without_bumps(ground, params, monitor)?, monitor)?;
    membrane(on_ground(lowest, &ground, params, monitor)?, monitor)
}

/// The heights of cells that no opening lowers by more than the slope of the cell; all heights if there is no such cell.
fn kept(lowest: &Raster, most: &[f64], slope: impl Fn(usize) -> f64) -> Raster {
    let values = lowest.values().iter().zip(most).enumerate();
    let kept: Vec<f64> = values.map(|(i, (&z, most))| if *most > slope(i) { f64::NAN } else { z }).collect();
    match kept.iter().all(|z| z.is_nan()) {
        true => lowest.clone(),
        false => Raster::of(lowest, kept),
    }
}

/// Without the cells that stand out from the averaged ground: vegetation and remains of walls.
fn without_bumps(mut ground: Raster, params: &GroundParams, monitor: &Monitor) -> Result<Raster> {
    let average = blurred(membrane(ground.clone(), monitor)?, NEAR, monitor)?;
    let slope = steepness(&average, monitor)?;
    let above = ground.values_mut().iter_mut().zip(average.values().iter().zip(&slope));
    above.filter(|(z, (a, slope))| **z - **a > params.tolerance(**slope)).for_each(|(z, _)| *z = f64::NAN);
    Ok(ground)
}

/// All cells whose lowest height lies on the ground, those too that were taken for objects: edges of steep terrain.
fn on_ground(lowest: &Raster, ground: &Raster, params: &GroundParams, monitor: &Monitor) -> Result<Raster> {
    let slope = steepness(ground, monitor)?;
    let apart = lowest.values().iter().zip(ground.values().iter().zip(&slope));
    let on = apart.map(|(&z, (g, slope))| if (z - g).abs() > params.tolerance(*slope) { f64::NAN } else { z });
    Ok(Raster::of(lowest, on.collect()))
}
