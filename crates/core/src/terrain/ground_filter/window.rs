//! Minimum, maximum, morphological opening and closing of heights in square and octagonal windows.

use crate::error::Result;
use crate::parallel::{Monitor, fill_parts};
use std::ops::Range;

/// Rows of a grid that are filtered together; those around them are needed too.
const ROWS: usize = 128;

/// A window around each cell of a grid, clipped at its border: a square, moved along both diagonals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// Cells in a row of the grid.
    columns: usize,
    /// Cells from the middle of the square to its edge.
    square: usize,
    /// Cells by which the square is moved, to either side along each of the diagonals.
    diagonal: usize,
}

/// Heights after an opening, and memory that the next one uses again.
#[derive(Default)]
pub(super) struct Opening {
    pub(super) opened: Vec<f32>,
    least: Vec<f32>,
}

#[derive(Clone, Copy)]
enum Extreme {
    Least,
    Greatest,
}

impl Window {
    /// A square of 2 · reach + 1 cells.
    pub(super) fn square(columns: usize, reach: usize) -> Self {
        Self { columns, square: reach, diagonal: 0 }
    }

    /// The octagon of cells that is nearest to a regular one; a square if the reach is 1 or 2.
    pub(super) fn octagon(columns: usize, reach: usize) -> Self {
        let diagonal = ((reach as f64 / (2.0 + f64::sqrt(2.0))).round() as usize).min(reach.saturating_sub(1) / 2);
        Self { columns, square: reach - 2 * diagonal, diagonal }
    }

    /// Cells from the middle to the edge.
    fn reach(self) -> usize {
        self.square + 2 * self.diagonal
    }

    /// Opening, the maximum of the minima: objects narrower than the window disappear. O(cells log reach).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn open(self, values: &[f32], opening: &mut Opening, monitor: &Monitor) -> Result<()> {
        self.filter(values, Extreme::Least, &mut opening.least, monitor)?;
        self.filter(&opening.least, Extreme::Greatest, &mut opening.opened, monitor)
    }

    /// Closing, the minimum of the maxima: pits narrower than the window disappear. O(cells log reach).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn closed(self, values: &[f32], monitor: &Monitor) -> Result<Vec<f32>> {
        let (mut greatest, mut closed) = (Vec::new(), Vec::new());
        self.filter(values, Extreme::Greatest, &mut greatest, monitor)?;
        self.filter(&greatest, Extreme::Least, &mut closed, monitor)?;
        Ok(closed)
    }

    /// Replaces `found` by the extreme values.
    fn filter(self, values: &[f32], extreme: Extreme, found: &mut Vec<f32>, monitor: &Monitor) -> Result<()> {
        let rows = values.len() / self.columns;
        found.resize(values.len(), 0.0);
        fill_parts(found, ROWS * self.columns, monitor, |number, part| {
            let own = number * ROWS..((number + 1) * ROWS).min(rows);
            let block = match extreme {
                Extreme::Least => self.of_rows(values, own, f32::INFINITY, |a, b| if a < b { a } else { b }),
                Extreme::Greatest => self.of_rows(values, own, f32::NEG_INFINITY, |a, b| if a > b { a } else { b }),
            };
            // The window that begins at this column has its middle at the first column of the grid.
            let first = self.reach() - self.square;
            let lines = block.chunks_exact(self.columns + 2 * self.reach());
            part.chunks_exact_mut(self.columns).zip(lines).for_each(|(own, line)| {
                own.copy_from_slice(&line[first..][..self.columns]);
            });
        })
    }

    /// The extreme values of some rows, and of the columns and rows that their windows reach: first along all of these rows,
    /// then across them and along the diagonals. `outside` is never an extreme value.
    fn of_rows(self, values: &[f32], rows: Range<usize>, outside: f32, better: impl Fn(f32, f32) -> f32) -> Vec<f32> {
        let Self { columns, square, diagonal } = self;
        let (reach, width) = (self.reach(), columns + 2 * self.reach());
        let mut block = vec![outside; (rows.len() + 2 * reach) * width];
        let inside = rows.start.saturating_sub(reach)..(rows.end + reach).min(values.len() / columns);
        for row in inside {
            let line = &mut block[(row + reach - rows.start) * width..][..width];
            line[reach..reach + columns].copy_from_slice(&values[row * columns..][..columns]);
            slide(line, 1, 2 * square + 1, &better);
        }
        slide(&mut block, width, 2 * square + 1, &better);
        slide(&mut block, width + 1, 2 * diagonal + 1, &better);
        slide(&mut block, width - 1, 2 * diagonal + 1, &better);
        block
    }
}

/// Replaces each cell by the extreme value of the `count` cells, `step` apart, that begin there. Windows of 1, 2, 4, ...
/// cells are joined in pairs, and two that overlap give the last width, all in vector instructions.
fn slide(cells: &mut [f32], step: usize, count: usize, better: &impl Fn(f32, f32) -> f32) {
    let mut join = |span: usize| {
        for i in 0..cells.len() - span * step {
            cells[i] = better(cells[i], cells[i + span * step]);
        }
    };
    let mut span = 1;
    while 2 * span <= count {
        join(span);
        span *= 2;
    }
    if count > span {
        join(count - span);
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
            let values: Vec<f32> = (0..columns * rows).map(|_| (s.uniform() * 20.0).floor() as f32).collect();
            for window in [Window::square(columns, reach), Window::octagon(columns, reach)] {
                let around = |i: usize| {
                    let (r, c) = (i / columns, i % columns);
                    let near = move |&j: &usize| {
                        let [x, y] = [(j % columns).abs_diff(c), (j / columns).abs_diff(r)];
                        x.max(y) <= reach && x + y <= 2 * (window.square + window.diagonal)
                    };
                    let values = &values;
                    (0..values.len()).filter(near).map(move |j| values[j])
                };
                // What is left of a larger grid must not matter.
                let (mut least, mut greatest) = (vec![-1.0; 9000], Vec::new());
                window.filter(&values, Extreme::Least, &mut least, &Monitor::default()).unwrap();
                window.filter(&values, Extreme::Greatest, &mut greatest, &Monitor::default()).unwrap();
                assert_eq!([least.len(), greatest.len()], [values.len(); 2]);
                for i in 0..values.len() {
                    assert_eq!(least[i], around(i).fold(f32::INFINITY, f32::min), "{window:?} {rows} at {i}");
                    assert_eq!(greatest[i], around(i).fold(f32::NEG_INFINITY, f32::max));
                }
            }
        }
    }

    #[test]
    fn openings_lower_and_closings_raise_and_both_do_it_once() {
        let mut s = stream(5, 2);
        let values: Vec<f32> = (0..40 * 30).map(|_| s.uniform() as f32).collect();
        let (window, monitor) = (Window::octagon(40, 3), Monitor::default());
        let (mut opening, closed) = (Opening::default(), window.closed(&values, &monitor).unwrap());
        window.open(&values, &mut opening, &monitor).unwrap();
        let opened = opening.opened.clone();
        assert!(values.iter().zip(&opened).all(|(v, o)| o <= v) && values.iter().zip(&closed).all(|(v, c)| c >= v));
        window.open(&opened, &mut opening, &monitor).unwrap();
        assert_eq!(opening.opened, opened);
        assert_eq!(window.closed(&closed, &monitor).unwrap(), closed);
    }
}
