//! Levels of the voxel pyramid: the means of the points in voxels of edge s, 2s, 4s, ...
//!
//! All grids share one origin, so that they nest, and the count-weighted mean of the finer level's means is the mean of
//! the original points (Hackel 2018, chapter 4.4.1).

use super::blocks::Blocks;
use super::grid::Grid;
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Least mean number of points in occupied cells of the search grid; with fewer, many queries would need a wider
/// search.
const POINTS_PER_CELL: usize = 5;

/// One level: its points in Morton order, and the search grid.
#[derive(Clone, Debug)]
pub struct Level {
    /// Edge of a voxel, metres.
    pub size: f64,
    /// x of the voxel means, metres.
    pub x: Vec<f32>,
    /// y of the voxel means, metres.
    pub y: Vec<f32>,
    /// z of the voxel means, metres.
    pub z: Vec<f32>,
    /// Edge of a cell of the search grid: a power of two times the edge of a voxel.
    pub(super) cell_size: f64,
    pub(super) blocks: Blocks,
    /// Groups of blocks (key and range of blocks), for queries far from all points.
    pub(super) groups: Vec<(u64, std::ops::Range<usize>)>,
    /// Largest rounding error of a coordinate in `f32`.
    pub(super) rounding: f32,
}

impl Level {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// The cell of the search grid that holds a position.
    #[inline(always)]
    pub(super) fn cell(&self, at: [f32; 3]) -> [u32; 3] {
        at.map(|v| (f64::from(v) / self.cell_size) as u32)
    }
}

/// Number of points between two checks for cancellation.
const LOOK: usize = 65_536;

/// Codes and counts of a level's voxels, during the construction.
#[derive(Default)]
struct Voxels {
    codes: Vec<u64>,
    counts: Vec<u32>,
}

impl Voxels {
    /// Averages consecutive points with the same code; returns the voxels and their means.
    fn unite(points: impl Iterator<Item = (u64, [f32; 3], u32)>, monitor: &Monitor) -> Result<(Self, [Vec<f32>; 3])> {
        let (mut voxels, mut means) = (Self::default(), [Vec::new(), Vec::new(), Vec::new()]);
        let mut sum = [0.0f64; 3];
        for (i, (code, place, count)) in points.enumerate() {
            if i % LOOK == 0 {
                monitor.check()?;
            }
            if voxels.codes.last() != Some(&code) {
                voxels.close(&mut sum, &mut means);
                voxels.codes.push(code);
                voxels.counts.push(0);
            }
            (0..3).for_each(|a| sum[a] += f64::from(place[a]) * f64::from(count));
            if let Some(n) = voxels.counts.last_mut() {
                *n += count;
            }
        }
        voxels.close(&mut sum, &mut means);
        Ok((voxels, means))
    }

    /// Appends the mean of the last voxel.
    fn close(&self, sum: &mut [f64; 3], means: &mut [Vec<f32>; 3]) {
        if let Some(&n) = self.counts.last() {
            (0..3).for_each(|a| means[a].push((sum[a] / f64::from(n)) as f32));
        }
        *sum = [0.0; 3];
    }

    /// Number of times the edge of a voxel is doubled so that occupied cells hold [`POINTS_PER_CELL`] points on
    /// average.
    fn doublings(&self, monitor: &Monitor) -> Result<u32> {
        for doublings in 1..20 {
            let mut cells = usize::from(!self.codes.is_empty());
            for piece in watched(self.codes.len().saturating_sub(1), monitor) {
                let cell = |i: usize| self.codes[i] >> (3 * doublings);
                cells += piece?.filter(|&i| cell(i) != cell(i + 1)).count();
            }
            if cells * POINTS_PER_CELL <= self.codes.len() + 8 {
                return Ok(doublings);
            }
        }
        Ok(20)
    }

