//! The squares in plan that hold points: the ground that a scan covers, and its density.

use super::cells::cell_of;
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, sort_watched};

/// Edge in metres of the squares by which covered ground is measured.
const EDGE: f64 = 2.0;

/// Points per occupied square metre, measured on squares of 2 m. 0 if there is no point. O(n log n), 12 temporary bytes
/// a point at most.
///
/// # Errors
/// If the work was cancelled.
pub fn planar_density(points: &Positions, monitor: &Monitor) -> Result<f64> {
    Ok(PlanarDensity::new(points, monitor)?.mean)
}

/// Density of points in plan, measured on the occupied squares of 2 m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlanarDensity {
    /// Points per occupied square metre, 0 if there is no point.
    pub(crate) mean: f64,
    /// The least of the ratios between neighbouring [`QUANTILES`] of the points per square, 1 or more; 1 if there are fewer than
    /// [`LEAST_SQUARES`] squares.
    ///
    /// A scanner in the air covers the ground evenly, so that most squares have about as many points. Around one on the
    /// ground the density falls with the square of the distance, so that all quantiles are far apart. Land and water,
    /// or two flights of different density, have one large ratio, not four.
    pub(crate) spread: f64,
}

/// Shares of the squares, ascending by their points.
const QUANTILES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Fewer squares do not show how the density changes.
const LEAST_SQUARES: usize = 100;

impl PlanarDensity {
    /// O(n log n), 12 temporary bytes a point at most.
    pub(crate) fn new(points: &Positions, monitor: &Monitor) -> Result<Self> {
        let squares = squares(points, monitor)?;
        let mut counts: Vec<u32> = squares.chunk_by(|a, b| a == b).map(|square| square.len() as u32).collect();
        counts.sort_unstable();
        let area = counts.len() as f64 * (EDGE * EDGE);
        Ok(Self { mean: if area > 0.0 { points.len() as f64 / area } else { 0.0 }, spread: spread(&counts) })
    }
}

/// The least ratio between neighbouring quantiles of these counts, which ascend.
fn spread(counts: &[u32]) -> f64 {
    if counts.len() < LEAST_SQUARES {
        return 1.0;
    }
    let quantiles = QUANTILES.map(|share| f64::from(counts[((counts.len() - 1) as f64 * share).round() as usize]));
    quantiles.windows(2).map(|pair| pair[1] / pair[0]).fold(f64::INFINITY, f64::min)
}

/// The squares of all points, ascending.
fn squares(points: &Positions, monitor: &Monitor) -> Result<Vec<[i32; 2]>> {
    let square = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / EDGE));
    let mut squares = map_watched(points.len(), monitor, square)?;
    sort_watched(&mut squares, monitor)?;
    Ok(squares)
}

/// Area in plan that holds points, in m²: that of the occupied squares of 2 m. O(n log n), 8 temporary bytes a point.
///
/// # Errors
/// If the work was cancelled.
pub(crate) fn covered_area(points: &Positions, monitor: &Monitor) -> Result<f64> {
    let mut squares = squares(points, monitor)?;
    squares.dedup();
    Ok(squares.len() as f64 * (EDGE * EDGE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};

    /// The density of points in 20 x 20 squares with these numbers of points, each in the middle of its square.
    fn of(count: impl Fn(i32, i32) -> usize) -> PlanarDensity {
        let squares = (0..400).map(|i| (i % 20, i / 20));
        let middle = |i: i32| EDGE * (f64::from(i) + 0.5);
        let rows: Vec<[f64; 3]> = squares.flat_map(|(x, y)| vec![[middle(x), middle(y), 0.0]; count(x, y)]).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        PlanarDensity::new(&points.positions, &Monitor::default()).unwrap()
    }

    #[test]
    fn the_spread_tells_a_scanner_on_the_ground_from_even_cover() {
        assert_eq!(of(|_, _| 12), PlanarDensity { mean: 3.0, spread: 1.0 });
        // Land and water, and a patch that was flown twice.
        let land = of(|x, _| if x < 7 { 1 } else { 60 });
        assert!(land.spread == 1.0 && (land.mean - (7.0 + 13.0 * 60.0) / 80.0).abs() < 1e-9, "{land:?}");
        assert_eq!(of(|x, _| [10, 20, 200][(x / 7) as usize]).spread, 1.0);
        // Falling with the square of the distance from the middle, as 1 / r²: a tenth of the squares is within r² = 40 / π.
        let around = of(|x, y| (20_000.0 / f64::from((2 * x - 19).pow(2) + (2 * y - 19).pow(2))) as usize);
        assert!((1.25..1.6).contains(&around.spread), "{around:?}");
        // Along a street with facades the fall is steeper.
        let street = of(|_, y| 3000 >> (y - 10).abs().min(9));
        assert!(street.spread >= 2.0, "{street:?}");
        assert_eq!(of(|x, y| usize::from(x < 9 && y < 9) << x).spread, 1.0, "too few squares");
        assert_eq!(of(|_, _| 0), PlanarDensity { mean: 0.0, spread: 1.0 });
    }
}
