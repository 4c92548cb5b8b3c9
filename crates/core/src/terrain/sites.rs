//! Separate sites: processes distant parts of a cloud one after the other, so that rasters cover the occupied ground
//! and not the bounding box of all parts.

use crate::cloud::{Points, Positions};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::voxels::cells::{Cells, cell_of};

/// Rasters with at least this many cells, and many cells a point, are divided.
const LARGE: f64 = 1e6;
const SPARSE: f64 = 64.0;

/// Edge of a tile in cells of the raster; adjacent tiles form one site.
const TILE: f64 = 128.0;

/// Computes values of all points by `work` on each site separately. A cloud whose raster is small or well filled is one
/// site.
///
/// # Errors
/// Those of `work`, or if it was cancelled.
pub(crate) fn by_site<T: Clone + Default>(
    points: &Points,
    cell: f64,
    monitor: &Monitor,
    work: impl Fn(&Points) -> Result<Vec<T>>,
) -> Result<Vec<T>> {
    let sites = sites(&points.positions, cell, monitor)?;
    if sites.len() < 2 {
        return work(points);
    }
    let mut values = vec![T::default(); points.len()];
    for site in sites {
        let found = work(&points.select(&site, monitor)?)?;
        site.iter().zip(found).for_each(|(&i, value)| values[i as usize] = value);
    }
    Ok(values)
}

/// The points of each site, ascending; empty if the cloud should not be divided.
fn sites(points: &Positions, cell: f64, monitor: &Monitor) -> Result<Vec<Vec<u32>>> {
    let size = [&points.x, &points.y].map(|axis| {
        let (low, high) = axis.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        (f64::from(high) - f64::from(low)) / cell + 1.0
    });
    let cells = size[0] * size[1];
    // Not divided either if the cell size is invalid, which the raster then reports.
    if !(cells > LARGE && cells > SPARSE * points.len() as f64 && cells.is_finite()) {
        return Ok(Vec::new());
    }
    let tile = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / (TILE * cell)));
    let tiles = Cells::new(points.len(), tile, monitor)?;
    let mut seen = vec![false; tiles.len()];
    let mut sites = Vec::new();
    for start in 0..tiles.len() {
        monitor.check()?;
        let mut open = if std::mem::replace(&mut seen[start], true) { continue } else { vec![start] };
        let mut site = Vec::new();
        while let Some(t) = open.pop() {
            site.extend_from_slice(tiles.of(t));
            for offset in (0..9).map(|i| [i % 3 - 1, i / 3 - 1]) {
                let near = [0, 1].map(|a| tiles.keys[t][a].saturating_add(offset[a]));
                match tiles.keys.binary_search(&near) {
                    Ok(found) if !std::mem::replace(&mut seen[found], true) => open.push(found),
                    _ => {}
                }
            }
        }
        site.sort_unstable();
        sites.push(site);
    }
    Ok(sites)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;
    use crate::terrain::{GroundParams, ground_points};

    #[test]
    fn a_few_points_and_one_far_away_are_sites_of_their_own() {
        let rows = [[0.0, 0.0, 0.0], [3.0, 1.0, 0.2], [7.0, 2.0, 4.0], [1e6, 0.0, 0.0]];
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let found = sites(&points.positions, 1.0, &Monitor::default()).unwrap();
        assert_eq!(found, [vec![0, 1, 2], vec![3]]);
        // A field of that size is one site.
        let field: Vec<[f64; 3]> =
            (0..20_000).map(|i| [f64::from(i % 200) * 10.0, f64::from(i / 200) * 10.0, 0.0]).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&field).unwrap(), 1.0);
        assert!(sites(&points.positions, 1.0, &Monitor::default()).unwrap().len() < 2);
    }

    #[test]
    fn two_sites_far_apart_have_the_ground_that_each_has_alone() {
        let mut s = stream(3, 8);
        let mut site = |east: f64| -> Vec<[f64; 3]> {
            let ground = (0..3000).map(|_| [east + s.uniform() * 40.0, s.uniform() * 40.0, 0.0]).collect::<Vec<_>>();
            ground.into_iter().chain((0..400).map(|i| [east + 10.0 + f64::from(i % 20) * 0.5, 12.0, 6.0])).collect()
        };
        let (a, b) = (site(0.0), site(60_000.0).into_iter().map(|p| [p[0], p[1] + 60_000.0, p[2]]).collect::<Vec<_>>());
        let ground = |rows: &[[f64; 3]]| {
            let points = Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0);
            ground_points(&points, &GroundParams::default(), &Monitor::default()).unwrap()
        };
        let alone = [ground(&a), ground(&b)].concat();
        assert_eq!(ground(&[a, b].concat()), alone);
        assert!(alone.contains(&true) && alone.contains(&false));
    }
}
