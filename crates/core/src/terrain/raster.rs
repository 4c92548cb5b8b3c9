//! A raster of heights.

use super::holes::nearest_filled;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, concat_watched, map_ordered};

/// Largest number of cells of a raster.
const MOST: usize = 100_000_000;

/// Heights in metres at the centres of square cells, row after row from the south-west corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    origin: [f64; 2],
    cell: f64,
    columns: usize,
    values: Vec<f64>,
}

impl Raster {
    /// A raster whose south-west corner is `origin`; NaN is a hole.
    ///
    /// # Errors
    /// If the cell is not above 0, a value is infinite, or the values are not whole rows of `columns`.
    pub fn new(origin: [f64; 2], cell: f64, columns: usize, values: Vec<f64>) -> Result<Self> {
        if !(cell > 0.0 && cell.is_finite() && origin.iter().all(|o| o.is_finite())) {
            return Err(Error::input(format!(
                "raster at {origin:?} with cells of {cell} m (allowed: finite, above 0)"
            )));
        }
        if columns == 0 || values.is_empty() || !values.len().is_multiple_of(columns) || values.len() > MOST {
            return Err(Error::input(format!(
                "{} heights in rows of {columns} (allowed: whole rows, 1..={MOST} heights)",
                values.len()
            )));
        }
        if let Some(i) = values.iter().position(|v| v.is_infinite()) {
            return Err(Error::input(format!("height {i} is {} (allowed: finite, NaN for a hole)", values[i])));
        }
        Ok(Self { origin, cell, columns, values })
    }

    /// A raster of holes over an extent, with cells aligned to multiples of `cell`.
    pub(super) fn over(low: [f64; 2], high: [f64; 2], cell: f64) -> Result<Self> {
        let first = low.map(|v| (v / cell).floor());
        let count = [0, 1].map(|a| (high[a] / cell).floor() - first[a] + 1.0);
        let cells = count[0] * count[1];
        // False for NaN too.
        if !(cells >= 1.0 && cells <= MOST as f64) {
            let [wide, high] = count.map(|count| count * cell);
            let expected = format!(
                "a size that gives 1..={MOST} cells; this extent of {wide:.0} x {high:.0} m needs {cells}: cut the cloud or choose \
                 a larger cell"
            );
            return Err(Error::parameter("cell", cell, expected));
        }
        Self::new(first.map(|v| v * cell), cell, count[0] as usize, vec![f64::NAN; cells as usize])
    }

    /// South-west corner, metres.
    pub fn origin(&self) -> [f64; 2] {
        self.origin
    }

    /// Edge of a cell, metres.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Number of cells from west to east.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of cells from south to north.
    pub fn rows(&self) -> usize {
        self.values.len() / self.columns
    }

    /// Heights, row after row from the south-west corner.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The cell that contains a position; the nearest cell for positions outside.
    pub(super) fn cell_of(&self, at: [f64; 2]) -> usize {
        let index = |a: usize, count: usize| (((at[a] - self.origin[a]) / self.cell) as usize).min(count - 1);
        index(1, self.rows()) * self.columns + index(0, self.columns)
    }

    /// Fills every hole with the nearest height (distance between centres; ties are broken deterministically).
    /// O(cells).
    ///
    /// # Errors
    /// If there is no height at all, or the work was cancelled.
    pub fn fill_holes(&mut self, monitor: &Monitor) -> Result<()> {
        let filled: Vec<bool> = self.values.iter().map(|v| !v.is_nan()).collect();
        if !filled.contains(&true) {
            return Err(Error::input("a raster without any height"));
        }
        let source = nearest_filled(&filled, self.columns, monitor)?;
        monitor.check()?;
        self.values = source.iter().map(|&s| self.values[s as usize]).collect();
        Ok(())
    }

