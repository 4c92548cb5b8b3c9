//! Minimum, maximum and morphological opening of heights in square windows.

use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};

/// Lines of a grid that are filtered together.
const LINES: usize = 64;

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
    /// The largest heights of the least ones: objects narrower than the window disappear. O(cells log reach).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn opened(self, values: &[f64], monitor: &Monitor) -> Result<Vec<f64>> {
        self.filtered(&self.filtered(values, Extreme::Least, monitor)?, Extreme::Greatest, monitor)
    }

    /// The least heights of the largest ones: pits narrower than the window disappear. O(cells log reach).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn closed(self, values: &[f64], monitor: &Monitor) -> Result<Vec<f64>> {
        self.filtered(&self.filtered(values, Extreme::Greatest, monitor)?, Extreme::Least, monitor)
    }

    fn filtered(self, values: &[f64], extreme: Extreme, monitor: &Monitor) -> Result<Vec<f64>> {
        let turned = self.along_rows(values, extreme, monitor)?;
        Self { columns: values.len() / self.columns, ..self }.along_rows(&turned, extreme, monitor)
    }

    /// The extreme values along the rows, transposed.
    fn along_rows(self, values: &[f64], extreme: Extreme, monitor: &Monitor) -> Result<Vec<f64>> {
        let (columns, rows) = (self.columns, values.len() / self.columns);
        // Each strip of rows is transposed as it is written: `strip[c * height + r]`.
        let strips = map_ordered(rows.div_ceil(LINES), monitor, |s| {
            let part = &values[s * LINES * columns..((s + 1) * LINES).min(rows) * columns];
            let height = part.len() / columns;
            let mut strip = vec![0.0; part.len()];
            let mut line = Line::new(columns, self.reach);
            for (r, row) in part.chunks_exact(columns).enumerate() {
                let found = match extreme {
                    Extreme::Least => line.extremes(row, f64::INFINITY, |a, b| if a < b { a } else { b }),
                    Extreme::Greatest => line.extremes(row, f64::NEG_INFINITY, |a, b| if a > b { a } else { b }),
                };
                found.iter().enumerate().for_each(|(c, &v)| strip[c * height + r] = v);
            }
            Ok(strip)
        })?;
        let turned = map_ordered(columns.div_ceil(LINES), monitor, |block| {
            let block = block * LINES..((block + 1) * LINES).min(columns);
            let mut lines = Vec::with_capacity(block.len() * rows);
            for c in block {
                for strip in &strips {
                    let height = strip.len() / columns;
                    lines.extend_from_slice(&strip[c * height..(c + 1) * height]);
                }
            }
            Ok(lines)
        })?;
        concat_watched(turned, monitor)
    }
}

/// Sliding windows along a line of cells.
struct Line {
    reach: usize,
    /// The line, with `reach` cells more on both sides.
    cells: Vec<f64>,
}

impl Line {
    fn new(columns: usize, reach: usize) -> Self {
        Self { reach, cells: vec![0.0; columns + 2 * reach] }
    }

    /// The extreme value of each window. `outside` is never one. Windows of 1, 2, 4, ... cells are joined in pairs, and
    /// two that overlap give the last width: O(cells log reach), in vector instructions.
    fn extremes(&mut self, row: &[f64], outside: f64, better: impl Fn(f64, f64) -> f64) -> &[f64] {
        self.cells.fill(outside);
        self.cells[self.reach..self.reach + row.len()].copy_from_slice(row);
        let (width, mut span) = (2 * self.reach + 1, 1);
        while 2 * span <= width {
            self.join(span, &better);
            span *= 2;
        }
        self.join(width - span, &better);
        &self.cells[..row.len()]
    }

    /// Joins the window that begins at each cell with the one that begins `span` cells later.
    fn join(&mut self, span: usize, better: &impl Fn(f64, f64) -> f64) {
        for i in 0..self.cells.len() - span {
            self.cells[i] = better(self.cells[i], self.cells[i + span]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn windows_have_the_extremes_that_looking_everywhere_finds() {
        let mut s = stream(5, 1);
        for [columns, rows, reach] in [[1, 1, 3], [70, 3, 1], [3, 130, 2], [65, 66, 5], [20, 90, 30]] {
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
