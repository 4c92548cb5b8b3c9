//! Minimum, maximum, morphological opening and closing of heights in square windows.

use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};
use std::ops::Range;

/// Rows of a grid that are filtered together; those around them are needed too.
const ROWS: usize = 128;

/// A square window of 2 · reach + 1 cells around each cell of a grid, clipped at its border.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// Cells in a row of the grid.
    pub(super) columns: usize,
    /// Cells from the middle of the window to its edge.
    pub(super) reach: usize,
}

#[derive(Clone, Copy)]
enum Extreme {
    Least,
    Greatest,
}

impl Window {
    /// Opening, the maximum of the minima: objects narrower than the window disappear. O(cells log reach).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn opened(self, values: &[f64], monitor: &Monitor) -> Result<Vec<f64>> {
        self.filtered(&self.filtered(values, Extreme::Least, monitor)?, Extreme::Greatest, monitor)
    }

    /// Closing, the minimum of the maxima: pits narrower than the window disappear. O(cells log reach).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn closed(self, values: &[f64], monitor: &Monitor) -> Result<Vec<f64>> {
        self.filtered(&self.filtered(values, Extreme::Greatest, monitor)?, Extreme::Least, monitor)
    }

    fn filtered(self, values: &[f64], extreme: Extreme, monitor: &Monitor) -> Result<Vec<f64>> {
        let rows = values.len() / self.columns;
        let parts = map_ordered(rows.div_ceil(ROWS), monitor, |part| {
            let part = part * ROWS..((part + 1) * ROWS).min(rows);
            Ok(match extreme {
                Extreme::Least => self.of_rows(values, part, f64::INFINITY, |a, b| if a < b { a } else { b }),
                Extreme::Greatest => self.of_rows(values, part, f64::NEG_INFINITY, |a, b| if a > b { a } else { b }),
            })
        })?;
        concat_watched(parts, monitor)
    }

    /// The extreme values of some rows: first along all rows that their windows reach, then across them. `outside` is
    /// never an extreme value.
    fn of_rows(self, values: &[f64], rows: Range<usize>, outside: f64, better: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let Self { columns, reach } = self;
        let mut block = vec![outside; (rows.len() + 2 * reach) * columns];
        let mut line = vec![outside; columns + 2 * reach];
        let inside = rows.start.saturating_sub(reach)..(rows.end + reach).min(values.len() / columns);
        for row in inside {
            line[reach..reach + columns].copy_from_slice(&values[row * columns..][..columns]);
            line[reach + columns..].fill(outside);
            line[..reach].fill(outside);
            self.slide(&mut line, 1, &better);
            block[(row + reach - rows.start) * columns..][..columns].copy_from_slice(&line[..columns]);
        }
        self.slide(&mut block, columns, &better);
        block.truncate(rows.len() * columns);
        block
    }

    /// Replaces each cell by the extreme value of the window that begins there, of cells `step` apart. Windows of 1, 2,
    /// 4, ... cells are joined in pairs, and two that overlap give the last width, all in vector instructions.
    fn slide(self, cells: &mut [f64], step: usize, better: &impl Fn(f64, f64) -> f64) {
        let mut join = |span: usize| {
            for i in 0..cells.len() - span * step {
                cells[i] = better(cells[i], cells[i + span * step]);
            }
        };
        let (width, mut span) = (2 * self.reach + 1, 1);
        while 2 * span <= width {
            join(span);
            span *= 2;
        }
        join(width - span);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn windows_have_the_extremes_that_looking_everywhere_finds() {
        let mut s = stream(5, 1);
        for [columns, rows, reach] in [[1, 1, 3], [70, 3, 1], [3, 130, 2], [65, 66, 5], [20, 90, 30], [7, 600, 9]] {
            let values: Vec<f64> = (0..columns * rows).map(|_| (s.uniform() * 20.0).floor()).collect();
            let around = |i: usize| {
                let (r, c) = (i / columns, i % columns);
                let lines = r.saturating_sub(reach)..=(r + reach).min(rows - 1);
                let values = &values;
                lines.flat_map(move |r| {
                    (c.saturating_sub(reach)..=(c + reach).min(columns - 1)).map(move |c| values[r * columns + c])
                })
            };
            let window = Window { columns, reach };
            let least = window.filtered(&values, Extreme::Least, &Monitor::default()).unwrap();
            let greatest = window.filtered(&values, Extreme::Greatest, &Monitor::default()).unwrap();
            for i in 0..values.len() {
                assert_eq!(least[i], around(i).fold(f64::INFINITY, f64::min), "{columns} {rows} {reach} at {i}");
                assert_eq!(greatest[i], around(i).fold(f64::NEG_INFINITY, f64::max));
            }
        }
    }

    #[test]
    fn openings_lower_and_closings_raise_and_both_do_it_once() {
        let mut s = stream(5, 2);
        let values: Vec<f64> = (0..40 * 30).map(|_| s.uniform()).collect();
        let (window, monitor) = (Window { columns: 40, reach: 2 }, Monitor::default());
        let (opened, closed) = (window.opened(&values, &monitor).unwrap(), window.closed(&values, &monitor).unwrap());
        assert!(values.iter().zip(&opened).all(|(v, o)| o <= v) && values.iter().zip(&closed).all(|(v, c)| c >= v));
        assert_eq!(window.opened(&opened, &monitor).unwrap(), opened);
        assert_eq!(window.closed(&closed, &monitor).unwrap(), closed);
    }
}
