//! Ground filter: finds the ground points from coordinates alone.

use super::elevation::{ElevationModel, ElevationParams};
use super::sites::by_site;
use super::window::Window;
use crate::cloud::Points;
use crate::cloud::Raster;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, concat_watched, map_ordered};
use serde::{Deserialize, Serialize};

/// Points of a block.
const BLOCK: usize = 16_384;

/// A cell lower than the closing of its surroundings by more than this many cell edges is noise.
const PIT: f64 = 5.0;

/// Parameters of [`ground_points`]; the defaults are those of Pingel et al. 2013.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GroundParams {
    /// Edge of a cell, metres; above 0.
    pub cell: f64,
    /// Slope of the steepest ground, rise over run; 0 or more.
    pub slope: f64,
    /// Half the width of the widest object, metres; at least a cell.
    pub window: f64,
    /// Largest distance of ground points from the height of the ground where it is level, metres; above 0.
    pub threshold: f64,
    /// Additional distance per unit of slope, metres; 0 or more.
    pub scaling: f64,
}

impl Default for GroundParams {
    fn default() -> Self {
        Self { cell: 1.0, slope: 0.15, window: 18.0, threshold: 0.5, scaling: 1.25 }
    }
}

impl GroundParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |name, value: f64, expected: &str| Err(Error::parameter(name, value, expected));
        match self {
            Self { cell, .. } if !(*cell > 0.0 && cell.is_finite()) => wrong("cell", *cell, "metres, above 0"),
            Self { slope, .. } if !(*slope >= 0.0 && slope.is_finite()) => wrong("slope", *slope, "0 or more"),
            Self { window, cell, .. } if !(window >= cell && *window <= 1000.0 * cell) => {
                wrong("window", *window, "1 to 1000 cells")
            }
            Self { threshold, .. } if !(*threshold > 0.0 && threshold.is_finite()) => {
                wrong("threshold", *threshold, "metres, above 0")
            }
            Self { scaling, .. } if !(*scaling >= 0.0 && scaling.is_finite()) => {
                wrong("scaling", *scaling, "metres, 0 or more")
            }
            _ => Ok(()),
        }
    }
}

/// Classifies the ground points of a cloud by the simple morphological filter.
///
/// T. J. Pingel, K. C. Clarke, W. A. McBride, *An improved simple morphological filter for the terrain classification
/// of airborne LIDAR data*, ISPRS Journal 77, 2013. The lowest heights of the cells are opened by larger and larger
/// (square) windows; a cell that an opening lowers by more than slope · width is an object. The remaining cells, with
/// holes filled by the nearest height, are the ground, and points near it are ground points. Returns true for each
/// ground point. O(n + cells · window · log window).
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
    let lowest = ElevationParams { cell: params.cell, percentile: 0.0, median: 1 };
    let model = ElevationModel::fit(points, &vec![true; points.len()], &lowest, monitor)?;
    let ground = ElevationModel::from_raster(bare(model.raster(), params, monitor)?, monitor)?;
    let heights = ground.heights(points, monitor)?;
    let steepness = steepness(ground.raster(), monitor)?;
    let parts = map_ordered(points.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(points.len());
        monitor.advance(range.len() as u64);
        let near = |i: usize| {
            let [x, y, _] = points.world(i);
            let slope = steepness[ground.raster().cell_of([x, y])];
            f64::from(heights[i].abs()) <= params.threshold + params.scaling * slope
        };
        Ok(range.map(near).collect::<Vec<bool>>())
    })?;
    Ok(parts.concat())
}

