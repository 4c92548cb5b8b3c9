//! Points in columns of a grid in plan, each column sorted by height: a copy of the cloud in which all points within a
//! radius of a place lie in a few unbroken runs.
//!
//! The k-d tree of [`super::within()`] finds points one query at a time and sorts them by distance. Sums over all points of
//! a ball need no order, and neighbouring queries can share their runs: this is several times as fast.

use super::knn::tree::check;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered, map_watched, watched};
use crate::voxels::cells::index::CellIndex;
use crate::voxels::cells::{Cells, cell_of};
use crate::voxels::planar_density;
use std::ops::Range;

/// Columns that one task sorts.
const BLOCK: usize = 1024;
/// Number of points that a column should hold: about as many queries as are solved together.
const IN_COLUMN: f64 = 16.0;
/// The edge of a column is at least this share of the radius: more columns a query cost more than they exclude.
const LEAST_EDGE: f64 = 0.125;
/// Radii are enlarged by this share where whole columns are excluded, so that rounding excludes no point.
const MARGIN: f64 = 1e-6;

/// Points by column (ascending in x, then y), those of a column by (z, index).
#[derive(Clone, Debug, Default)]
pub(crate) struct Stacks {
    /// Edge of the columns, metres.
    edge: f64,
    columns: CellIndex<[i32; 2]>,
    /// First point of each column, and the number of points.
    starts: Vec<u32>,
    /// The points in the order of the columns.
    pub(crate) positions: Positions,
    /// Index of each of these in the cloud.
    pub(crate) index: Vec<u32>,
}

/// A box that holds one or more places, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) low: [f64; 3],
    pub(crate) high: [f64; 3],
}

impl Block {
    /// The box of one place.
    #[inline(always)]
    pub(crate) fn at(place: [f32; 3]) -> Self {
        let place = place.map(f64::from);
        Self { low: place, high: place }
    }

    /// The least box that also holds another place.
    #[inline(always)]
    pub(crate) fn with(&self, place: [f32; 3]) -> Self {
        let mut wider = *self;
        for (a, &v) in place.iter().enumerate() {
            wider.low[a] = wider.low[a].min(f64::from(v));
            wider.high[a] = wider.high[a].max(f64::from(v));
        }
        wider
    }

    /// Whether no side is longer than `most`.
    #[inline(always)]
    pub(crate) fn is_within(&self, most: f64) -> bool {
        (0..3).all(|a| self.high[a] - self.low[a] <= most)
    }
}

impl Stacks {
    /// Sorts points for searches with radii from `radius` on, metres. O(n log n), 16 bytes a point and as many
    /// temporary ones.
    ///
    /// # Errors
    /// If the radius is not above 0 and finite, a coordinate is not finite, or the work was cancelled.
    pub(crate) fn new(points: &Positions, radius: f64, monitor: &Monitor) -> Result<Self> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::parameter("radius", radius, "metres, above 0, finite"));
        }
        check(points)?;
        let density = planar_density(points, monitor)?.max(f64::MIN_POSITIVE);
        let edge = (IN_COLUMN / density).sqrt().clamp(LEAST_EDGE * radius, radius);
        let key = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / edge));
        let cells = Cells::new(points.len(), key, monitor)?;
        let parts = map_ordered(cells.len().div_ceil(BLOCK), monitor, |block| {
            let mut rows: Vec<u32> = Vec::new();
            for column in block * BLOCK..((block + 1) * BLOCK).min(cells.len()) {
                let first = rows.len();
                rows.extend(cells.of(column));
                let height = |i: u32| points.z[i as usize];
                rows[first..].sort_unstable_by(|&a, &b| height(a).total_cmp(&height(b)).then(a.cmp(&b)));
            }
            Ok(rows)
        })?;
        let index = parts.concat();
        let starts = map_watched(cells.len() + 1, monitor, |c| {
            if c < cells.len() { cells.range(c).start as u32 } else { points.len() as u32 }
        })?;
        let columns = CellIndex::new(cells.keys);
        Ok(Self { edge, columns, starts, positions: points.select(&index, monitor)?, index })
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.index.len()
    }

    /// Values of the points in the order of the cloud, from those in the order of the columns.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(crate) fn restored<T: Copy + Default>(&self, sorted: &[T], monitor: &Monitor) -> Result<Vec<T>> {
        debug_assert_eq!(sorted.len(), self.len());
        let mut values = vec![T::default(); self.len()];
        for piece in watched(self.len(), monitor) {
            piece?.for_each(|at| values[self.index[at] as usize] = sorted[at]);
        }
        Ok(values)
    }

    /// Replaces `runs` by the runs of points that hold every point within the radius of any place of the block, and some
    /// others.
    pub(crate) fn runs(&self, block: &Block, radius: f64, runs: &mut Vec<Range<u32>>) {
        runs.clear();
        let wide = radius * (1.0 + MARGIN);
        let [first, last] = [block.low[0] - wide, block.high[0] + wide].map(|x| cell_of([x / self.edge])[0]);
        for x in first..=last {
            let across = self.gap(x, [block.low[0], block.high[0]]);
            let Some(rest) = leg(wide, across) else { continue };
            let [low, high] = [block.low[1] - rest, block.high[1] + rest].map(|y| cell_of([y / self.edge])[0]);
            let mut column = self.columns.seek([x, low]);
            while let Some(&[_, y]) = self.columns.keys().get(column).filter(|key| key[0] == x && key[1] <= high) {
                let along = self.gap(y, [block.low[1], block.high[1]]);
                if let Some(up) = leg(rest, along) {
                    let run = self.between(column, [block.low[2] - up, block.high[2] + up]);
                    match runs.last_mut() {
                        Some(last) if last.end == run.start => last.end = run.end,
                        _ if run.is_empty() => {}
                        _ => runs.push(run),
                    }
                }
                column += 1;
            }
        }
    }

    /// The points within the radius of a place, in the order of the columns: `(dx² + dy²) + dz²` in `f32` is at most the
    /// square of the radius rounded to `f32`, as in [`super::within()`].
    #[inline(always)]
    pub(crate) fn around(&self, ball: Ball, runs: &mut Vec<Range<u32>>, mut found: impl FnMut(u32)) {
        let Ball { at, radius } = ball;
        let limit = (radius * radius) as f32;
        self.runs(&Block::at(at), radius, runs);
        let Positions { x, y, z } = &self.positions;
        for run in runs.iter() {
            for i in run.start as usize..run.end as usize {
                let [dx, dy, dz] = [x[i] - at[0], y[i] - at[1], z[i] - at[2]];
                if dx * dx + dy * dy + dz * dz <= limit {
                    found(i as u32);
                }
            }
        }
    }

    /// Distance between a row of columns and an interval on its axis.
    fn gap(&self, row: i32, [low, high]: [f64; 2]) -> f64 {
        let start = f64::from(row) * self.edge;
        (start - high).max(low - (start + self.edge)).max(0.0)
    }

    /// The points of a column between two heights.
    fn between(&self, column: usize, [low, high]: [f64; 2]) -> Range<u32> {
        let (start, end) = (self.starts[column], self.starts[column + 1]);
        let heights = &self.positions.z[start as usize..end as usize];
        let from = heights.partition_point(|&z| f64::from(z) < low);
        let to = from + heights[from..].partition_point(|&z| f64::from(z) <= high);
        start + from as u32..start + to as u32
    }
}

