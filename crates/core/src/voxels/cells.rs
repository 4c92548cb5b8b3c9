//! Items sorted into the cells of a grid. Cells are found by sorted keys instead of a hash table, so that their order
//! is the same on every machine.

use crate::csr::Csr;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, sort_watched, watched};
use std::ops::Range;

/// The cell that holds a position, of a grid without bounds with a corner at the origin: its number on each axis. Cells
/// sort by x, then y (then z). `at` is counted in edges of the grid, so that its division has the precision of the
/// caller's coordinates. Cells beyond 2^31 edges from the origin are one.
#[inline(always)]
pub(crate) fn cell_of<const N: usize>(at: [f64; N]) -> [i32; N] {
    at.map(|v| v.floor() as i32)
}

/// Items by occupied cell: cells ascend by key, items within a cell ascend. Keys are those of [`cell_of`], or those of a
/// [`RowGrid`](super::rows::RowGrid).
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells<K> {
    pub(crate) keys: Vec<K>,
    starts: Vec<u32>,
    pub(crate) items: Vec<u32>,
}

impl<K: Copy + Default + Ord + Send> Cells<K> {
    /// Sorts `len` items by their keys. O(len log len), 4 bytes an item, and a key and 4 bytes of temporary ones.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(crate) fn new(len: usize, key: impl Fn(usize) -> K + Sync, monitor: &Monitor) -> Result<Self> {
        let mut rows: Vec<(K, u32)> = map_watched(len, monitor, |i| (key(i), i as u32))?;
        if rows.windows(2).any(|w| w[0].0 > w[1].0) {
            sort_watched(&mut rows, monitor)?;
        }
        let mut cells = Self { keys: Vec::new(), starts: Vec::new(), items: Vec::new() };
        cells.items.reserve_exact(len);
        for piece in watched(len, monitor) {
            for &(key, item) in &rows[piece?] {
                if cells.keys.last() != Some(&key) {
                    cells.keys.push(key);
                    cells.starts.push(cells.items.len() as u32);
                }
                cells.items.push(item);
            }
        }
        cells.starts.push(len as u32);
        Ok(cells)
    }

    /// The items alone, by cell; `items` is how many there are.
    ///
    /// # Errors
    /// Never.
    pub(crate) fn into_groups(self, items: usize) -> Result<Csr> {
        Csr::new(self.starts, self.items, items)
    }

    /// Number of occupied cells.
    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    /// Range of a cell in `items`.
    pub(crate) fn range(&self, cell: usize) -> Range<usize> {
        self.starts[cell] as usize..self.starts[cell + 1] as usize
    }

    /// Items of a cell.
    pub(crate) fn of(&self, cell: usize) -> &[u32] {
        &self.items[self.range(cell)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_below_the_origin_have_negative_numbers_and_a_border_belongs_to_the_cell_above() {
        assert_eq!(cell_of([-0.5, 0.0, 1.0]), [-1, 0, 1]);
        assert_eq!(cell_of([1e300, f64::NEG_INFINITY]), [i32::MAX, i32::MIN]);
    }

    #[test]
    fn items_of_a_cell_ascend_and_cells_sort_by_x_then_y() {
        let at = [[1.5, 0.0], [0.5, 2.0], [1.9, 0.9], [0.5, 0.5], [-0.1, 9.0]];
        let cells = Cells::new(at.len(), |i| cell_of(at[i]), &Monitor::default()).unwrap();
        assert_eq!(cells.keys, [[-1, 9], [0, 0], [0, 2], [1, 0]]);
        assert_eq!((0..4).map(|c| cells.of(c)).collect::<Vec<_>>(), [&[4][..], &[3], &[1], &[0, 2]]);
    }
}
