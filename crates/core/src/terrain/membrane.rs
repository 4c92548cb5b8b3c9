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
    fill_parts(start.values_mut(), columns, monitor, |r, row| {
        let y = coarse.origin()[1] + (r as f64 + 0.5) * cell;
        let at = |c: usize| T::nearest(coarse.bilinear([coarse.origin()[0] + (c as f64 + 0.5) * cell, y]));
        row.iter_mut().enumerate().filter(|(_, v)| v.is_hole()).for_each(|(c, v)| *v = at(c));
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
    let inside = low * columns..high * columns;
    let holes: Vec<usize> = (0..inside.len()).filter(|i| hole[inside.start + i]).collect();
    let mut old = start.values()[inside].to_vec();
    let mut new = old.clone();
    for _ in 0..SWEEPS {
        for &i in &holes {
            let column = i % columns;
            let west = if column == 0 { i } else { i - 1 };
            let east = if column + 1 == columns { i } else { i + 1 };
            let south = if i < columns { i } else { i - columns };
            let north = if i + columns < old.len() { i + columns } else { i };
            let [west, east, south, north]: [f64; 4] = [west, east, south, north].map(|near| old[near].into());
            new[i] = T::nearest(0.25 * (west + east + south + north));
        }
        std::mem::swap(&mut old, &mut new);
    }
    let own = (part.start - low) * columns..(part.end - low) * columns;
    holes.into_iter().filter(|i| own.contains(i)).map(|i| old[i]).collect()
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
