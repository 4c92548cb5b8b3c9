//! Rasters without holes and without spikes.

use super::holes::nearest_filled;
use crate::cloud::{Height, Raster};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, fill_parts};

/// Every hole takes the nearest height (distance between centres; ties are broken deterministically). O(cells).
///
/// # Errors
/// If there is no height at all, or the work was cancelled.
pub fn fill_holes<T: Height>(mut raster: Raster<T>, monitor: &Monitor) -> Result<Raster<T>> {
    let filled: Vec<bool> = raster.values().iter().map(|v| !v.is_hole()).collect();
    if !filled.contains(&true) {
        return Err(Error::input("a raster without any height"));
    }
    if filled.contains(&false) {
        let source = nearest_filled(&filled, raster.columns(), monitor)?;
        monitor.check()?;
        let values = raster.values_mut();
        (0..values.len()).for_each(|i| values[i] = values[source[i] as usize]);
    }
    Ok(raster)
}

/// Replaces every height by the median of a window of that (odd) width around it. Near the border the window is
/// narrower but stays centred, so that a slope is not changed. O(cells width²).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn median<T: Height>(raster: Raster<T>, width: usize, monitor: &Monitor) -> Result<Raster<T>> {
    let (rows, columns, reach) = (raster.rows(), raster.columns(), width / 2);
    let mut smooth = vec![T::HOLE; rows * columns];
    fill_parts(&mut smooth, columns, monitor, |r, line| {
        let up = reach.min(r).min(rows - 1 - r);
        let mut window = Vec::with_capacity(width * width);
        let mut middle = |c: usize| {
            let aside = reach.min(c).min(columns - 1 - c);
            window.clear();
            for row in r - up..=r + up {
                window.extend_from_slice(&raster.values()[row * columns..][c - aside..=c + aside]);
            }
            window.sort_unstable_by(|&a, &b| f64::total_cmp(&a.into(), &b.into()));
            window[window.len() / 2]
        };
        if up == 1 && width == 3 {
            let rows = [r - 1, r, r + 1].map(|row| &raster.values()[row * columns..][..columns]);
            medians_of_nine(rows, line);
            [0, columns - 1].into_iter().for_each(|c| line[c] = middle(c));
        } else {
            line.iter_mut().zip((0..columns).map(middle)).for_each(|(smooth, height)| *smooth = height);
        }
    })?;
    Ok(raster.with_values(smooth))
}

/// The medians of all windows of 3 x 3 cells of three rows, but for those of the first and the last column: of the greatest of
/// the lowest, the middle of the middle and the least of the highest heights of its three columns, the middle one.
fn medians_of_nine<T: Height>(rows: [&[T]; 3], medians: &mut [T]) {
    let least = |a: T, b: T| if b < a { b } else { a };
    let greatest = |a: T, b: T| if b < a { a } else { b };
    let middle = |[a, b, c]: [T; 3]| greatest(least(a, b), least(greatest(a, b), c));
    for (c, median) in medians.iter_mut().enumerate().skip(1).take(rows[0].len().saturating_sub(2)) {
        let column = |c: usize| rows.map(|row| row[c]);
        let columns = [column(c - 1), column(c), column(c + 1)];
        let low = columns.map(|[a, b, c]| least(least(a, b), c));
        let high = columns.map(|[a, b, c]| greatest(greatest(a, b), c));
        let low = greatest(greatest(low[0], low[1]), low[2]);
        let high = least(least(high[0], high[1]), high[2]);
        *median = middle([low, middle(columns.map(middle)), high]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn holes_take_the_nearest_height() {
        let mut s = stream(4, 4);
        for (columns, rows) in [(17, 9), (1, 30), (30, 1), (12, 12)] {
            let value = |i: usize, u: f64| if u < 0.06 || i == 5 { i as f64 } else { f64::NAN };
            let values: Vec<f64> = (0..columns * rows).map(|i| value(i, s.uniform())).collect();
            let raster = Raster::new([0.0; 2], 1.0, columns, values.clone()).unwrap();
            let raster = fill_holes(raster, &Monitor::default()).unwrap();
            let apart = |a: usize, b: usize| {
                let (dx, dy) = ((a % columns).abs_diff(b % columns), (a / columns).abs_diff(b / columns));
                dx * dx + dy * dy
            };
            for i in 0..values.len() {
                let least = (0..values.len()).filter(|&j| !values[j].is_nan()).map(|j| apart(i, j)).min();
                assert_eq!(Some(apart(i, raster.values()[i] as usize)), least);
            }
        }
        let empty = Raster::new([0.0; 2], 1.0, 2, vec![f64::NAN; 4]).unwrap();
        assert!(fill_holes(empty, &Monitor::default()).is_err());
    }

    #[test]
    fn medians_of_nine_are_those_of_sorted_windows() {
        let mut s = stream(4, 5);
        let (rows, columns) = (30, 23);
        let values: Vec<f32> = (0..rows * columns).map(|_| (s.uniform() * 12.0).floor() as f32 - 6.0).collect();
        let raster = Raster::new([0.0; 2], 1.0, columns, values.clone()).unwrap();
        let found = median(raster, 3, &Monitor::default()).unwrap();
        for (r, c) in (1..rows - 1).flat_map(|r| (1..columns - 1).map(move |c| (r, c))) {
            let mut window: Vec<f32> = (0..9).map(|i| values[(r + i / 3 - 1) * columns + c + i % 3 - 1]).collect();
            window.sort_by(f32::total_cmp);
            assert_eq!(found.values()[r * columns + c], window[4], "{r} {c}");
        }
    }

    #[test]
    fn the_median_takes_spikes_away() {
        let raster = Raster::new([0.0; 2], 1.0, 3, vec![1.0, 1.0, 1.0, 1.0, 90.0, 1.0, 1.0, 1.0, 2.0]).unwrap();
        let raster = median(raster, 3, &Monitor::default()).unwrap();
        assert_eq!(raster.values()[4], 1.0);
        // The window of a corner is the cell itself; that of a cell at a side lies along the side.
        assert_eq!((raster.values()[7], raster.values()[8]), (1.0, 2.0));
    }
}
