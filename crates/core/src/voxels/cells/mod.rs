//! Items sorted into the cells of a grid. Cells are found by sorted keys instead of a hash table, so that their order
//! is the same on every machine.

pub(crate) mod index;
pub(crate) mod radix;

use crate::csr::Csr;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, sort_watched, watched};
use radix::{Bits, radix_sort};
use std::ops::Range;

/// The cell that holds a position, of a grid without bounds with a corner at the origin: its number on each axis. Cells
/// sort by x, then y (then z). `at` is counted in edges of the grid, so that its division has the precision of the
/// caller's coordinates. Cells beyond 2^31 edges from the origin are one.
#[inline(always)]
pub(crate) fn cell_of<const N: usize>(at: [f64; N]) -> [i32; N] {
    at.map(|v| {
        let towards_zero = v as i32;
        towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > v))
    })
}

/// The key of a cell: as many numbers as the grid has axes, by which cells sort, the first before the second.
pub(crate) trait CellKey: Copy + Default + Ord + Send + Sync {
    /// The numbers; 0 for axes that the grid does not have.
    fn axes(self) -> [i64; 3];

    /// The key of these numbers.
    fn of(axes: [i64; 3]) -> Self;

    /// Whether it sorts before another key.
    #[inline(always)]
    fn before(self, other: Self) -> bool {
        self < other
    }
}

/// A number that sorts as the key of a cell in plan does: one comparison in place of two.
#[inline(always)]
fn packed([x, y]: [i32; 2]) -> i64 {
    i64::from(x) << 32 | i64::from(y as u32 ^ 1 << 31)
}

impl CellKey for [i32; 2] {
    #[inline(always)]
    fn axes(self) -> [i64; 3] {
        [i64::from(self[0]), i64::from(self[1]), 0]
    }

    #[inline(always)]
    fn of(axes: [i64; 3]) -> Self {
        [axes[0] as i32, axes[1] as i32]
    }

    #[inline(always)]
    fn before(self, other: Self) -> bool {
        packed(self) < packed(other)
    }
}

impl CellKey for [i32; 3] {
    #[inline(always)]
    fn axes(self) -> [i64; 3] {
        self.map(i64::from)
    }

    #[inline(always)]
    fn of(axes: [i64; 3]) -> Self {
        axes.map(|axis| axis as i32)
    }
}

/// Items by occupied cell: cells ascend by key, items within a cell ascend. Keys are those of [`cell_of`], or those of a
/// [`RowGrid`](super::rows::RowGrid).
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells<K> {
    pub(crate) keys: Vec<K>,
    /// First item of each cell, and the number of items.
    pub(crate) starts: Vec<u32>,
    pub(crate) items: Vec<u32>,
}

