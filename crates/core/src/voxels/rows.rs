//! A grid of cubes whose keys run along rows, so that the neighbours of a cell are found by few searches.

use super::cells::{CellKey, Cells};
use super::morton;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use rayon::prelude::*;
use std::ops::Range;

/// Bits per axis of a cell key.
const BITS: u32 = morton::LIMIT.trailing_zeros();
/// Empty cells before the first one on each axis, so that neighbours have no negative index.
const MARGIN: i64 = 2;
/// Cells whose neighbours one task looks up.
const BLOCK: usize = 4096;

/// Mask of the bits of an axis.
const AXIS: u64 = (1 << BITS) - 1;

impl CellKey for u64 {
    #[inline(always)]
    fn axes(self) -> [i64; 3] {
        [self >> (2 * BITS), self >> BITS & AXIS, self & AXIS].map(|axis| axis as i64)
    }

    #[inline(always)]
    fn of(axes: [i64; 3]) -> Self {
        let [y, z, x] = axes.map(|axis| axis as u64);
        y << (2 * BITS) | z << BITS | x
    }
}

/// A grid of cubes with a corner at the origin of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RowGrid {
    size: f64,
    first: [i64; 3],
}

/// The largest whole number that is not greater; without the call that `f64::floor` is where the processor may lack it.
#[inline(always)]
fn floor(v: f64) -> i64 {
    let towards_zero = v as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > v))
}

impl RowGrid {
    /// A grid that holds all points. `name` is the parameter that gave the size, for the error message.
    ///
    /// # Errors
    /// If a coordinate is not finite, or the points need 2^21 cells or more along an axis.
    pub(crate) fn new(places: impl Iterator<Item = [f32; 3]>, size: f64, name: &'static str) -> Result<Self> {
        let (mut low, mut high, mut finite) = ([f32::MAX; 3], [f32::MIN; 3], true);
        for place in places {
            for a in 0..3 {
                (low[a], high[a]) = (low[a].min(place[a]), high[a].max(place[a]));
                finite &= place[a].is_finite();
            }
        }
        if !finite {
            return Err(Error::input("a coordinate is not finite (allowed: finite numbers)"));
        }
        let mut first = [0; 3];
        for (((of, low), high), first) in ["x", "y", "z"].into_iter().zip(low).zip(high).zip(&mut first) {
            if low > high {
                continue;
            }
            let (low, high) = ((f64::from(low) / size).floor(), (f64::from(high) / size).floor());
            let most = f64::from((1u32 << BITS) - 8);
            // Written as a negation so that NaN is refused too.
            if !(high - low < most && low.abs() < 1e15) {
                let expected = format!(
                    "a size that gives fewer than {most} cells along an axis, not {}; the points reach over {:.0} m in {of}: cut \
                     the cloud or choose a larger size",
                    high - low,
                    (high - low) * size
                );
                return Err(Error::parameter(name, size, expected));
            }
            *first = low as i64 - MARGIN;
        }
        Ok(Self { size, first })
    }

    /// Key of the cell that holds a position: sorted by y, then z, then x.
    #[inline(always)]
    pub(crate) fn key(&self, at: [f32; 3]) -> u64 {
        let mut cell = at.map(|v| floor(f64::from(v) / self.size));
        for (cell, first) in cell.iter_mut().zip(self.first) {
            *cell = cell.wrapping_sub(first);
        }
        u64::of([cell[1], cell[2], cell[0]])
    }

    /// Centre of the cell of a key.
    pub(crate) fn centre(&self, key: u64) -> [f32; 3] {
        let [y, z, x] = key.axes();
        let cell = [x, y, z];
        [0, 1, 2].map(|a| (((cell[a] + self.first[a]) as f64 + 0.5) * self.size) as f32)
    }
}

/// Offsets of the nine rows of three cells around a cell, ascending: from its key to that of the left cell of each row.
fn rows() -> impl Iterator<Item = i64> {
    (0..9).map(|i| ((i / 3 - 1) << (2 * BITS)) + ((i % 3 - 1) << BITS) - 1)
}

impl Cells<u64> {
    /// Occupied cells among the 27 around a key (itself included), ascending. Nine binary searches.
    pub(crate) fn around(&self, key: u64) -> impl Iterator<Item = usize> + '_ {
        rows().flat_map(move |row| {
            let first = key.wrapping_add_signed(row);
            let at = self.keys.partition_point(|&k| k < first);
            (at..self.keys.len()).take_while(move |&c| self.keys[c] <= first + 2)
        })
    }
}

