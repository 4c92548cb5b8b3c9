//! Holes of a raster filled by a membrane stretched between their edges.

use crate::cloud::{Height, Raster};
use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, fill_parts, map_ordered};

/// Relaxations of each level, after those of the coarser ones. In holes of tens of cells the height is then within a few
/// per cent of the difference between their edges from that of the membrane.
const SWEEPS: usize = 16;
/// Rows that are relaxed together.
const ROWS: usize = 128;

/// Fills holes so that every filled height is the mean of its four neighbours (Laplace's equation); beyond the border
/// the height is that of the border. A raster without any height is returned as it is.
///
/// Levels of half the size, whose cells are the mean of the heights in two by two cells, are filled first; each gives the
/// start of the next by bilinear interpolation, which [`SWEEPS`] Jacobi iterations then relax. O(cells).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn membrane<T: Height>(raster: Raster<T>, monitor: &Monitor) -> Result<Raster<T>> {
    monitor.check()?;
    let holes = raster.values().iter().filter(|v| v.is_hole()).count();
    if holes == 0 || holes == raster.values().len() {
        return Ok(raster);
    }
    let coarse = membrane(halved(&raster, monitor)?, monitor)?;
    let hole: Vec<bool> = raster.values().iter().map(|v| v.is_hole()).collect();
    let mut start = raster;
    let (cell, columns) = (start.cell(), start.columns());
    let centre = |axis: usize, number: usize| coarse.origin()[axis] + (number as f64 + 0.5) * cell;
    let across: Vec<_> = (0..columns).map(|c| coarse.centres(0, centre(0, c))).collect();
    fill_parts(start.values_mut(), columns, monitor, |r, row| {
        let y = coarse.centres(1, centre(1, r));
        let holes = row.iter_mut().zip(&across).filter(|(v, _)| v.is_hole());
        holes.for_each(|(v, &x)| *v = T::nearest(coarse.between([x, y])));
    })?;
    drop(coarse);
    let parts = start.rows().div_ceil(ROWS);
    let relaxed = map_ordered(parts, monitor, |part| Ok(relaxed(&start, &hole, part)))?;
    for (part, heights) in relaxed.into_iter().enumerate() {
        let first = part * ROWS * columns;
        let holes = start.values_mut()[first..].iter_mut().zip(&hole[first..]).filter(|(_, hole)| **hole);
        holes.zip(heights).for_each(|((value, _), height)| *value = height);
    }
    Ok(start)
}

/// The raster with cells of twice the edge, each the mean of the heights in it.
fn halved<T: Height>(raster: &Raster<T>, monitor: &Monitor) -> Result<Raster<T>> {
    let (rows, columns) = (raster.rows(), raster.columns());
    let lines = map_ordered(rows.div_ceil(2), monitor, |r| {
        let mean = |c: usize| {
            let inside = (2 * r..(2 * r + 2).min(rows)).map(|row| row * columns);
            let heights = inside.flat_map(|row| &raster.values()[row + 2 * c..row + (2 * c + 2).min(columns)]);
            let given = heights.map(|&v| -> f64 { v.into() }).filter(|v| !v.is_nan());
            let [sum, count] = given.fold([0.0, 0.0], |[sum, count], v| [sum + v, count + 1.0]);
            T::nearest(sum / count)
        };
        Ok((0..columns.div_ceil(2)).map(mean).collect::<Vec<T>>())
    })?;
    Raster::new(raster.origin(), 2.0 * raster.cell(), columns.div_ceil(2), concat_watched(lines, monitor)?)
}

/// The heights of the holes in some rows, relaxed from the start. The rows around that the sweeps reach are relaxed too, so
/// that the result does not depend on the division into parts.
fn relaxed<T: Height>(start: &Raster<T>, hole: &[bool], part: usize) -> Vec<T> {
    let (rows, columns) = (start.rows(), start.columns());
    let part = part * ROWS..((part + 1) * ROWS).min(rows);
    let [low, high] = [part.start.saturating_sub(SWEEPS), (part.end + SWEEPS).min(rows)];
    let mut old = Framed::around(&start.values()[low * columns..high * columns], columns);
    let place = |cell: usize| old.place(cell) as u32;
    let first = low * columns;
    let holes: Vec<u32> = (0..(high - low) * columns).filter(|cell| hole[first + cell]).map(place).collect();
    let mut new = old.clone();
    for _ in 0..SWEEPS {
        old.relax_into(&holes, &mut new);
        std::mem::swap(&mut old, &mut new);
    }
    let own = (part.start - low) * columns..(part.end - low) * columns;
    own.filter(|cell| hole[first + cell]).map(|cell| old.values[old.place(cell)]).collect()
}

