//! The loaded part of a cloud: whole vertical columns of voxels.

use super::sorted::{PlanBox, Sorted};
use crate::error::Result;
use crate::parallel::{Looks, Monitor};

/// A box of voxels of some level, unlimited in height; where it reaches the border of the cloud, it is unlimited too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::features) struct Region {
    low: [f64; 3],
    high: [f64; 3],
    /// Largest rounding error of a coordinate in `f32`.
    rounding: f64,
    /// The box in plan of the points around which it lies.
    queries: PlanBox<f32>,
    /// Mean distance between the points in the region in plan, metres.
    spacing: f64,
    /// Voxels of the margin.
    margin: u32,
}

/// The width of the margin around the points of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::features) struct Margin {
    /// Level whose voxels are counted, 0 for the finest.
    pub(in crate::features) level: usize,
    /// Number of voxels on each side.
    pub(in crate::features) voxels: u32,
}

impl Region {
    /// The voxels around the points at `places` in the sorted order, extended by the margin on each side and to all
    /// heights, and the places of all points in them. `None` instead of the box if it holds all points.
    /// O(places + points inside), and a look at each box of 1,024 points.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::features) fn around(
        sorted: &Sorted,
        places: &[u32],
        margin: Margin,
        monitor: &Monitor,
    ) -> Result<(Option<Self>, Vec<u32>)> {
        let Sorted { points, grid, cells, .. } = sorted;
        let Margin { level, voxels: margin } = margin;
        let axis = |v: f32| grid.cell([v; 3])[0] >> level;
        let mut queries = PlanBox { low: [f32::MAX; 2], high: [f32::MIN; 2] };
        let mut looks = Looks::at(monitor);
        for &place in places {
            looks.step()?;
            let [x, y, _] = points.positions.xyz(place as usize);
            queries = queries.and([x, y]);
        }
        let PlanBox { low, high } = queries.keyed(axis);
        let (low, high) = (low.map(|c| c.saturating_sub(margin)), high.map(|c| c.saturating_add(margin)));
        let held = sorted.places(&PlanBox { low, high }, axis, monitor)?;
        if held.len() == points.len() {
            return Ok((None, held));
        }
        let size = grid.size * f64::from(1u32 << level);
        let [first, last] = cells.map(|corner| corner.map(|c| c >> level));
        let start = |a: usize| if low[a] <= first[a] { f64::NEG_INFINITY } else { f64::from(low[a]) * size };
        let end = |a: usize| if high[a] >= last[a] { f64::INFINITY } else { (f64::from(high[a]) + 1.0) * size };
        let far = f64::from(last.into_iter().max().unwrap_or_default()) * size + size;
        let edge = |a: usize| f64::from(high[a].min(last[a]).saturating_sub(low[a].max(first[a])) + 1) * size;
        let spacing = (edge(0) * edge(1) / held.len().max(1) as f64).sqrt();
        // All heights, for the column features.
        let (low, high) = ([start(0), start(1), f64::NEG_INFINITY], [end(0), end(1), f64::INFINITY]);
        let rounding = far * f64::from(f32::EPSILON);
        Ok((Some(Self { low, high, rounding, queries, spacing, margin }), held))
    }

    /// The rectangle in which neighbours of the points around which the region lies are expected, on a level with voxels of
    /// this size, metres: not farther than the voxels of the margin, or as many points.
    pub(super) fn core(&self, size: f64) -> PlanBox<f32> {
        self.queries.wider((f64::from(self.margin) * size.max(self.spacing)) as f32)
    }

    /// True if nothing outside the box can be as near to `at` as this squared distance. With `all` false, neighbours
    /// are missing and the result is false.
    #[inline(always)]
    pub(super) fn holds(&self, at: [f32; 3], squared: f32, all: bool) -> bool {
        let mut reach = f64::INFINITY;
        for ((v, low), high) in at.into_iter().map(f64::from).zip(self.low).zip(self.high) {
            reach = reach.min(v - low).min(high - v);
        }
        let certain = (reach * (1.0 - 1e-5) - 4.0 * self.rounding).max(0.0);
        all && f64::from(squared) < certain * certain
    }
}
