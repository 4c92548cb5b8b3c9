//! A raster of heights.

use crate::error::{Error, Result};
use std::fmt::Debug;

/// Largest number of cells of a raster.
const MOST: usize = 100_000_000;

/// A height of a raster, metres: `f64` in the world, `f32` above the origin of local points.
pub trait Height: Copy + Debug + PartialOrd + Into<f64> + Send + Sync {
    /// No height: not a number.
    const HOLE: Self;

    /// The nearest one that can be held.
    fn nearest(height: f64) -> Self;

    /// Whether there is none.
    fn is_hole(self) -> bool {
        self.into().is_nan()
    }
}

impl Height for f64 {
    const HOLE: Self = Self::NAN;

    fn nearest(height: f64) -> Self {
        height
    }
}

impl Height for f32 {
    const HOLE: Self = Self::NAN;

    fn nearest(height: f64) -> Self {
        height as Self
    }
}

/// Heights in metres at the centres of square cells, row after row from the south-west corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster<T = f64> {
    origin: [f64; 2],
    cell: f64,
    columns: usize,
    rows: usize,
    values: Vec<T>,
}

impl<T: Height> Raster<T> {
    /// A raster whose south-west corner is `origin`; NaN is a hole.
    ///
    /// # Errors
    /// If the cell is not above 0, a value is infinite, or the values are not whole rows of `columns`.
    pub fn new(origin: [f64; 2], cell: f64, columns: usize, values: Vec<T>) -> Result<Self> {
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
        if let Some(i) = values.iter().position(|&v| v.into().is_infinite()) {
            return Err(Error::input(format!("height {i} is {:?} (allowed: finite, NaN for a hole)", values[i])));
        }
        Ok(Self { origin, cell, columns, rows: values.len() / columns, values })
    }

    /// A raster of holes over an extent, with cells aligned to multiples of `cell`.
    pub(crate) fn over(low: [f64; 2], high: [f64; 2], cell: f64) -> Result<Self> {
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
        Self::new(first.map(|v| v * cell), cell, count[0] as usize, vec![T::HOLE; cells as usize])
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
        self.rows
    }

    /// Heights, row after row from the south-west corner.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    pub(crate) fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The same raster with other heights, of the same number.
    pub(crate) fn with_values(self, values: Vec<T>) -> Self {
        debug_assert_eq!(values.len(), self.values.len());
        Self { values, ..self }
    }

    /// A raster of the cells of another one, with heights of its own, of the same number.
    pub(crate) fn of(cells: &Self, values: Vec<T>) -> Self {
        debug_assert_eq!(values.len(), cells.values.len());
        Self { values, ..*cells }
    }

    /// The cell that contains a position; the nearest cell for positions outside.
    pub(crate) fn cell_of(&self, at: [f64; 2]) -> usize {
        let index = |a: usize, count: usize| (((at[a] - self.origin[a]) / self.cell) as usize).min(count - 1);
        index(1, self.rows()) * self.columns + index(0, self.columns)
    }

    /// Lowest and highest x and y.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        let end = |axis: usize, count: usize| self.origin[axis] + self.cell * count as f64;
        [self.origin, [end(0, self.columns), end(1, self.rows())]]
    }

    /// Whether a position lies in the raster or less than a cell beyond it.
    pub fn covers(&self, at: [f64; 2]) -> bool {
        let [low, high] = self.bounds();
        (0..2).all(|axis| at[axis] > low[axis] - self.cell && at[axis] < high[axis] + self.cell)
    }

    /// Bilinear height between the four nearest centres; beyond the outermost centres the height at the border.
    pub fn bilinear(&self, at: [f64; 2]) -> f64 {
        self.between([0, 1].map(|axis| self.centres(axis, at[axis])))
    }

    /// The two centres around a coordinate: in x on axis 0, in y on axis 1.
    pub(crate) fn centres(&self, axis: usize, coordinate: f64) -> Centres {
        let count = [self.columns, self.rows][axis];
        let u = ((coordinate - self.origin[axis]) / self.cell - 0.5).clamp(0.0, (count - 1) as f64);
        let low = (u as usize).min(count.saturating_sub(2));
        Centres { low, high: (low + 1).min(count - 1), share: u - low as f64 }
    }

    /// Bilinear height between the centres around x and around y.
    #[inline]
    pub(crate) fn between(&self, [x, y]: [Centres; 2]) -> f64 {
        let at = |column: usize, row: usize| -> f64 { self.values[row * self.columns + column].into() };
        let along = |row: usize| at(x.low, row) + x.share * (at(x.high, row) - at(x.low, row));
        let [low, high] = [along(y.low), along(y.high)];
        low + y.share * (high - low)
    }
}

