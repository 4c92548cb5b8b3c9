//! Terrain model, surface model, their difference, and heights of points above ground.

use super::params::ProductParams;
use super::survey::Survey;
use super::triangulated::{Site, interpolate};
use crate::cloud::{MetricCloud, Raster};
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, sort_watched, watched};
use crate::terrain::ElevationModel;
use crate::terrain::holes::nearest_filled;
use crate::terrain::smooth::fill_holes;

/// The terrain model (DTM): heights of the ground, metres, over the extent of the survey's points.
///
/// The ground points of a cell are represented by their mean position and mean height; these are triangulated
/// (Delaunay), and the height of a cell is that of the triangulation at its centre. So planes are exact, also where
/// buildings leave holes. Cells outside the triangulation take their own mean height, or that of the nearest cell. Cells
/// farther than `reach` from a cell with ground points are holes (NaN). O(n log n + cells).
///
/// # Errors
/// If the extent has too many cells, a parameter is out of range, the memory does not suffice, or the work was
/// cancelled.
pub fn terrain_model(survey: &Survey, params: &ProductParams, monitor: &Monitor) -> Result<Raster> {
    params.validate()?;
    monitor.stage("terrain", 3);
    let mut raster = extent(survey, params.cell, monitor)?;
    let own = means(survey, &raster, monitor)?;
    let mut occupied = vec![false; raster.values().len()];
    own.iter().for_each(|&(cell, _)| occupied[cell as usize] = true);
    monitor.advance(1);
    interpolate(&mut raster, own.iter().map(|&(_, site)| site).collect(), monitor)?;
    monitor.advance(1);
    for &(cell, site) in &own {
        let value = &mut raster.values_mut()[cell as usize];
        if value.is_nan() {
            *value = site.height;
        }
    }
    let raster = limited(fill_holes(raster, monitor)?, &occupied, params.reach, monitor);
    monitor.advance(1);
    raster
}

/// The surface model (DSM): the highest point of each cell of the terrain model's raster, metres; cells without a point
/// are holes (NaN). O(n + cells).
///
/// # Errors
/// If the extent has too many cells, the cell is not above 0, or the work was cancelled.
pub fn surface_model(survey: &Survey, cell: f64, monitor: &Monitor) -> Result<Raster> {
    monitor.stage("surface", survey.points.len() as u64);
    let mut raster = extent(survey, cell, monitor)?;
    for piece in watched(survey.points.len(), monitor) {
        let piece = piece?;
        monitor.advance(piece.len() as u64);
        for i in piece {
            let [x, y, z] = survey.points.world(i);
            let at = raster.cell_of([x, y]);
            let highest = &mut raster.values_mut()[at];
            // `max` prefers a number to NaN.
            *highest = highest.max(z);
        }
    }
    Ok(raster)
}

/// The normalised surface (CHM over forests): surface minus terrain, not below 0, metres; a hole where either is one.
///
/// # Errors
/// If the rasters do not have the same cells.
pub fn normalised(surface: &Raster, terrain: &Raster) -> Result<Raster> {
    let shape = |r: &Raster| (r.origin(), r.cell(), r.columns(), r.rows());
    if shape(surface) != shape(terrain) {
        return Err(Error::input("surface and terrain are rasters of different cells"));
    }
    let above = |(s, t): (&f64, &f64)| if s.is_nan() || t.is_nan() { f64::NAN } else { (s - t).max(0.0) };
    let values = surface.values().iter().zip(terrain.values()).map(above).collect();
    Ok(surface.clone().with_values(values))
}

/// Height above ground of every point of the cloud, in its order, metres: above the terrain model without a limit of
/// its reach, bilinear between the centres of cells. NaN for points whose coordinates are not finite. O(n log n +
/// cells).
///
/// # Errors
/// As [`terrain_model`].
pub fn heights_above_ground(
    scene: &MetricCloud<'_>,
    survey: &Survey,
    params: &ProductParams,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    let whole = ProductParams { reach: f64::INFINITY, ..params.clone() };
    let model = ElevationModel::from_raster(terrain_model(survey, &whole, monitor)?, monitor)?;
    let points = scene.points_and_strays(monitor)?;
    let found = model.heights(&points, monitor)?;
    let mut heights = vec![f32::NAN; scene.cloud.len()];
    points.frame.index.iter().zip(found).for_each(|(&i, height)| heights[i as usize] = height);
    Ok(heights)
}

/// Share of a cell by which a point may lie beyond the last cell, into which it then counts.
const BEYOND: f64 = 1e-6;

/// A raster of holes over all points. Points on its eastern and northern border are in the last cells, so that a tile of
/// 1000 m has 1000 cells and not 1001.
fn extent(survey: &Survey, cell: f64, monitor: &Monitor) -> Result<Raster> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for piece in watched(survey.points.len(), monitor) {
        for i in piece? {
            let at = survey.points.world(i);
            for a in 0..2 {
                low[a] = low[a].min(at[a]);
                high[a] = high[a].max(at[a]);
            }
        }
    }
    let last = [0, 1].map(|a| (high[a] / cell - BEYOND).ceil() - 1.0);
    let inside = [0, 1].map(|a| if last[a] > (low[a] / cell).floor() { (last[a] + 0.5) * cell } else { low[a] });
    Raster::over(low, inside, cell)
}

/// Mean position and mean height of the ground points of each cell that has some, by cell.
fn means(survey: &Survey, raster: &Raster, monitor: &Monitor) -> Result<Vec<(u32, Site)>> {
    let (origin, cell) = (raster.origin(), raster.cell());
    let mut keys: Vec<(u32, u32)> = Vec::new();
    for piece in watched(survey.points.len(), monitor) {
        for i in piece?.filter(|&i| survey.is_ground[i]) {
            let [x, y, _] = survey.points.world(i);
            keys.push((raster.cell_of([x, y]) as u32, i as u32));
        }
    }
    sort_watched(&mut keys, monitor)?;
    let mut looks = Looks::at(monitor);
    let mut sites = Vec::new();
    for group in keys.chunk_by(|a, b| a.0 == b.0) {
        looks.steps(group.len())?;
        let mut sum = [0.0; 3];
        for &(_, i) in group {
            let at = survey.points.world(i as usize);
            let place = [0, 1].map(|a| (at[a] - origin[a]) / cell - 0.5);
            [place[0], place[1], at[2]].iter().zip(&mut sum).for_each(|(v, sum)| *sum += v);
        }
        let [x, y, height] = sum.map(|v| v / group.len() as f64);
        sites.push((group[0].0, Site { at: [x, y], height }));
    }
    Ok(sites)
}

/// Removes the heights of cells farther than `reach` from the nearest occupied cell.
fn limited(raster: Raster, occupied: &[bool], reach: f64, monitor: &Monitor) -> Result<Raster> {
    let (columns, most) = (raster.columns(), reach / raster.cell());
    if most >= columns.max(raster.rows()) as f64 * 2.0 {
        return Ok(raster);
    }
    let nearest = nearest_filled(occupied, columns, monitor)?;
    let apart = |i: usize, j: usize| {
        let [dx, dy] = [(i % columns).abs_diff(j % columns), (i / columns).abs_diff(j / columns)];
        (dx as f64).hypot(dy as f64)
    };
    let near = |(i, &value): (usize, &f64)| if apart(i, nearest[i] as usize) > most { f64::NAN } else { value };
    let values = raster.values().iter().enumerate().map(near).collect();
    Ok(raster.with_values(values))
}
