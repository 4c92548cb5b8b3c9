//! Rasters without holes and without spikes.

use super::holes::nearest_filled;
use crate::cloud::Raster;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, fill_parts};

/// Every hole takes the nearest height (distance between centres; ties are broken deterministically). O(cells).
///
/// # Errors
/// If there is no height at all, or the work was cancelled.
pub fn fill_holes(raster: Raster, monitor: &Monitor) -> Result<Raster> {
    let filled: Vec<bool> = raster.values().iter().map(|v| !v.is_nan()).collect();
    if !filled.contains(&true) {
        return Err(Error::input("a raster without any height"));
    }
    let source = nearest_filled(&filled, raster.columns(), monitor)?;
    monitor.check()?;
    let values = source.iter().map(|&s| raster.values()[s as usize]).collect();
    Ok(raster.with_values(values))
}

/// Replaces every height by the median of a window of that (odd) width around it. Near the border the window is
/// narrower but stays centred, so that a slope is not changed. O(cells width²).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn median(raster: Raster, width: usize, monitor: &Monitor) -> Result<Raster> {
    let (rows, columns, reach) = (raster.rows(), raster.columns(), width / 2);
    let mut smooth = vec![0.0; rows * columns];
    fill_parts(&mut smooth, columns, monitor, |r, line| {
        let up = reach.min(r).min(rows - 1 - r);
        let mut window = Vec::with_capacity(width * width);
        let middle = |c: usize| {
            let aside = reach.min(c).min(columns - 1 - c);
            window.clear();
            for row in r - up..=r + up {
                window.extend_from_slice(&raster.values()[row * columns..][c - aside..=c + aside]);
            }
            window.sort_unstable_by(f64::total_cmp);
            window[window.len() / 2]
        };
        line.iter_mut().zip((0..columns).map(middle)).for_each(|(smooth, height)| *smooth = height);
    })?;
    Ok(raster.with_values(smooth))
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
    fn the_median_takes_spikes_away() {
        let raster = Raster::new([0.0; 2], 1.0, 3, vec![1.0, 1.0, 1.0, 1.0, 90.0, 1.0, 1.0, 1.0, 2.0]).unwrap();
        let raster = median(raster, 3, &Monitor::default()).unwrap();
        assert_eq!(raster.values()[4], 1.0);
        // The window of a corner is the cell itself; that of a cell at a side lies along the side.
        assert_eq!((raster.values()[7], raster.values()[8]), (1.0, 2.0));
    }
}