/// For each of these cells those of its 26 neighbours that are occupied, ascending; `keys` ascend. O(cells): neighbours are
/// found twice, first to count and then to store them, so that only the result is in memory.
pub(crate) fn adjacency(keys: &[u64], monitor: &Monitor) -> Result<Csr> {
    let block = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(keys.len());
    let counts = map_ordered(keys.len().div_ceil(BLOCK), monitor, |b| {
        let mut counts = vec![0u8; block(b).len()];
        others(keys, block(b), |place, _| counts[place] += 1);
        Ok(counts)
    })?;
    let mut offsets = Vec::with_capacity(keys.len() + 1);
    offsets.push(0u32);
    let mut end = 0u32;
    for counts in counts {
        monitor.check()?;
        for count in counts {
            end = end.checked_add(u32::from(count)).ok_or_else(|| Error::input("more than 2^32 pairs of voxels"))?;
            offsets.push(end);
        }
    }
    let mut items = vec![0u32; end as usize];
    let parts = split_at_offsets(&mut items, (0..keys.len()).step_by(BLOCK).map(|v| offsets[v] as usize));
    parts.into_par_iter().enumerate().try_for_each(|(b, part)| {
        monitor.check()?;
        let mut free = part.iter_mut();
        others(keys, block(b), |_, neighbour| free.next().into_iter().for_each(|slot| *slot = neighbour));
        Ok::<(), Error>(())
    })?;
    Csr::new(offsets, items, keys.len())
}

/// The pieces of a slice that begin at these places, of which the first is 0.
fn split_at_offsets(mut rest: &mut [u32], begins: impl Iterator<Item = usize>) -> Vec<&mut [u32]> {
    let begins: Vec<usize> = begins.collect();
    let mut parts = Vec::with_capacity(begins.len());
    for pair in begins.windows(2) {
        let (part, behind) = std::mem::take(&mut rest).split_at_mut(pair[1] - pair[0]);
        parts.push(part);
        rest = behind;
    }
    if !begins.is_empty() {
        parts.push(rest);
    }
    parts
}

/// Calls `found` with the position in the range and the neighbour, for each of the 26 neighbours of each cell of a range.
fn others(keys: &[u64], range: Range<usize>, mut found: impl FnMut(usize, u32)) {
    let first = range.start;
    let other = |place: usize, cell: u32| {
        if first + place != cell as usize {
            found(place, cell);
        }
    };
    neighbours(keys, range, other);
}

/// Calls `found` with the position in the range and the cell, for the occupied cells among the 27 around each cell of a
/// range (itself included), ascending; `keys` ascend. The rows around ascending keys ascend too, so that nine pointers
/// move forward only.
pub(crate) fn neighbours(keys: &[u64], range: Range<usize>, mut found: impl FnMut(usize, u32)) {
    let mut pointers: [(i64, usize); 9] = [(0, 0); 9];
    for (slot, row) in pointers.iter_mut().zip(rows()) {
        let first = keys[range.start].wrapping_add_signed(row);
        *slot = (row, keys.partition_point(|&k| k < first));
    }
    for (place, cell) in range.enumerate() {
        for (row, pointer) in &mut pointers {
            let first = keys[cell].wrapping_add_signed(*row);
            while keys.get(*pointer).is_some_and(|&k| k < first) {
                *pointer += 1;
            }
            let near = keys[*pointer..].iter().take(3).take_while(|&&k| k <= first + 2);
            near.zip(*pointer..).for_each(|(_, c)| found(place, c as u32));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points, Positions};
    use crate::random::stream;

    fn scattered() -> Positions {
        let mut s = stream(5, 0);
        let rows: Vec<[f64; 3]> =
            (0..4000).map(|_| [s.uniform() * 9.0, s.uniform() * 7.0, s.uniform() * 2.0]).collect();
        Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions
    }

    #[test]
    fn neighbours_of_cells_are_those_of_brute_force() {
        let points = scattered();
        let grid = RowGrid::new(points.iter(), 0.5, "size").unwrap();
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), &Monitor::default()).unwrap();
        let near = adjacency(&cells.keys, &Monitor::default()).unwrap();
        let centre = |c: usize| grid.centre(cells.keys[c]);
        for a in 0..cells.len() {
            let touch = |b: &usize| (0..3).all(|k| (centre(a)[k] - centre(*b)[k]).abs() < 0.6);
            let expected: Vec<usize> = (0..cells.len()).filter(touch).collect();
            assert_eq!(cells.around(cells.keys[a]).collect::<Vec<_>>(), expected);
            let others: Vec<u32> = expected.into_iter().filter(|&b| b != a).map(|b| b as u32).collect();
            assert_eq!(near.group(a), others);
        }
    }

    #[test]
    fn items_stand_in_the_cell_that_holds_them() {
        let mut points = scattered();
        points.x.iter_mut().for_each(|x| *x -= 4.0);
        let grid = RowGrid::new(points.iter(), 0.7, "size").unwrap();
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), &Monitor::default()).unwrap();
        let held = (0..cells.len()).flat_map(|c| cells.of(c).iter().map(move |&i| (c, i as usize)));
        assert_eq!(cells.items.len(), points.len());
        for (c, i) in held {
            let centre = grid.centre(cells.keys[c]);
            assert!((0..3).all(|a| (centre[a] - points.xyz(i)[a]).abs() <= 0.35001));
        }
    }

    #[test]
    fn sizes_without_keys_and_places_that_are_no_numbers_are_refused() {
        let mut points = scattered();
        assert!(RowGrid::new(points.iter(), 1e-6, "size").unwrap_err().to_string().contains("size"));
        points.y[7] = f32::NAN;
        assert!(RowGrid::new(points.iter(), 1.0, "size").is_err());
        assert!(RowGrid::new(std::iter::empty(), 1.0, "size").is_ok());
    }
}
