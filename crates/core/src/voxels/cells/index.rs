//! Finds occupied cells: by their key, and around every cell in turn.

use super::{CellKey, packed};
use std::ops::Range;

/// Entries of the table for each occupied cell, at most.
const ENTRIES: i64 = 1;

/// Keys of occupied cells, ascending, and a table of where they begin. An entry covers the cells of one slab, which have the
/// same number on the first axis, and of some rows, numbers on the second axis; in a cloud that is much longer than dense, it
/// covers several slabs and all rows. A search looks at one entry only, a few cells.
#[derive(Clone, Debug, Default)]
pub(crate) struct CellIndex<K> {
    keys: Vec<K>,
    /// Least number on each of the two axes.
    first: [i64; 2],
    /// An entry covers 2^shift numbers on each of the two axes.
    shift: [u32; 2],
    /// Entries of a slab.
    rows: i64,
    /// First cell of each entry, and the number of cells.
    starts: Vec<u32>,
}

impl<K: CellKey> CellIndex<K> {
    /// `keys` ascend. O(cells).
    pub(crate) fn new(keys: Vec<K>) -> Self {
        let slab = |key: Option<&K>| key.map_or(0, |key| key.axes()[0]);
        let (first, last) = (slab(keys.first()), slab(keys.last()));
        let on_second = || keys.iter().map(|key| key.axes()[1]);
        let (low, high) = (on_second().min().unwrap_or(0), on_second().max().unwrap_or(0));
        let most = ENTRIES * (keys.len() as i64 + 1);
        let shift = (0..63).find(|shift| (last - first) >> shift < most).unwrap_or(63);
        let slabs = ((last - first) >> shift) + 1;
        let few = |shift: &u32| ((high - low) >> shift) < most / slabs;
        let along = if shift == 0 { (0..63).find(few).unwrap_or(63) } else { 63 };
        let rows = ((high - low) >> along) + 1;
        let mut index = Self { keys: Vec::new(), first: [first, low], shift: [shift, along], rows, starts: Vec::new() };
        index.starts.reserve_exact((slabs * rows) as usize + 1);
        for (cell, key) in keys.iter().enumerate() {
            let entry = index.entry(key).map_or(0, |entry| entry as usize);
            index.starts.resize((entry + 1).max(index.starts.len()), cell as u32);
        }
        index.starts.push(keys.len() as u32);
        index.keys = keys;
        index
    }

    /// The entry of a key; that of the nearest row if the row is outside. `None` before the first slab.
    #[inline(always)]
    fn entry(&self, key: &K) -> Option<u64> {
        let [x, y, ..] = key.axes();
        let slab = u64::try_from((x - self.first[0]) >> self.shift[0]).ok()?;
        let row = ((y - self.first[1]) >> self.shift[1]).clamp(0, self.rows - 1);
        Some(slab * self.rows as u64 + row as u64)
    }

    /// The cells of an entry; none after the last.
    #[inline(always)]
    fn cells(&self, entry: u64) -> Option<Range<usize>> {
        let entry = entry as usize;
        Some(*self.starts.get(entry)? as usize..*self.starts.get(entry + 1)? as usize)
    }

    /// The cell of a key; `None` if it is empty.
    #[inline(always)]
    pub(crate) fn find(&self, key: K) -> Option<usize> {
        let cells = self.cells(self.entry(&key)?)?;
        let place = cells.start + before(&self.keys[cells.clone()], key);
        (place < cells.end && self.keys[place] == key).then_some(place)
    }

    /// The cell of each of some keys. What lies far apart in memory is read for many keys before the first is compared, so
    /// that the processor waits for all of it at once.
    pub(crate) fn find_each(&self, keys: &[K]) -> Vec<Option<u32>> {
        let mut found = Vec::with_capacity(keys.len());
        for keys in keys.chunks(AT_ONCE) {
            let (mut entries, mut firsts) = ([[0, 0]; AT_ONCE], [K::default(); AT_ONCE]);
            for (key, entry) in keys.iter().zip(&mut entries) {
                let cells = self.entry(key).and_then(|entry| self.cells(entry)).unwrap_or_default();
                *entry = [cells.start, cells.end];
            }
            for ([start, _], first) in entries.iter().zip(&mut firsts) {
                *first = self.keys.get(*start).copied().unwrap_or_default();
            }
            for ((&key, first), [start, end]) in keys.iter().zip(firsts).zip(entries) {
                let place = match start == end || first == key {
                    true => start,
                    false => start + before(&self.keys[start..end], key),
                };
                found.push((place < end && self.keys[place] == key).then_some(place as u32));
            }
        }
        found
    }

    /// The first cell that is not before this key; the number of cells if all are.
    #[inline(always)]
    pub(crate) fn seek(&self, key: K) -> usize {
        let Some(entry) = self.entry(&key) else { return 0 };
        let Some(cells) = self.cells(entry) else { return self.keys.len() };
        cells.start + before(&self.keys[cells], key)
    }

    /// The occupied cells from one key to another; meant for few.
    #[inline(always)]
    pub(crate) fn run(&self, from: K, to: K) -> Range<usize> {
        let start = self.seek(from);
        let within = self.keys[start..].iter().take_while(|&&key| !to.before(key));
        start..start + within.count()
    }

    /// The keys of all cells, ascending.
    pub(crate) fn keys(&self) -> &[K] {
        &self.keys
    }
}

/// Keys that are looked up at once.
const AT_ONCE: usize = 64;

/// Up to this many keys are compared one after the other.
const FEW: usize = 8;

/// How many of these keys, which ascend, are before another.
#[inline(always)]
fn before<K: CellKey>(keys: &[K], key: K) -> usize {
    match keys.len() {
        0..=FEW => keys.iter().take_while(|other| other.before(key)).count(),
        _ => keys.partition_point(|other| other.before(key)),
    }
}

