//! Mean probabilities in a voxel and the 26 around it, and in a cell in plan and the 8 around it.

use super::Rated;
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
    grid: RowGrid,
    index: CellIndex<u64>,
    /// Mean of each class around each voxel.
    means: Vec<f32>,
}

/// Cells in plan of one size.
#[derive(Clone, Debug)]
pub(super) struct PlanCells {
    size: f64,
    index: CellIndex<[i32; 2]>,
    /// Mean of each class around each cell.
    means: Vec<f32>,
}

impl Solid {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let grid = RowGrid::new(rated.points.iter(), size, "context.voxels")?;
        let cells = Cells::new(rated.points.len(), |i| grid.key(rated.points.xyz(i)), monitor)?;
        let around = |range: Range<usize>, sums: &mut Sums<'_>| {
            neighbours(&cells.keys, range, |place, near| sums.add(place, near as usize));
        };
        let means = means(rated, &cells, around, monitor)?;
        Ok(Self { grid, index: CellIndex::new(cells.keys), means })
    }

    pub(super) fn mean(&self, at: [f32; 3], out: &mut [f32]) {
        place(self.index.find(self.grid.key(at)), &self.means, out);
    }
}

impl PlanCells {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let key = |i: usize| cell_of([rated.points.x[i], rated.points.y[i]].map(|v| f64::from(v) / size));
        let cells = Cells::new(rated.points.len(), key, monitor)?;
        let around = |range: Range<usize>, sums: &mut Sums<'_>| {
            let mut walk = Walk::<1>::new(&cells.keys, range.start);
            range.enumerate().for_each(|(place, cell)| walk.around(cell, |near, _| sums.add(place, near)));
        };
        let means = means(rated, &cells, around, monitor)?;
        Ok(Self { size, index: CellIndex::new(cells.keys), means })
    }

    pub(super) fn mean(&self, at: [f32; 3], out: &mut [f32]) {
        let key = cell_of([at[0], at[1]].map(|v| f64::from(v) / self.size));
        place(self.index.find(key), &self.means, out);
    }
}

/// Writes the row of a cell; NaN if there is none.
fn place(cell: Option<usize>, means: &[f32], out: &mut [f32]) {
    match cell {
        Some(c) => out.copy_from_slice(&means[c * out.len()..][..out.len()]),
        None => out.fill(f32::NAN),
    }
}

/// Points and sums of probabilities of all cells, and those around the cells of a block.
struct Sums<'a> {
    classes: usize,
    /// Sums of each cell, row-major.
    own: &'a [f32],
    /// Number of points of a cell.
    count: &'a (dyn Fn(usize) -> usize + Sync),
    /// Sums around each cell of the block, row-major.
    around: Vec<f64>,
    /// Points around each cell of the block.
    counts: Vec<usize>,
}

impl Sums<'_> {
    /// Adds cell `near` to the surroundings of the cell at this place in the block.
    fn add(&mut self, place: usize, near: usize) {
        self.counts[place] += (self.count)(near);
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
    around: impl Fn(Range<usize>, &mut Sums<'_>) + Sync,
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
        let (count, counts) = (&|cell| cells.range(cell).len(), vec![0; range.len()]);
        let mut sums = Sums { classes, own: &own, count, around: vec![0.0; range.len() * classes], counts };
        around(range, &mut sums);
        Ok(sums.means().collect::<Vec<f32>>())
    })?;
    concat_watched(means, monitor)
}