impl<K: CellKey> Cells<K> {
    /// Sorts `len` items by their keys. O(len), 4 bytes an item, and 16 to 32 temporary ones.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(crate) fn new(len: usize, key: impl Fn(usize) -> K + Sync, monitor: &Monitor) -> Result<Self> {
        let extent = Extent::of(len, &key, monitor)?;
        match extent.bits() {
            0..=32 => {
                let row = |i: usize| extent.pack(key(i)) << 32 | i as u64;
                let mut rows = map_watched(len, monitor, row)?;
                radix_sort(&mut rows, Bits { from: 32, count: extent.bits() }, |row| *row, monitor)?;
                Self::of_sorted(rows.into_iter().map(|row| (extent.key(row >> 32), row as u32)), len, monitor)
            }
            33..=64 => {
                let mut rows = map_watched(len, monitor, |i| (extent.pack(key(i)), i as u32))?;
                radix_sort(&mut rows, Bits { from: 0, count: extent.bits() }, |row| row.0, monitor)?;
                Self::of_sorted(rows.into_iter().map(|(key, item)| (extent.key(key), item)), len, monitor)
            }
            _ => {
                let mut rows = map_watched(len, monitor, |i| (key(i), i as u32))?;
                sort_watched(&mut rows, monitor)?;
                Self::of_sorted(rows.into_iter(), len, monitor)
            }
        }
    }

    /// The cells of sorted items.
    fn of_sorted(mut rows: impl Iterator<Item = (K, u32)>, len: usize, monitor: &Monitor) -> Result<Self> {
        let mut cells = Self { keys: Vec::new(), starts: Vec::new(), items: Vec::with_capacity(len) };
        for piece in watched(len, monitor) {
            for (key, item) in rows.by_ref().take(piece?.len()) {
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

/// The least box of cells that holds all keys; inside it a key is a short number.
struct Extent {
    low: [i64; 3],
    /// Bits of the numbers on each axis.
    widths: [u32; 3],
}

impl Extent {
    fn of<K: CellKey>(len: usize, key: &impl Fn(usize) -> K, monitor: &Monitor) -> Result<Self> {
        let (mut low, mut high) = ([i64::MAX; 3], [i64::MIN; 3]);
        for piece in watched(len, monitor) {
            for i in piece? {
                let axes = key(i).axes();
                (0..3).for_each(|a| (low[a], high[a]) = (low[a].min(axes[a]), high[a].max(axes[a])));
            }
        }
        let width = |a: usize| if low[a] < high[a] { (high[a] - low[a]).ilog2() + 1 } else { 0 };
        Ok(Self { low, widths: [0, 1, 2].map(width) })
    }

    /// Bits of a packed key.
    fn bits(&self) -> u32 {
        self.widths.iter().sum()
    }

    /// The number of a key: it sorts as the key does.
    #[inline(always)]
    fn pack<K: CellKey>(&self, key: K) -> u64 {
        let axes = key.axes();
        (0..3).fold(0, |packed, a| packed << self.widths[a] | (axes[a] - self.low[a]) as u64)
    }

    /// The key of a number.
    #[inline(always)]
    fn key<K: CellKey>(&self, mut packed: u64) -> K {
        let mut axes = self.low;
        for a in [2, 1, 0] {
            axes[a] += (packed & ((1 << self.widths[a]) - 1)) as i64;
            packed >>= self.widths[a];
        }
        K::of(axes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// Items sorted by keys of few bits, of more than 32 and of more than 64.
    #[test]
    fn items_stand_as_a_stable_sort_leaves_them() {
        let mut s = stream(7, 1);
        for reach in [0.0, 3.0, 900.0, 70_000.0, 4e9] {
            let keys: Vec<[i32; 3]> = (0..5000)
                .map(|_| cell_of([s.uniform(), s.uniform() - 0.5, s.uniform()].map(|v| (v - 0.5) * reach)))
                .collect();
            let mut expected: Vec<u32> = (0..5000).collect();
            expected.sort_by_key(|&i| keys[i as usize]);
            let cells = Cells::new(keys.len(), |i| keys[i], &Monitor::default()).unwrap();
            assert_eq!(cells.items, expected, "{reach}");
            assert!((0..cells.len()).all(|c| cells.of(c).iter().all(|&i| keys[i as usize] == cells.keys[c])));
            assert!(cells.keys.is_sorted_by(|a, b| a < b), "{reach}");
        }
        assert_eq!(Cells::<[i32; 2]>::new(0, |_| [0, 0], &Monitor::default()).unwrap().len(), 0);
    }

    #[test]
    fn keys_in_plan_sort_as_their_numbers() {
        let some = [i32::MIN, -7, -1, 0, 3, i32::MAX];
        let keys: Vec<[i32; 2]> = some.iter().flat_map(|&x| some.map(|y| [x, y])).collect();
        for &a in &keys {
            assert!(keys.iter().all(|&b| a.before(b) == (a < b)), "{a:?}");
        }
    }

    #[test]
    fn cells_below_the_origin_have_negative_numbers_and_a_border_belongs_to_the_cell_above() {
        assert_eq!(cell_of([-0.5, 0.0, 1.0]), [-1, 0, 1]);
        assert_eq!(cell_of([1e300, f64::NEG_INFINITY]), [i32::MAX, i32::MIN]);
        let mut s = stream(2, 2);
        for v in (0..1000).map(|_| (s.uniform() - 0.5) * 5e9).chain([-0.0, -1.0, 2.0, f64::NAN, -2_147_483_648.5]) {
            assert_eq!(cell_of([v]), [v.floor() as i32], "{v}");
        }
    }

    #[test]
    fn items_of_a_cell_ascend_and_cells_sort_by_x_then_y() {
        let at = [[1.5, 0.0], [0.5, 2.0], [1.9, 0.9], [0.5, 0.5], [-0.1, 9.0]];
        let cells = Cells::new(at.len(), |i| cell_of(at[i]), &Monitor::default()).unwrap();
        assert_eq!(cells.keys, [[-1, 9], [0, 0], [0, 2], [1, 0]]);
        assert_eq!((0..4).map(|c| cells.of(c)).collect::<Vec<_>>(), [&[4][..], &[3], &[1], &[0, 2]]);
    }
}