/// Rows of heights with a frame of one cell, which holds the heights beside it: every cell has four neighbours.
#[derive(Clone)]
struct Framed<T> {
    columns: usize,
    values: Vec<T>,
}

impl<T: Height> Framed<T> {
    fn around(heights: &[T], columns: usize) -> Self {
        let mut values = vec![T::HOLE; (columns + 2) * (heights.len() / columns + 2)];
        let rows = values.chunks_exact_mut(columns + 2).skip(1);
        rows.zip(heights.chunks_exact(columns)).for_each(|(row, from)| row[1..=columns].copy_from_slice(from));
        let mut framed = Self { columns, values };
        framed.frame();
        framed
    }

    /// Where the height of a cell stands.
    fn place(&self, cell: usize) -> usize {
        (cell / self.columns + 1) * (self.columns + 2) + cell % self.columns + 1
    }

    /// Fills the frame.
    fn frame(&mut self) {
        let (columns, width) = (self.columns, self.columns + 2);
        for row in self.values.chunks_exact_mut(width) {
            (row[0], row[columns + 1]) = (row[1], row[columns]);
        }
        let last = self.values.len() - width;
        self.values.copy_within(width..2 * width, 0);
        self.values.copy_within(last - width..last, last);
    }

    /// Gives each hole the mean of its neighbours.
    fn relax_into(&self, holes: &[u32], relaxed: &mut Self) {
        let width = self.columns + 2;
        for hole in holes.iter().map(|&hole| hole as usize) {
            let near = [hole - 1, hole + 1, hole - width, hole + width];
            let [west, east, south, north]: [f64; 4] = near.map(|near| self.values[near].into());
            relaxed.values[hole] = T::nearest(0.25 * (west + east + south + north));
        }
        relaxed.frame();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(columns: usize, values: Vec<f64>) -> Vec<f64> {
        let raster = Raster::new([3.0, 7.0], 0.5, columns, values).unwrap();
        membrane(raster, &Monitor::default()).unwrap().values().to_vec()
    }

    #[test]
    fn a_hole_in_a_saddle_is_filled_by_the_saddle() {
        // x y and x² − y² are harmonic, in cells too.
        let height = |i: usize| {
            let [x, y] = [(i % 60) as f64 - 30.0, (i / 60) as f64 - 20.0];
            100.0 + 0.3 * x - 0.2 * y + 0.01 * x * y + 0.005 * (x * x - y * y)
        };
        let hole = |i: usize| (20..40).contains(&(i % 60)) && (10..30).contains(&(i / 60));
        let found = filled(60, (0..2400).map(|i| if hole(i) { f64::NAN } else { height(i) }).collect());
        for (i, z) in found.iter().enumerate() {
            assert!((z - height(i)).abs() < if hole(i) { 0.1 } else { 1e-12 }, "{i}: {z} {}", height(i));
        }
    }

    #[test]
    fn strips_between_given_rows_rise_evenly_and_parts_do_not_show() {
        // 400 rows are several parts; every 57th is given.
        let value = |i: usize| if (i / 8).is_multiple_of(57) { (i / 8) as f64 } else { f64::NAN };
        let found = filled(8, (0..3200).map(value).collect());
        for (i, z) in found.iter().enumerate() {
            assert!((z - (i / 8) as f64).abs() < 3.5, "{i}: {z}");
            assert!((z - found[i / 8 * 8]).abs() < 1e-9);
        }
    }

    #[test]
    fn one_height_fills_everything_and_none_nothing() {
        let mut one = vec![f64::NAN; 35];
        one[17] = 4.5;
        assert!(filled(7, one).iter().all(|&z| z == 4.5));
        assert!(filled(7, vec![f64::NAN; 35]).iter().all(|z| z.is_nan()));
    }
}