/// A place and the radius around it, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub(crate) at: [f32; 3],
    pub(crate) radius: f64,
}

/// The other leg of a right triangle; `None` if the first is longer than the hypotenuse.
fn leg(hypotenuse: f64, first: f64) -> Option<f64> {
    (first <= hypotenuse).then(|| (hypotenuse * hypotenuse - first * first).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::within;
    use crate::random::stream;

    fn random(n: usize, extent: [f32; 3]) -> Positions {
        let mut s = stream(5, n as u64);
        (0..n).map(|_| extent.map(|e| (s.uniform() as f32 - 0.3) * e)).collect()
    }

    #[test]
    fn balls_equal_those_of_the_tree_on_surfaces_walls_volumes_lattices_and_piles() {
        let lattice: Positions =
            (0..2197).map(|i| [(i * 5 % 13) as f32, (i / 13 % 13) as f32, (i / 169) as f32]).collect();
        let mut pile: Positions = (0..300).map(|_| [1.0, 2.0, 3.0]).collect();
        random(400, [3.0; 3]).iter().for_each(|at| pile.push(at));
        let monitor = Monitor::default();
        for points in
            [random(4000, [40.0, 40.0, 0.3]), random(3000, [30.0, 0.1, 30.0]), random(900, [4.0; 3]), lattice, pile]
        {
            for radius in [0.3, 1.0, 2.5, 1e3] {
                let stacks = Stacks::new(&points, radius, &monitor).unwrap();
                let near = within(&points, &points, radius, &monitor).unwrap();
                let mut runs = Vec::new();
                for i in (0..points.len()).step_by(7) {
                    let mut found = Vec::new();
                    stacks.around(Ball { at: points.xyz(i), radius }, &mut runs, |j| {
                        found.push(stacks.index[j as usize])
                    });
                    found.sort_unstable();
                    let mut expected = near.of(i).to_vec();
                    expected.sort_unstable();
                    assert_eq!(found, expected, "point {i}, radius {radius}");
                }
            }
        }
    }

    #[test]
    fn radii_and_coordinates_that_are_no_numbers_are_refused_and_no_points_have_no_columns() {
        let mut points = random(9, [1.0; 3]);
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Stacks::new(&points, radius, &Monitor::default()).is_err());
        }
        points.z[3] = f32::NAN;
        assert!(Stacks::new(&points, 1.0, &Monitor::default()).is_err());
        let none = Stacks::new(&Positions::default(), 1.0, &Monitor::default()).unwrap();
        let mut runs = vec![0..1u32; 2];
        none.runs(&Block::at([0.0; 3]), 1.0, &mut runs);
        assert!(none.len() == 0 && runs.is_empty());
    }
}