/// A walk along ascending cells in plan that knows the occupied cells around the present one, `SIDE` rows on each side.
/// The start of each row around it only moves ahead, so that a step costs O(1) on average.
pub(crate) struct Walk<'a, const SIDE: usize> {
    keys: &'a [[i32; 2]],
    rows: Vec<Row>,
}

/// A row of the window.
struct Row {
    /// Offset in x.
    offset: i32,
    /// First cell of the row that is not before the window.
    start: usize,
}

impl<'a, const SIDE: usize> Walk<'a, SIDE> {
    /// A walk that begins at cell `first`.
    pub(crate) fn new(keys: &'a [[i32; 2]], first: usize) -> Self {
        let row = |offset: i32| {
            let from = Self::corner(keys[first], offset);
            Row { offset, start: keys.partition_point(|key| *key < from) }
        };
        Self { keys, rows: (-(SIDE as i32)..=SIDE as i32).map(row).collect() }
    }

    /// Calls `found` with each occupied cell around cell `c` (itself included), ascending, and its place in the window:
    /// 0..=2 `SIDE` on each axis. `c` must not be before the last one.
    pub(crate) fn around(&mut self, c: usize, mut found: impl FnMut(usize, [usize; 2])) {
        let keys = self.keys;
        for (i, row) in self.rows.iter_mut().enumerate() {
            let from = Self::corner(keys[c], row.offset);
            let (first, last) = (packed(from), packed([from[0], from[1].saturating_add(2 * SIDE as i32)]));
            let mut ahead = keys[row.start..].iter().map(|&key| packed(key)).enumerate();
            let Some((passed, mut key)) = ahead.find(|&(_, key)| key >= first) else {
                row.start = keys.len();
                continue;
            };
            row.start += passed;
            let mut near = row.start;
            while key <= last {
                found(near, [i, (key - first) as usize]);
                near += 1;
                let Some((_, next)) = ahead.next() else { break };
                key = next;
            }
        }
    }

    /// The first cell of the window around `key` in the row at this offset.
    fn corner(key: [i32; 2], offset: i32) -> [i32; 2] {
        [key[0].saturating_add(offset), key[1].saturating_sub(SIDE as i32)]
    }
}

/// The cells of block number `block`, of `size` cells, of `cells`.
pub(crate) fn block_of(block: usize, size: usize, cells: usize) -> Range<usize> {
    block * size..((block + 1) * size).min(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::Monitor;
    use crate::random::stream;
    use crate::voxels::cells::{Cells, cell_of};

    #[test]
    fn a_key_is_sought_as_in_the_whole_list() {
        for reach in [5.0, 300.0, 1e6] {
            let keys = keys(reach);
            let index = CellIndex::new(keys.clone());
            let mut s = stream(8, 9);
            for _ in 0..2000 {
                let key = cell_of([s.uniform() - 0.5, s.uniform() - 0.5].map(|v| 1.3 * v * reach));
                let first = keys.partition_point(|other| *other < key);
                let to = [key[0], key[1].saturating_add(2)];
                assert_eq!((index.seek(key), index.run(key, to)), (first, first..keys.partition_point(|k| *k <= to)));
            }
        }
        assert_eq!(CellIndex::<[i32; 2]>::new(Vec::new()).seek([3, 3]), 0);
    }

    fn keys(reach: f64) -> Vec<[i32; 2]> {
        let mut s = stream(3, 9);
        let at: Vec<[f64; 2]> = (0..3000).map(|_| [s.uniform() - 0.4, s.uniform() - 0.6].map(|v| v * reach)).collect();
        Cells::new(at.len(), |i| cell_of(at[i]), &Monitor::default()).unwrap().keys
    }

    #[test]
    fn cells_are_found_by_their_key_and_no_others() {
        for reach in [1.0, 40.0, 500.0, 4e9] {
            let index = CellIndex::new(keys(reach));
            for (c, &key) in index.keys.iter().enumerate() {
                assert_eq!(index.find(key), Some(c));
                let beside = [key[0], key[1].wrapping_add(1)];
                assert_eq!(index.find(beside), index.keys.binary_search(&beside).ok());
            }
            let beside: Vec<[i32; 2]> =
                index.keys.iter().flat_map(|&[x, y]| [[x, y], [y, x], [x.wrapping_add(1), y]]).collect();
            let each: Vec<Option<u32>> = beside.iter().map(|&key| index.find(key).map(|cell| cell as u32)).collect();
            assert_eq!(index.find_each(&beside), each);
            assert_eq!(index.find([i32::MAX, 0]), None);
            assert_eq!(index.find([i32::MIN, 0]), None);
        }
        assert_eq!(CellIndex::<[i32; 2]>::new(Vec::new()).find([0, 0]), None);
    }

    #[test]
    fn the_cells_around_are_those_of_looking_at_all() {
        let keys = keys(60.0);
        for first in [0, 700] {
            let mut walk = Walk::<2>::new(&keys, first);
            for c in first..keys.len() {
                let mut found = Vec::new();
                walk.around(c, |near, place| found.push((near, place)));
                let place = |key: [i32; 2]| [0, 1].map(|a| key[a] - keys[c][a] + 2);
                let inside = |key: [i32; 2]| place(key).iter().all(|v| (0..=4).contains(v));
                let expected: Vec<(usize, [usize; 2])> = (0..keys.len())
                    .filter(|&n| inside(keys[n]))
                    .map(|n| (n, place(keys[n]).map(|v| v as usize)))
                    .collect();
                assert_eq!(found, expected);
            }
        }
    }
}
