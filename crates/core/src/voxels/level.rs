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

/// Number of voxels between two checks for cancellation.
const LOOK: usize = 65_536;

/// A voxel and the mean of its points.
#[derive(Clone, Copy)]
struct Voxel {
    code: u64,
    mean: [f32; 3],
    points: u32,
}

impl Voxel {
    /// The same as a part of the voxel of twice the edge.
    fn coarser(self) -> Self {
        Self { code: self.code >> 3, ..self }
    }
}

/// Unites consecutive parts with the same code to voxels.
struct United<I> {
    parts: I,
    /// The first part of the next voxel.
    next: Option<Voxel>,
}

impl<I: Iterator<Item = Voxel>> United<I> {
    fn new(mut parts: I) -> Self {
        Self { next: parts.next(), parts }
    }
}

impl<I: Iterator<Item = Voxel>> Iterator for United<I> {
    type Item = Voxel;

    fn next(&mut self) -> Option<Voxel> {
        let Voxel { code, .. } = self.next?;
        let (mut sum, mut points) = ([0.0f64; 3], 0);
        while let Some(part) = self.next.filter(|part| part.code == code) {
            (0..3).for_each(|a| sum[a] += f64::from(part.mean[a]) * f64::from(part.points));
            points += part.points;
            self.next = self.parts.next();
        }
        Some(Voxel { code, mean: sum.map(|s| (s / f64::from(points)) as f32), points })
    }
}

/// Number of voxels on each level.
struct VoxelCounts([usize; VoxelCounts::LEVELS]);

impl VoxelCounts {
    /// Codes have 63 bits, three a level; on the last level there is one voxel.
    const LEVELS: usize = 22;

    /// The voxels of points in the grid's Morton order.
    fn new(points: &Positions, grid: &Grid, monitor: &Monitor) -> Result<Self> {
        let (mut first, mut last) = ([0; Self::LEVELS + 1], None);
        for piece in watched(points.len(), monitor) {
            for i in piece? {
                let code = grid.code(points.xyz(i));
                let other = |last: u64| (u64::BITS - (last ^ code).leading_zeros()).div_ceil(3) as usize;
                // Its voxels of so many levels do not hold the point before.
                first[last.map_or(Self::LEVELS, other)] += 1;
                last = Some(code);
            }
        }
        Ok(Self(std::array::from_fn(|level| first[level + 1..].iter().sum())))
    }

    fn of(&self, level: usize) -> usize {
        self.0[level.min(Self::LEVELS - 1)]
    }

    /// Number of times the edge of a level's voxels is doubled so that occupied cells hold [`POINTS_PER_CELL`] points on
    /// average.
    fn doublings(&self, level: usize) -> u32 {
        let enough = |&doublings: &u32| self.of(level + doublings as usize) * POINTS_PER_CELL <= self.of(level) + 8;
        (1..20).find(enough).unwrap_or(20)
    }
}

/// The voxels of a level, during the construction.
#[derive(Default)]
struct Voxels {
    codes: Vec<u64>,
    points: Vec<u32>,
    means: [Vec<f32>; 3],
}

impl Voxels {
    /// Collects `count` voxels.
    fn new(count: usize, voxels: impl Iterator<Item = Voxel>, monitor: &Monitor) -> Result<Self> {
        let mut all = Self {
            codes: Vec::with_capacity(count),
            points: Vec::with_capacity(count),
            means: [0; 3].map(|_| Vec::with_capacity(count)),
        };
        for (i, Voxel { code, mean, points }) in voxels.enumerate() {
            if i % LOOK == 0 {
                monitor.check()?;
            }
            all.codes.push(code);
            all.points.push(points);
            all.means.iter_mut().zip(mean).for_each(|(axis, v)| axis.push(v));
        }
        Ok(all)
    }

    /// The level of these voxels, whose edge is `size`; their means become its own. Cells of its search grid are voxels
    /// whose edge is doubled so many times.
    fn level(&mut self, size: f64, doublings: u32, monitor: &Monitor) -> Result<Level> {
        let [x, y, z] = std::mem::take(&mut self.means);
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

    /// The voxels of twice the edge, of which there are `count`; `level` has the means of these.
    fn coarser(&self, level: &Level, count: usize, monitor: &Monitor) -> Result<Self> {
        let voxel = |i: usize| Voxel {
            code: self.codes[i],
            mean: [level.x[i], level.y[i], level.z[i]],
            points: self.points[i],
        };
        Self::new(count, United::new((0..level.len()).map(|i| voxel(i).coarser())), monitor)
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
    let counts = VoxelCounts::new(points, grid, monitor)?;
    let fine = (0..limits.levels).take_while(|&level| counts.of(level) > limits.most_points).count();
    let mut levels = Vec::<Level>::new();
    if fine == limits.levels {
        return Ok((fine, levels));
    }
    // The voxels of the levels that are skipped are united one after the other, and never held.
    let parts = (0..points.len()).map(|i| Voxel { code: grid.code(points.xyz(i)), mean: points.xyz(i), points: 1 });
    let mut finest: Box<dyn Iterator<Item = Voxel>> = Box::new(United::new(parts));
    for _ in 0..fine {
        finest = Box::new(United::new(finest.map(Voxel::coarser)));
    }
    let mut voxels = Voxels::new(counts.of(fine), finest, monitor)?;
    for number in fine..limits.levels {
        if let Some(finer) = levels.last() {
            voxels = voxels.coarser(finer, counts.of(number), monitor)?;
        }
        let size = grid.size * f64::from(1u32 << number);
        levels.push(voxels.level(size, counts.doublings(number), monitor)?);
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

    #[test]
    fn levels_are_the_same_if_finer_ones_are_skipped() {
        let rows: Vec<[f64; 3]> = (0..4000)
            .map(|i| [f64::from(i * 7919 % 997) * 0.02, f64::from(i * 104_729 % 883) * 0.02, f64::from(i % 131) * 0.02])
            .collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let (grid, monitor) = (Grid::new(&points, 0.1).unwrap(), Monitor::default());
        let points = sorted(points, &grid, &monitor).unwrap().positions;
        let all = build_levels(&points, &grid, 6, &monitor).unwrap();
        let distinct = |level: u32| {
            let codes: std::collections::BTreeSet<u64> =
                (0..points.len()).map(|i| grid.code(points.xyz(i)) >> (3 * level)).collect();
            codes.len()
        };
        let counts: Vec<usize> = (0..6).map(distinct).collect();
        assert_eq!(all.iter().map(Level::len).collect::<Vec<_>>(), counts);
        for skipped in 0..=6 {
            let limits = LevelLimits { levels: 6, most_points: counts.get(skipped).copied().unwrap_or(0) };
            let (fine, levels) = coarse_levels(&points, &grid, limits, &monitor).unwrap();
            assert_eq!((fine, levels.len()), (skipped, 6 - skipped));
            for (level, same) in levels.iter().zip(&all[skipped..]) {
                assert_eq!([&level.x, &level.y, &level.z], [&same.x, &same.y, &same.z]);
            }
        }
        for (level, of) in (0u32..).zip(&all) {
            // Cells of the search hold five points on average, those of half the edge fewer.
            let doublings = (of.cell_size / of.size).log2().round() as u32;
            let per_cell = |doublings: u32| of.len() as f64 / distinct(level + doublings) as f64;
            assert!(per_cell(doublings) >= 4.9 || of.len() < 100, "{level}: {}", per_cell(doublings));
            assert!(doublings == 1 || per_cell(doublings - 1) < 5.1, "{level}");
        }
    }
}