/// Two neighbouring columns or rows of a raster, and where between their centres a place lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Centres {
    low: usize,
    high: usize,
    /// 0: at the lower one, 1: at the higher one.
    share: f64,
}

impl Raster<f32> {
    /// The same raster with heights in the world, those above an origin at the height `by`.
    pub(crate) fn raised(self, by: f64) -> Raster {
        let values = self.values.into_iter().map(|v| f64::from(v) + by).collect();
        Raster { origin: self.origin, cell: self.cell, columns: self.columns, rows: self.rows, values }
    }
}

impl Raster {
    /// The same raster in another unit: origin, cell and heights divided by `metres`, the metres per unit. The cell is
    /// rounded to 12 digits, so that 0.9144 m are 3 international ft and not 3.0000000000000004.
    ///
    /// # Errors
    /// If a result is not finite.
    pub fn in_unit(self, metres: f64) -> Result<Self> {
        let cells = self.origin.map(|o| o / self.cell);
        let cell = self.cell / metres;
        let digits = 10f64.powf(11.0 - cell.log10().floor());
        let cell = if digits.is_finite() { (cell * digits).round() / digits } else { cell };
        let whole = |v: f64| if (v - v.round()).abs() < 1e-6 { v.round() } else { v };
        let values = self.values.into_iter().map(|v| v / metres).collect();
        Self::new(cells.map(|v| whole(v) * cell), cell, self.columns, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(raster.bounds(), [[100.0, 50.0], [105.0, 54.0]]);
        assert!(raster.covers([99.5, 54.5]) && !raster.covers([98.9, 52.0]) && !raster.covers([102.0, 55.1]));
        let one = Raster::new([0.0; 2], 2.0, 1, vec![7.0]).unwrap();
        assert_eq!(one.bilinear([5.0, -3.0]), 7.0);
    }

    #[test]
    fn heights_above_an_origin_keep_their_holes_and_places() {
        let raster = Raster::<f32>::over([1e6, 5e6], [1e6 + 3.0, 5e6 + 1.0], 1.0).unwrap();
        assert_eq!((raster.rows(), raster.columns()), (2, 4));
        assert!(raster.values().iter().all(|z| z.is_hole()));
        let raster = Raster::of(&raster, vec![0.5f32, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5]);
        assert!((raster.bilinear([1e6 + 2.25, 5e6 + 1.0]) - 2.25).abs() < 1e-6);
        assert_eq!(raster.cell_of([1e6 + 2.25, 5e6 + 1.0]), 6);
        assert!(Raster::new([0.0; 2], 1.0, 1, vec![f32::INFINITY]).is_err());
    }

    #[test]
    fn a_raster_in_feet_covers_the_same_ground() {
        let raster = Raster::new([9144.0, -914.4], 0.9144, 2, vec![3.048, f64::NAN]).unwrap().in_unit(0.3048).unwrap();
        assert_eq!((raster.origin(), raster.cell()), ([30_000.0, -3000.0], 3.0));
        assert!((raster.values()[0] - 10.0).abs() < 1e-12 && raster.values()[1].is_nan());
        let same = Raster::new([0.25, 7.5], 1.0, 1, vec![2.0]).unwrap();
        assert_eq!(same.clone().in_unit(1.0).unwrap(), same);
    }

    #[test]
    fn impossible_rasters_are_refused() {
        assert!(Raster::new([0.0; 2], 0.0, 1, vec![1.0]).is_err());
        assert!(Raster::new([0.0; 2], 1.0, 2, vec![1.0]).is_err());
        assert!(Raster::<f64>::new([0.0; 2], 1.0, 0, vec![]).is_err());
        assert!(Raster::new([0.0; 2], 1.0, 1, vec![f64::INFINITY]).is_err());
        assert!(Raster::<f64>::over([0.0; 2], [1e9; 2], 0.5).unwrap_err().to_string().contains("cell"));
    }
}
