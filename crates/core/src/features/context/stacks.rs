//! Mean probabilities below and above a point in its cell in plan, and those of the highest point there.

use super::{Rated, RatedPoint};
use crate::error::Result;
use crate::parallel::{Looks, Monitor};
use crate::voxels::cells::index::CellIndex;
use crate::voxels::cells::{Cells, cell_of};

/// Number of values of a class.
pub(super) const VALUES: usize = 3;

/// Cells in plan of one size, with their points from the lowest to the highest.
#[derive(Clone, Debug)]
pub(super) struct Stacks {
    size: f64,
    classes: usize,
    index: CellIndex<[i32; 2]>,
    /// Where the points of each cell begin, and the end of the last.
    starts: Vec<u32>,
    /// Heights, ascending within each cell.
    heights: Vec<f32>,
    /// Sums of the probabilities of a point and all before it in its cell, row-major.
    sums: Vec<f32>,
    /// Mean probabilities of the highest points of each cell, row-major.
    tops: Vec<f32>,
}

impl Stacks {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let (points, classes) = (rated.points, rated.classes);
        let key = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / size));
        let mut cells = Cells::new(points.len(), key, monitor)?;
        let (mut starts, mut sums, mut tops) = (vec![0], Vec::with_capacity(points.len() * classes), Vec::new());
        let (mut looks, mut sum) = (Looks::at(monitor), vec![0.0f64; classes]);
        for c in 0..cells.len() {
            let range = cells.range(c);
            looks.steps(range.len())?;
            starts.push(range.end as u32);
            let own = &mut cells.items[range];
            own.sort_unstable_by(|&a, &b| points.z[a as usize].total_cmp(&points.z[b as usize]).then(a.cmp(&b)));
            sum.fill(0.0);
            for &point in own.iter() {
                sum.iter_mut().zip(rated.row(point as usize)).for_each(|(sum, &p)| *sum += f64::from(p));
                sums.extend(sum.iter().map(|&sum| sum as f32));
            }
            let highest = own.last().map_or(0.0, |&point| points.z[point as usize]);
            let first = own.partition_point(|&point| points.z[point as usize] < highest);
            let count = (own.len() - first) as f32;
            let last = tops.len();
            rated.add_sums(&own[first..], &mut tops);
            tops[last..].iter_mut().for_each(|sum| *sum /= count);
        }
        let heights = cells.items.iter().map(|&i| points.z[i as usize]).collect();
        Ok(Self { size, classes, index: CellIndex::new(cells.keys), starts, heights, sums, tops })
    }

    /// The cells of some points.
    pub(super) fn cells(&self, points: &[RatedPoint<'_>]) -> Vec<Option<u32>> {
        let key = |point: &RatedPoint<'_>| cell_of([point.at[0], point.at[1]].map(|v| f64::from(v) / self.size));
        self.index.find_each(&points.iter().map(key).collect::<Vec<_>>())
    }

    /// Means of the points of a cell that are not above a height, of those not below, and of the highest ones.
    #[inline]
    pub(super) fn describe<'a>(&self, z: f32, cell: u32, out: &'a mut Vec<f32>) -> &'a [f32] {
        let (c, classes) = (cell as usize, self.classes);
        let (start, end) = (self.starts[c] as usize, self.starts[c + 1] as usize);
        let heights = &self.heights[start..end];
        let lower = heights.partition_point(|&h| h < z);
        let not_higher = heights.partition_point(|&h| h <= z);
        out.resize(VALUES * classes, 0.0);
        for k in 0..classes {
            let sum = |count: usize| if count == 0 { 0.0 } else { self.sums[(start + count - 1) * classes + k] };
            out[k] = sum(not_higher) / not_higher as f32;
            out[classes + k] = (sum(heights.len()) - sum(lower)) / (heights.len() - lower) as f32;
            out[2 * classes + k] = self.tops[c * classes + k];
        }
        out
    }
}