    /// Replaces every height by the median of a window of that (odd) width around it. Near the border the window is
    /// narrower but stays centred, so that a slope is not changed. O(cells width²).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn median(&mut self, width: usize, monitor: &Monitor) -> Result<()> {
        let (rows, columns, reach) = (self.rows(), self.columns, width / 2);
        let smooth = map_ordered(rows, monitor, |r| {
            let up = reach.min(r).min(rows - 1 - r);
            let mut window = Vec::with_capacity(width * width);
            let middle = |c: usize| {
                let aside = reach.min(c).min(columns - 1 - c);
                window.clear();
                for row in r - up..=r + up {
                    window.extend_from_slice(&self.values[row * columns..][c - aside..=c + aside]);
                }
                window.sort_unstable_by(f64::total_cmp);
                window[window.len() / 2]
            };
            Ok((0..columns).map(middle).collect::<Vec<f64>>())
        })?;
        self.values = concat_watched(smooth, monitor)?;
        Ok(())
    }

    /// Bilinear height between the four nearest centres; beyond the outermost centres the height at the border.
    pub fn bilinear(&self, at: [f64; 2]) -> f64 {
        let place = |a: usize, count: usize| {
            let u = ((at[a] - self.origin[a]) / self.cell - 0.5).clamp(0.0, (count - 1) as f64);
            let low = (u as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), u - low as f64)
        };
        let ((x0, x1, u), (y0, y1, v)) = (place(0, self.columns), place(1, self.rows()));
        let at = |x: usize, y: usize| self.values[y * self.columns + x];
        let low = at(x0, y0) + u * (at(x1, y0) - at(x0, y0));
        let high = at(x0, y1) + u * (at(x1, y1) - at(x0, y1));
        low + v * (high - low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn a_bilinear_surface_comes_back_between_the_centres() {
        let height = |x: f64, y: f64| 3.0 + 0.5 * x - 0.25 * y + 0.125 * x * y;
        let values = (0..20).map(|i| height(f64::from(i % 5) + 0.5, f64::from(i / 5) + 0.5)).collect();
        let raster = Raster::new([100.0, 50.0], 1.0, 5, values).unwrap();
        assert_eq!((raster.rows(), raster.columns()), (4, 5));
        for (x, y) in [(0.5, 0.5), (1.25, 2.75), (4.5, 3.5), (3.1, 0.9)] {
            assert!((raster.bilinear([100.0 + x, 50.0 + y]) - height(x, y)).abs() < 1e-12);
        }
        assert_eq!(raster.bilinear([-1e9, 1e9]), height(0.5, 3.5));
        let one = Raster::new([0.0; 2], 2.0, 1, vec![7.0]).unwrap();
        assert_eq!(one.bilinear([5.0, -3.0]), 7.0);
    }

    #[test]
    fn holes_take_the_nearest_height() {
        let mut s = stream(4, 4);
        for (columns, rows) in [(17, 9), (1, 30), (30, 1), (12, 12)] {
            let value = |i: usize, u: f64| if u < 0.06 || i == 5 { i as f64 } else { f64::NAN };
            let values: Vec<f64> = (0..columns * rows).map(|i| value(i, s.uniform())).collect();
            let mut raster = Raster::new([0.0; 2], 1.0, columns, values.clone()).unwrap();
            raster.fill_holes(&Monitor::default()).unwrap();
            let apart = |a: usize, b: usize| {
                let (dx, dy) = ((a % columns).abs_diff(b % columns), (a / columns).abs_diff(b / columns));
                dx * dx + dy * dy
            };
            for i in 0..values.len() {
                let least = (0..values.len()).filter(|&j| !values[j].is_nan()).map(|j| apart(i, j)).min();
                assert_eq!(Some(apart(i, raster.values()[i] as usize)), least);
            }
        }
        assert!(Raster::new([0.0; 2], 1.0, 2, vec![f64::NAN; 4]).unwrap().fill_holes(&Monitor::default()).is_err());
    }

    #[test]
    fn the_median_takes_spikes_away() {
        let mut raster = Raster::new([0.0; 2], 1.0, 3, vec![1.0, 1.0, 1.0, 1.0, 90.0, 1.0, 1.0, 1.0, 2.0]).unwrap();
        raster.median(3, &Monitor::default()).unwrap();
        assert_eq!(raster.values()[4], 1.0);
        // A corner has no window, the middle of a side one along that side.
        assert_eq!((raster.values()[7], raster.values()[8]), (1.0, 2.0));
    }

    #[test]
    fn impossible_rasters_are_refused() {
        assert!(Raster::new([0.0; 2], 0.0, 1, vec![1.0]).is_err());
        assert!(Raster::new([0.0; 2], 1.0, 2, vec![1.0]).is_err());
        assert!(Raster::new([0.0; 2], 1.0, 0, vec![]).is_err());
        assert!(Raster::new([0.0; 2], 1.0, 1, vec![f64::INFINITY]).is_err());
        assert!(Raster::over([0.0; 2], [1e9; 2], 0.5).unwrap_err().to_string().contains("cell"));
    }
}
