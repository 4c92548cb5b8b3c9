//! Mean probabilities in a voxel and the 26 around it, and in a cell in plan and the 8 around it.

use super::Rated;
use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};
use crate::voxels::cells::{Cells, cell_of};
use crate::voxels::rows::RowGrid;

/// Cells of a block.
const BLOCK: usize = 4096;

/// Voxels of one size.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    grid: RowGrid,
    keys: Vec<u64>,
    /// Mean of each class around each voxel.
    means: Vec<f32>,
}

/// Cells in plan of one size.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    size: f64,
    keys: Vec<[i32; 2]>,
    /// Mean of each class around each cell.
    means: Vec<f32>,
}

impl Solid {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let grid = RowGrid::new(rated.points.iter(), size, "context.voxels")?;
        let cells = Cells::new(rated.points.len(), |i| grid.key(rated.points.xyz(i)), monitor)?;
        let means = means(rated, &cells, |c| cells.around(cells.keys[c]).collect(), monitor)?;
        Ok(Self { grid, keys: cells.keys, means })
    }

    pub(super) fn mean(&self, at: [f32; 3], out: &mut [f32]) {
        place(self.keys.binary_search(&self.grid.key(at)).ok(), &self.means, out);
    }
}

impl Plan {
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let key = |i: usize| cell_of([rated.points.x[i], rated.points.y[i]].map(|v| f64::from(v) / size));
        let cells = Cells::new(rated.points.len(), key, monitor)?;
        let means = means(rated, &cells, |c| around(&cells.keys, c), monitor)?;
        Ok(Self { size, keys: cells.keys, means })
    }

    pub(super) fn mean(&self, at: [f32; 3], out: &mut [f32]) {
        let key = cell_of([at[0], at[1]].map(|v| f64::from(v) / self.size));
        place(self.keys.binary_search(&key).ok(), &self.means, out);
    }
}

/// Writes the row of a cell; NaN if there is none.
fn place(cell: Option<usize>, means: &[f32], out: &mut [f32]) {
    match cell {
        Some(c) => out.copy_from_slice(&means[c * out.len()..][..out.len()]),
        None => out.fill(f32::NAN),
    }
}

/// The occupied cells among the 3 x 3 around a cell, ascending.
fn around(keys: &[[i32; 2]], cell: usize) -> Vec<usize> {
    let [x, y] = keys[cell];
    let mut near = Vec::with_capacity(9);
    for dx in -1..=1 {
        let first = [x.saturating_add(dx), y.saturating_sub(1)];
        let at = keys.partition_point(|key| *key < first);
        near.extend((at..keys.len()).take_while(|&c| keys[c][0] == first[0] && keys[c][1] <= y.saturating_add(1)));
    }
    near
}

/// The mean probabilities of the points in the cells near each cell.
fn means<K: Copy + Default + Ord + Send + Sync>(
    rated: &Rated<'_>,
    cells: &Cells<K>,
    near: impl Fn(usize) -> Vec<usize> + Sync,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    let block = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(cells.len());
    let blocks = cells.len().div_ceil(BLOCK);
    let own =
        map_ordered(blocks, monitor, |b| Ok(block(b).flat_map(|c| rated.sums(cells.of(c))).collect::<Vec<f32>>()))?;
    let own = concat_watched(own, monitor)?;
    let around = |c: usize| {
        let (mut sums, mut count) = (vec![0.0f64; rated.classes], 0);
        for n in near(c) {
            count += cells.range(n).len();
            let row = &own[n * rated.classes..][..rated.classes];
            sums.iter_mut().zip(row).for_each(|(sum, &own)| *sum += f64::from(own));
        }
        sums.into_iter().map(move |sum| (sum / count as f64) as f32)
    };
    let means = map_ordered(blocks, monitor, |b| Ok(block(b).flat_map(around).collect::<Vec<f32>>()))?;
    concat_watched(means, monitor)
}
