//! The points of a cloud in Morton order, and the way to those of a rectangle in plan.

use crate::cloud::{Points, Positions};
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered};
use crate::voxels::Grid;
use crate::voxels::cells::index::block_of;

/// Points that share a box; they are near each other, as they are sorted.
const BOXED: usize = 1024;

/// A cloud's finite and non-stray points in the Morton order of a grid.
#[derive(Clone, Debug)]
pub(in crate::features) struct Sorted {
    pub(in crate::features) points: Points,
    pub(in crate::features) grid: Grid,
    /// Least and greatest cell index of all points on each axis.
    pub(super) cells: [[u32; 3]; 2],
    /// Of each [`BOXED`] points, the box in plan.
    boxes: Vec<PlanBox<f32>>,
}

impl Sorted {
    /// The points must be in the order of the grid. O(n) time, 16 bytes per 1,024 points.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::features) fn new(points: Points, grid: Grid, monitor: &Monitor) -> Result<Self> {
        let Positions { x, y, z } = &points.positions;
        let boxes = map_ordered(x.len().div_ceil(BOXED), monitor, |b| {
            let range = block_of(b, BOXED, x.len());
            Ok(PlanBox::of(&x[range.clone()], &y[range]))
        })?;
        let cells = [[x, y, z].map(|axis| least(axis)), [x, y, z].map(|axis| greatest(axis))].map(|at| grid.cell(at));
        Ok(Self { points, grid, cells, boxes })
    }

    /// The points within `reach` metres in plan of the box around `positions`, in the sorted order.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::features) fn around(&self, positions: &Positions, reach: f64, monitor: &Monitor) -> Result<Points> {
        let wanted = PlanBox::of(&positions.x, &positions.y).wider(reach as f32);
        self.points.select(&self.places(&wanted, |v| v, monitor)?, monitor)
    }

    /// The places, ascending, of the points whose coordinates in plan have keys in a box; keys must not descend.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn places<T: Copy + PartialOrd>(
        &self,
        wanted: &PlanBox<T>,
        key: impl Fn(f32) -> T,
        monitor: &Monitor,
    ) -> Result<Vec<u32>> {
        let Positions { x, y, .. } = &self.points.positions;
        let mut found = Vec::new();
        for (b, own) in self.boxes.iter().enumerate() {
            monitor.check()?;
            let (own, range) = (own.keyed(&key), block_of(b, BOXED, x.len()));
            if wanted.holds(own.low) && wanted.holds(own.high) {
                found.extend(range.map(|i| i as u32));
            } else if wanted.meets(&own) {
                found.extend(range.filter(|&i| wanted.holds([key(x[i]), key(y[i])])).map(|i| i as u32));
            }
        }
        Ok(found)
    }
}

/// A rectangle in plan, its border included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlanBox<T> {
    /// Least x and y.
    pub(super) low: [T; 2],
    /// Greatest x and y.
    pub(super) high: [T; 2],
}

impl PlanBox<f32> {
    /// The box of points.
    fn of(x: &[f32], y: &[f32]) -> Self {
        Self { low: [least(x), least(y)], high: [greatest(x), greatest(y)] }
    }

    /// The box of these points and another one.
    #[inline]
    pub(super) fn and(self, at: [f32; 2]) -> Self {
        Self { low: [0, 1].map(|a| self.low[a].min(at[a])), high: [0, 1].map(|a| self.high[a].max(at[a])) }
    }

    pub(super) fn wider(self, by: f32) -> Self {
        Self { low: self.low.map(|v| v - by), high: self.high.map(|v| v + by) }
    }

    pub(super) fn keyed<T>(&self, key: impl Fn(f32) -> T) -> PlanBox<T> {
        PlanBox { low: self.low.map(&key), high: self.high.map(&key) }
    }
}

impl<T: Copy + PartialOrd> PlanBox<T> {
    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|a| self.low[a] <= other.high[a] && self.high[a] >= other.low[a])
    }

    #[inline(always)]
    pub(super) fn holds(&self, at: [T; 2]) -> bool {
        (0..2).all(|a| at[a] >= self.low[a] && at[a] <= self.high[a])
    }
}

fn least(axis: &[f32]) -> f32 {
    axis.iter().copied().fold(f32::MAX, f32::min)
}

fn greatest(axis: &[f32]) -> f32 {
    axis.iter().copied().fold(f32::MIN, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;
    use crate::voxels::sorted;

    #[test]
    fn places_in_a_rectangle_are_those_of_brute_force() {
        let mut s = stream(17, 0);
        let rows: Vec<[f64; 3]> = (0..9000).map(|_| [90.0, 70.0, 9.0].map(|edge| s.uniform() * edge)).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let (grid, monitor) = (Grid::new(&points, 0.5).unwrap(), Monitor::default());
        let points = sorted(points, &grid, &monitor).unwrap();
        let all = Sorted::new(points.clone(), grid, &monitor).unwrap();
        let at = |i: usize| points.positions.xyz(i);
        for (low, high) in [([10, 20], [120, 90]), ([0, 0], [u32::MAX; 2]), ([30, 30], [29, 29]), ([60, 4], [60, 4])] {
            let cell = |v: f32| grid.cell([v; 3])[0];
            let found = all.places(&PlanBox { low, high }, cell, &monitor).unwrap();
            let inside = |i: &usize| (0..2).all(|a| (low[a]..=high[a]).contains(&grid.cell(at(*i))[a]));
            assert_eq!(found, (0..points.len()).filter(inside).map(|i| i as u32).collect::<Vec<_>>());
        }
        let few = points.positions.select(&[5, 40], &monitor).unwrap();
        let near = |&i: &usize| {
            (0..2).all(|a| {
                let [p, q] = [few.xyz(0)[a], few.xyz(1)[a]];
                at(i)[a] >= p.min(q) - 7.0 && at(i)[a] <= p.max(q) + 7.0
            })
        };
        let expected: Vec<u32> = (0..points.len()).filter(near).map(|i| points.frame.index[i]).collect();
        assert!(expected.len() > 100 && expected.len() < points.len());
        assert_eq!(all.around(&few, 7.0, &monitor).unwrap().frame.index, expected);
        let cells: Vec<[u32; 3]> = (0..points.len()).map(|i| grid.cell(at(i))).collect();
        let extreme =
            |pick: fn(u32, u32) -> u32| cells.iter().copied().reduce(|p, q| [0, 1, 2].map(|a| pick(p[a], q[a])));
        assert_eq!(all.cells.map(Some), [extreme(u32::min), extreme(u32::max)]);
    }
}