    fn level(&self, size: f64, [x, y, z]: [Vec<f32>; 3], monitor: &Monitor) -> Result<Level> {
        let doublings = self.doublings(monitor)?;
        let mut far = 0.0f32;
        for axis in [&x, &y, &z] {
            monitor.check()?;
            far = axis.iter().fold(far, |m, &v| m.max(v));
        }
        let blocks = Blocks::new(&self.codes, doublings, monitor)?;
        Ok(Level {
            size,
            groups: blocks.groups().collect(),
            cell_size: size * f64::from(1u32 << doublings),
            blocks,
            rounding: far * f32::EPSILON,
            x,
            y,
            z,
        })
    }
}

/// Levels 0..count of points in the grid's Morton order. O(n) time a level.
///
/// # Errors
/// If the work was cancelled.
pub fn build_levels(points: &Positions, grid: &Grid, count: usize, monitor: &Monitor) -> Result<Vec<Level>> {
    let all = LevelLimits { levels: count, most_points: usize::MAX };
    Ok(coarse_levels(points, grid, all, monitor)?.1)
}

/// Which levels of a pyramid are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelLimits {
    /// Number of levels of the pyramid, those that are skipped among them.
    pub levels: usize,
    /// The finest levels are skipped while they have more points than this.
    pub most_points: usize,
}

/// As [`build_levels`], without the finest levels if they have too many points; also returns how many were skipped.
///
/// # Errors
/// If the work was cancelled.
pub fn coarse_levels(
    points: &Positions,
    grid: &Grid,
    limits: LevelLimits,
    monitor: &Monitor,
) -> Result<(usize, Vec<Level>)> {
    if limits.levels == 0 {
        return Ok((0, Vec::new()));
    }
    let finest = (0..points.len()).map(|i| (grid.code(points.xyz(i)), points.xyz(i), 1));
    let (mut voxels, mut means) = Voxels::unite(finest, monitor)?;
    let (mut fine, mut levels) = (0, Vec::<Level>::new());
    for l in 0..limits.levels {
        if l > 0 {
            let [x, y, z] =
                levels.last().map_or([&means[0], &means[1], &means[2]], |level| [&level.x, &level.y, &level.z]);
            let pairs = voxels.codes.iter().zip(&voxels.counts).enumerate();
            (voxels, means) = Voxels::unite(pairs.map(|(i, (code, &n))| (code >> 3, [x[i], y[i], z[i]], n)), monitor)?;
        }
        match levels.is_empty() && voxels.codes.len() > limits.most_points {
            true => fine = l + 1,
            false => {
                levels.push(voxels.level(grid.size * f64::from(1u32 << l), std::mem::take(&mut means), monitor)?)
            }
        }
    }
    Ok((fine, levels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::voxels::sorted;
    use std::collections::BTreeMap;

    #[test]
    fn the_cascade_equals_direct_filtering_on_every_level() {
        let rows: Vec<[f64; 3]> = (0..3000)
            .map(|i| [f64::from(i * 7919 % 997) * 0.01, f64::from(i * 104_729 % 883) * 0.01, f64::from(i % 131) * 0.02])
            .collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let grid = Grid::new(&points, 0.1).unwrap();
        let points = sorted(points, &grid, &Monitor::default()).unwrap().positions;
        for (l, level) in build_levels(&points, &grid, 6, &Monitor::default()).unwrap().iter().enumerate() {
            let mut voxels: BTreeMap<[i64; 3], (f64, [f64; 3])> = BTreeMap::new();
            for i in 0..points.len() {
                let p = points.xyz(i).map(f64::from);
                let voxel = voxels.entry(p.map(|v| (v / (0.1 * f64::from(1 << l))).floor() as i64)).or_default();
                voxel.0 += 1.0;
                (0..3).for_each(|a| voxel.1[a] += p[a]);
            }
            let direct: Vec<[f32; 3]> = voxels.values().map(|(n, sum)| sum.map(|s| (s / n) as f32)).collect();
            let cascade: Vec<[f32; 3]> = (0..level.len()).map(|i| [level.x[i], level.y[i], level.z[i]]).collect();
            assert_eq!(direct.len(), cascade.len());
            let same = |a: &[f32; 3], b: &[f32; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-5);
            assert!(direct.iter().all(|a| cascade.iter().any(|b| same(a, b))));
        }
    }
}
