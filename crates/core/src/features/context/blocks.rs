//! Mean probabilities in a voxel and the 26 around it, and in a cell in plan and the 8 around it.

use super::{Rated, RatedPoint};
use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};
use crate::voxels::cells::index::{CellIndex, Walk, block_of};
use crate::voxels::cells::{CellKey, Cells, cell_of};
use crate::voxels::rows::{RowGrid, neighbours};
use std::ops::Range;

/// Cells of a block.
const BLOCK: usize = 4096;

/// Voxels of one size.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    classes: usize,
    grid: RowGrid,
    index: CellIndex<u64>,
    /// Mean of each class around each voxel.
    means: Vec<f32>,
}

/// Cells in plan of one size.
#[derive(Clone, Debug)]
pub(super) struct PlanCells {
    size: f64,
    classes: usize,
    index: CellIndex<[i32; 2]>,
    /// Mean of each class around each cell.
    means: Vec<f32>,
}

impl Solid {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let grid = RowGrid::new(rated.points.iter(), size, "context.voxels")?;
        let cells = Cells::new(rated.points.len(), |i| grid.key(rated.points.xyz(i)), monitor)?;
        let around = |range: Range<usize>, sums: &mut Sums<'_, u64>| {
            neighbours(&cells.keys, range, |place, near| sums.add(place, near as usize));
        };
        let means = means(rated, &cells, around, monitor)?;
        Ok(Self { classes: rated.classes, grid, index: CellIndex::new(cells.keys), means })
    }

    /// The voxels of some points.
    pub(super) fn cells(&self, points: &[RatedPoint<'_>]) -> Vec<Option<u32>> {
        self.index.find_each(&points.iter().map(|point| self.grid.key(point.at)).collect::<Vec<_>>())
    }

    /// The mean of each class around a voxel.
    #[inline(always)]
    pub(super) fn mean(&self, cell: u32) -> &[f32] {
        &self.means[cell as usize * self.classes..][..self.classes]
    }
}

impl PlanCells {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let key = |i: usize| cell_of([rated.points.x[i], rated.points.y[i]].map(|v| f64::from(v) / size));
        let cells = Cells::new(rated.points.len(), key, monitor)?;
        let around = |range: Range<usize>, sums: &mut Sums<'_, [i32; 2]>| {
            let mut walk = Walk::<1>::new(&cells.keys, range.start);
            range.enumerate().for_each(|(place, cell)| walk.around(cell, |near, _| sums.add(place, near)));
        };
        let means = means(rated, &cells, around, monitor)?;
        Ok(Self { size, classes: rated.classes, index: CellIndex::new(cells.keys), means })
    }

    /// The cells of some points.
    pub(super) fn cells(&self, points: &[RatedPoint<'_>]) -> Vec<Option<u32>> {
        let key = |point: &RatedPoint<'_>| cell_of([point.at[0], point.at[1]].map(|v| f64::from(v) / self.size));
        self.index.find_each(&points.iter().map(key).collect::<Vec<_>>())
    }

    /// The mean of each class around a cell.
    #[inline(always)]
    pub(super) fn mean(&self, cell: u32) -> &[f32] {
        &self.means[cell as usize * self.classes..][..self.classes]
    }
}

/// Points and sums of probabilities of all cells, and those around the cells of a block.
struct Sums<'a, K> {
    cells: &'a Cells<K>,
    classes: usize,
    /// Sums of each cell, row-major.
    own: &'a [f32],
    /// Sums around each cell of the block, row-major.
    around: Vec<f64>,
    /// Points around each cell of the block.
    counts: Vec<usize>,
}

impl<K: CellKey> Sums<'_, K> {
    /// Adds cell `near` to the surroundings of the cell at this place in the block.
    fn add(&mut self, place: usize, near: usize) {
        self.counts[place] += self.cells.range(near).len();
        let row = &self.own[near * self.classes..][..self.classes];
        let sums = &mut self.around[place * self.classes..][..self.classes];
        sums.iter_mut().zip(row).for_each(|(sum, &own)| *sum += f64::from(own));
    }

    fn means(&self) -> impl Iterator<Item = f32> + '_ {
        let rows = self.around.chunks_exact(self.classes).zip(&self.counts);
        rows.flat_map(|(row, &count)| row.iter().map(move |sum| (sum / count as f64) as f32))
    }
}

/// The mean probabilities of the points in the cells near each cell; `around` adds what is near the cells of a block.
fn means<K: CellKey>(
    rated: &Rated<'_>,
    cells: &Cells<K>,
    around: impl Fn(Range<usize>, &mut Sums<'_, K>) + Sync,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    let (classes, blocks) = (rated.classes, cells.len().div_ceil(BLOCK));
    let own = map_ordered(blocks, monitor, |b| {
        let range = block_of(b, BLOCK, cells.len());
        let mut own = Vec::with_capacity(range.len() * classes);
        range.for_each(|c| rated.add_sums(cells.of(c), &mut own));
        Ok(own)
    })?;
    let own = concat_watched(own, monitor)?;
    let means = map_ordered(blocks, monitor, |b| {
        let range = block_of(b, BLOCK, cells.len());
        let (own, counts) = (&own[..], vec![0; range.len()]);
        let mut sums = Sums { cells, classes, own, around: vec![0.0; range.len() * classes], counts };
        around(range, &mut sums);
        Ok(sums.means().collect::<Vec<f32>>())
    })?;
    concat_watched(means, monitor)
}
