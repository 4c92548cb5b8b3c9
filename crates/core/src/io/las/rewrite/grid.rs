//! A common scale and offset that represents the coordinates of several files exactly.

use crate::error::{Error, Result};
use crate::io::las::header::Header;
use std::path::Path;

/// Coordinates whose distance from the grid exceeds this, in ticks, are not on it.
const SLACK: f64 = 1e-4;

/// Scale and offset of the output.
pub(super) struct Grid {
    pub(super) scale: [f64; 3],
    pub(super) offset: [f64; 3],
}

impl Grid {
    /// The finest of the scales, and the first offset, shifted by whole ticks if the coordinates do not fit otherwise.
    ///
    /// # Errors
    /// If a scale is not an integer multiple of the finest, or an offset is not an integer number of ticks from the
    /// first.
    pub(super) fn common(files: &[(&Path, &Header)]) -> Result<Self> {
        let Some((_, first)) = files.first() else { return Err(Error::input("nothing to merge")) };
        let mut grid = Self { scale: first.scale, offset: first.offset };
        for a in 0..3 {
            grid.scale[a] = files.iter().map(|(_, h)| h.scale[a]).fold(f64::INFINITY, f64::min);
            for (path, header) in files {
                let factor = header.scale[a] / grid.scale[a];
                let shift = (header.offset[a] - first.offset[a]) / grid.scale[a];
                let whole = |v: f64| (v - v.round()).abs() <= SLACK && v.abs() < 1e15;
                if !(whole(factor) && (factor - factor.round()).abs() <= 1e-9 * factor && whole(shift)) {
                    let text = format!("scale {} and offset {} of axis {a}", header.scale[a], header.offset[a]);
                    let wanted =
                        format!("no grid of scale {} from {} holds them exactly", grid.scale[a], first.offset[a]);
                    return Err(Error::input(format!("{}: {text}: {wanted}", path.display())));
                }
            }
            grid.centre(a, files);
        }
        Ok(grid)
    }

    /// Shifts the offset if ticks would exceed 32 bits.
    fn centre(&mut self, a: usize, files: &[(&Path, &Header)]) {
        let filled = || files.iter().filter(|(_, h)| h.points > 0 && h.low[a] <= h.high[a]);
        let low = filled().map(|(_, h)| h.low[a]).fold(f64::INFINITY, f64::min);
        let high = filled().map(|(_, h)| h.high[a]).fold(f64::NEG_INFINITY, f64::max);
        let ticks = |v: f64| ((v - self.offset[a]) / self.scale[a]).abs();
        if low <= high && ticks(low).max(ticks(high)) > f64::from(i32::MAX) {
            let middle = (low + (high - low) / 2.0 - self.offset[a]) / self.scale[a];
            self.offset[a] += middle.round() * self.scale[a];
        }
    }

    /// Factor and shift that convert a file's ticks to this grid; (1, 0) for no change.
    pub(super) fn ticks(&self, header: &Header) -> [(i64, i64); 3] {
        [0, 1, 2].map(|a| {
            let factor = (header.scale[a] / self.scale[a]).round() as i64;
            (factor, ((header.offset[a] - self.offset[a]) / self.scale[a]).round() as i64)
        })
    }
}
