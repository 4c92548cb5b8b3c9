//! The loaded part of a cloud: whole vertical columns of voxels.

use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::{Looks, Monitor, watched};
use crate::voxels::Grid;

/// A cloud's finite and non-stray points in the Morton order of a grid.
#[derive(Clone, Debug)]
pub(in crate::features) struct Sorted {
    pub(in crate::features) points: Points,
    pub(in crate::features) grid: Grid,
}

/// A box of voxels of some level, unlimited in height; where it reaches the border of the cloud, it is unlimited too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::features) struct Region {
    low: [f64; 3],
    high: [f64; 3],
    /// Largest rounding error of a coordinate in `f32`.
    rounding: f64,
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
    /// O(points).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::features) fn around(
        sorted: &Sorted,
        places: &[u32],
        margin: Margin,
        monitor: &Monitor,
    ) -> Result<(Option<Self>, Vec<u32>)> {
        let Sorted { points, grid } = sorted;
        let Margin { level, voxels: margin } = margin;
        let cell = |i: usize| grid.cell(points.positions.xyz(i)).map(|c| c >> level);
        let bounds = |all: &mut dyn Iterator<Item = usize>| {
            let mut looks = Looks::at(monitor);
            all.map(cell).try_fold(([u32::MAX; 3], [0; 3]), |(low, high), c| {
                looks.step()?;
                Ok(([0, 1, 2].map(|a| low[a].min(c[a])), [0, 1, 2].map(|a| high[a].max(c[a]))))
            })
        };
        let (first, last) = bounds(&mut (0..points.len()))?;
        let (low, high) = bounds(&mut places.iter().map(|&i| i as usize))?;
        // All heights, for the column features.
        let low = [low[0].saturating_sub(margin), low[1].saturating_sub(margin), 0];
        let high = [high[0].saturating_add(margin), high[1].saturating_add(margin), u32::MAX];
        let inside = |i: &u32| {
            let c = cell(*i as usize);
            (0..3).all(|a| (low[a]..=high[a]).contains(&c[a]))
        };
        let mut held: Vec<u32> = Vec::new();
        for piece in watched(points.len(), monitor) {
            held.extend(piece?.map(|i| i as u32).filter(inside));
        }
        if held.len() == points.len() {
            return Ok((None, held));
        }
        let size = grid.size * f64::from(1u32 << level);
        let start = |a: usize| if low[a] <= first[a] { f64::NEG_INFINITY } else { f64::from(low[a]) * size };
        let end = |a: usize| if high[a] >= last[a] { f64::INFINITY } else { (f64::from(high[a]) + 1.0) * size };
        let far = f64::from(last.into_iter().max().unwrap_or_default()) * size + size;
        let region =
            Self { low: [0, 1, 2].map(start), high: [0, 1, 2].map(end), rounding: far * f64::from(f32::EPSILON) };
        Ok((Some(region), held))
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
