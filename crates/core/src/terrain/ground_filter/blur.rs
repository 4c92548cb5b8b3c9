//! Averages of a raster over squares.

use crate::cloud::Raster;
use crate::error::Result;
use crate::parallel::{Monitor, fill_parts};

/// The average over squares of 2 · reach + 1 cells, twice; beyond the border the height is that of the border.
/// O(cells · reach).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn blurred(raster: Raster<f32>, reach: usize, monitor: &Monitor) -> Result<Raster<f32>> {
    let once = averaged(raster, reach, monitor)?;
    averaged(once, reach, monitor)
}

fn averaged(raster: Raster<f32>, reach: usize, monitor: &Monitor) -> Result<Raster<f32>> {
    let (rows, columns) = (raster.rows(), raster.columns());
    let share = 1.0 / ((2 * reach + 1) * (2 * reach + 1)) as f64;
    let mut averages = vec![0.0; rows * columns];
    fill_parts(&mut averages, columns, monitor, |r, line| {
        // Sums of columns, with `reach` cells of the border on both sides.
        let mut sums = vec![0.0; columns + 2 * reach];
        for step in 0..=2 * reach {
            let row = (r + step).saturating_sub(reach).min(rows - 1);
            let values = &raster.values()[row * columns..][..columns];
            sums[reach..].iter_mut().zip(values).for_each(|(sum, &v)| *sum += f64::from(v));
        }
        let [first, last] = [sums[reach], sums[reach + columns - 1]];
        sums[..reach].fill(first);
        sums[reach + columns..].fill(last);
        let windows = sums.windows(2 * reach + 1).map(|w| (w.iter().sum::<f64>() * share) as f32);
        line.iter_mut().zip(windows).for_each(|(average, own)| *average = own);
    })?;
    Ok(raster.with_values(averages))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_stays_inside_and_one_peak_spreads_over_its_squares() {
        let plane: Vec<f32> = (0..300).map(|i| (i % 20) as f32 * 0.5 - (i / 20) as f32).collect();
        let raster = Raster::new([0.0; 2], 1.0, 20, plane.clone()).unwrap();
        let found = blurred(raster, 2, &Monitor::default()).unwrap();
        for i in (0..300).filter(|i| (4..16).contains(&(i % 20)) && (4..11).contains(&(i / 20))) {
            assert!((found.values()[i] - plane[i]).abs() < 1e-5);
        }
        let mut peak = vec![0.0f32; 121];
        peak[60] = 81.0;
        let found = blurred(Raster::new([0.0; 2], 1.0, 11, peak).unwrap(), 1, &Monitor::default()).unwrap();
        // Two squares of 3 cells: weights 1, 2, 3, 2, 1 along both axes.
        for (i, v) in found.values().iter().enumerate() {
            let weight = |a: usize| 3usize.saturating_sub(a.abs_diff(5)) as f32;
            assert!((v - weight(i % 11) * weight(i / 11)).abs() < 1e-5, "{i}: {v}");
        }
    }
}