/// The heights of ground cells; the others are holes.
fn bare(lowest: &Raster, params: &GroundParams, monitor: &Monitor) -> Result<Raster> {
    let columns = lowest.columns();
    let mut surface = lowest.values().to_vec();
    let closed = Window { columns, reach: 1 }.closed(&surface, monitor)?;
    let pit: Vec<bool> = surface.iter().zip(&closed).map(|(s, c)| c - s > PIT * params.cell).collect();
    surface.iter_mut().zip(&closed).zip(&pit).for_each(|((s, c), &pit)| *s = if pit { *c } else { *s });
    let mut object = pit;
    for reach in 1..=(params.window / params.cell) as usize {
        let opened = Window { columns, reach }.opened(&surface, monitor)?;
        let most = params.slope * reach as f64 * params.cell;
        object.iter_mut().zip(surface.iter().zip(&opened)).for_each(|(object, (s, o))| *object |= s - o > most);
        surface = opened;
    }
    let kept = lowest.values().iter().zip(&object).map(|(&z, &object)| if object { f64::NAN } else { z });
    Raster::new(lowest.origin(), lowest.cell(), columns, kept.collect())
}

/// Slope (rise over run) at each cell, from differences of its neighbours.
fn steepness(raster: &Raster, monitor: &Monitor) -> Result<Vec<f64>> {
    let (rows, columns, z) = (raster.rows(), raster.columns(), raster.values());
    let difference = |a: usize, b: usize, steps: usize| match steps {
        0 => 0.0,
        _ => (z[b] - z[a]) / (steps as f64 * raster.cell()),
    };
    let at = |r: usize, c: usize| {
        let (west, east) = (c.saturating_sub(1), (c + 1).min(columns - 1));
        let (south, north) = (r.saturating_sub(1), (r + 1).min(rows - 1));
        let x = difference(r * columns + west, r * columns + east, east - west);
        let y = difference(south * columns + c, north * columns + c, north - south);
        x.hypot(y)
    };
    let line = |r: usize| Ok((0..columns).map(|c| at(r, c)).collect::<Vec<f64>>());
    concat_watched(map_ordered(rows, monitor, line)?, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;

    fn points(rows: &[[f64; 3]]) -> Points {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0)
    }

    fn ground(rows: &[[f64; 3]]) -> Vec<bool> {
        ground_points(&points(rows), &GroundParams::default(), &Monitor::default()).unwrap()
    }

    #[test]
    fn a_house_and_a_tree_on_a_hill_are_not_ground_but_the_hill_is() {
        let hill = |x: f64, y: f64| 0.1 * x + 0.05 * y;
        let mut random = stream(2, 1);
        let mut rows = Vec::new();
        for (x, y) in (0..120).flat_map(|i| (0..120).map(move |j| (f64::from(i) * 0.5, f64::from(j) * 0.5))) {
            let house = (20.0..32.0).contains(&x) && (20.0..30.0).contains(&y);
            let tree = (x - 45.0).hypot(y - 45.0) < 3.0 && random.uniform() < 0.5;
            rows.push([
                x,
                y,
                hill(x, y)
                    + if house {
                        6.0
                    } else if tree {
                        2.0 + 4.0 * random.uniform()
                    } else {
                        0.0
                    },
            ]);
        }
        let found = ground(&rows);
        let wrong = found.iter().zip(&rows).filter(|(found, p)| **found != (p[2] - hill(p[0], p[1]) < 0.1));
        assert_eq!(wrong.count(), 0);
    }

    #[test]
    fn a_pit_of_noise_is_not_ground_and_does_not_draw_the_ground_down() {
        let mut rows: Vec<[f64; 3]> = (0..900).map(|i| [f64::from(i % 30), f64::from(i / 30), 0.0]).collect();
        rows.push([15.2, 15.2, -20.0]);
        let found = ground(&rows);
        assert!(!found[900]);
        assert!(found[..900].iter().all(|&ground| ground));
    }

    #[test]
    fn one_point_is_ground_and_none_is_an_error() {
        assert_eq!(ground(&[[1.0, 2.0, 3.0]]), [true]);
        assert!(ground_points(&Points::default(), &GroundParams::default(), &Monitor::default()).is_err());
        let wide = GroundParams { window: f64::INFINITY, ..GroundParams::default() };
        assert!(ground_points(&points(&[[0.0; 3]]), &wide, &Monitor::default()).is_err());
    }
}
