//! Ground filter: finds the ground points from coordinates alone.

mod blur;
mod morphological;
mod params;
mod refined;
mod roofs;
#[cfg(test)]
mod tests;
mod window;

pub use params::{GroundMethod, GroundParams};

use super::sites::by_site;
use crate::cloud::{Points, Raster};
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, fill_parts};

/// Points of a block.
const BLOCK: usize = 16_384;

/// Classifies the ground points of a cloud by the simple morphological filter, as published or refined.
///
/// T. J. Pingel, K. C. Clarke, W. A. McBride, *An improved simple morphological filter for the terrain classification
/// of airborne LIDAR data*, ISPRS Journal 77, 2013, doi:10.1016/j.isprsjprs.2012.12.002. The lowest heights of the cells
/// are opened by larger and larger windows; a cell that an opening lowers by more than slope · reach of the window is an
/// object. The remaining cells are the ground, and points within threshold + scaling · slope of the ground are ground
/// points.
///
/// [`GroundMethod::Refined`] fills holes by a membrane, adds `relief` · slope of the terrain found so far to the slope
/// that is allowed, removes roofs wider than the window and cells that stand out from the averaged ground, and takes back
/// all cells that lie on the ground that remains, always by the same distance as for points. Returns true for each ground point.
/// O(n + cells · log²(window)).
///
/// # Errors
/// If there is no point, a parameter is out of range, the extent has too many cells, or the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, parallel::Monitor, terrain::ground_points};
///
/// let field = (0..1600).map(|i| [f64::from(i % 40), f64::from(i / 40), 0.0]);
/// let roof = (0..100).map(|i| [15.0 + f64::from(i % 10), 15.0 + f64::from(i / 10), 5.0]);
/// let rows: Vec<[f64; 3]> = field.filter(|p| p[0] < 15.0 || p[0] > 24.0 || p[1] < 15.0 || p[1] > 24.0).chain(roof).collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0);
/// let ground = ground_points(&points, &Default::default(), &Monitor::default())?;
/// assert!(ground.iter().zip(&rows).all(|(&ground, p)| ground == (p[2] == 0.0)));
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn ground_points(points: &Points, params: &GroundParams, monitor: &Monitor) -> Result<Vec<bool>> {
    params.validate()?;
    monitor.stage("ground", points.len() as u64);
    by_site(points, params.cell, monitor, |site| of_site(site, params, monitor))
}

fn of_site(points: &Points, params: &GroundParams, monitor: &Monitor) -> Result<Vec<bool>> {
    let lowest = lowest(points, params.cell, monitor)?;
    let surface = match params.method {
        GroundMethod::Morphological => morphological::bare(lowest, params, monitor)?,
        GroundMethod::Refined => refined::surface(lowest, params, monitor)?,
    };
    let steepness = steepness(&surface, monitor)?;
    let mut ground = vec![false; points.len()];
    fill_parts(&mut ground, BLOCK, monitor, |block, part| {
        monitor.advance(part.len() as u64);
        for (is_ground, i) in part.iter_mut().zip(block * BLOCK..) {
            let [x, y, _] = points.world(i);
            let above = f64::from(points.positions.z[i]) - surface.bilinear([x, y]);
            *is_ground = above.abs() <= params.tolerance(steepness[surface.cell_of([x, y])].into());
        }
    })?;
    Ok(ground)
}

/// The lowest height in each cell above the origin of the points; a hole where there is no point.
fn lowest(points: &Points, cell: f64, monitor: &Monitor) -> Result<Raster<f32>> {
    if points.is_empty() {
        return Err(Error::input("no points: the ground of an empty cloud is unknown"));
    }
    let Points { positions, frame } = points;
    let extreme = |pick: fn(f32, f32) -> f32, start: f32| {
        let of = |axis: &[f32]| axis.iter().fold(start, |m, &v| pick(m, v));
        [f64::from(of(&positions.x)) + frame.origin[0], f64::from(of(&positions.y)) + frame.origin[1]]
    };
    let mut raster = Raster::<f32>::over(extreme(f32::min, f32::INFINITY), extreme(f32::max, f32::NEG_INFINITY), cell)?;
    let mut looks = Looks::at(monitor);
    for i in 0..points.len() {
        looks.step()?;
        let [x, y, _] = points.world(i);
        let cell = raster.cell_of([x, y]);
        let height = &mut raster.values_mut()[cell];
        *height = height.min(positions.z[i]);
    }
    Ok(raster)
}

/// Slope (rise over run) at each cell, from differences of its neighbours.
fn steepness(raster: &Raster<f32>, monitor: &Monitor) -> Result<Vec<f32>> {
    let (rows, columns, z) = (raster.rows(), raster.columns(), raster.values());
    let difference = |a: usize, b: usize, steps: usize| match steps {
        0 => 0.0,
        _ => (f64::from(z[b]) - f64::from(z[a])) / (steps as f64 * raster.cell()),
    };
    let at = |r: usize, c: usize| {
        let (west, east) = (c.saturating_sub(1), (c + 1).min(columns - 1));
        let (south, north) = (r.saturating_sub(1), (r + 1).min(rows - 1));
        let x = difference(r * columns + west, r * columns + east, east - west);
        let y = difference(south * columns + c, north * columns + c, north - south);
        (x * x + y * y).sqrt() as f32
    };
    let mut slopes = vec![0.0; z.len()];
    fill_parts(&mut slopes, columns, monitor, |r, line| {
        line.iter_mut().zip((0..columns).map(|c| at(r, c))).for_each(|(slope, own)| *slope = own);
    })?;
    Ok(slopes)
}
