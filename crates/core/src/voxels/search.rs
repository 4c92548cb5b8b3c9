//! The k nearest points of a level, exactly; ties go to the smaller index.
//!
//! Consecutive queries in Morton order share the points gathered for their cell: those of the 27 cells around it.
//! Points nearer than the border of these cells are certain to be among the nearest; only if there are fewer than k of
//! them the search is widened.

use super::blocks::Around;
use super::candidates::Candidates;
use super::level::Level;
use super::morton;
use pulp::{Arch, Simd, WithSimd};

/// Squared distance and index of a point of the level.
pub type Neighbour = (f32, u32);

/// Up to this many certain candidates are ranked by counting, more are sorted.
const RANKED: usize = 64;
const LANES: usize = 16;

/// Scratch memory for the searches of one thread. Results do not depend on previous searches.
#[derive(Clone, Debug, Default)]
pub struct Search {
    around: Around,
    cell: Option<[u32; 3]>,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    index: Vec<u32>,
    distance: Vec<f32>,
    certain: Vec<u32>,
    best: Vec<Neighbour>,
    pub(super) found: Vec<u32>,
    pub(super) candidates: Candidates,
}

impl Search {
    /// Discards the gathered cell; to be called before another level is searched.
    pub fn reset(&mut self) {
        self.cell = None;
        self.around = Around::default();
        self.candidates.reset();
    }

    /// Writes the indices of the `out.len()` points of `level` nearest to `at`, ascending by (distance, index), and
    /// returns their number: fewer only if the level has fewer. Coordinates must not be negative.
    ///
    /// Expected O(1) if the density varies little, O(blocks) for queries far from all points.
    pub fn nearest(&mut self, level: &Level, at: [f32; 3], out: &mut [u32]) -> usize {
        Arch::new().dispatch(Nearest { search: self, level, at, out })
    }

    /// [`Search::nearest`] for callers that have already dispatched to an instruction set.
    #[inline(always)]
    pub fn nearest_with<S: Simd>(&mut self, simd: S, level: &Level, at: [f32; 3], out: &mut [u32]) -> usize {
        let cell = level.cell(at);
        if self.cell != Some(cell) {
            self.cell = Some(cell);
            self.gather(level, cell, 1);
        }
        self.measure(at);
        let wanted = out.len().min(level.len());
        let radius = rim(level, [cell, cell], at).max(0.0);
        self.keep_certain(radius * radius);
        if self.index.len() == level.len() {
            self.certain.clear();
            self.certain.extend(0..self.index.len() as u32);
        } else if self.certain.len() < wanted {
            self.widen(level, cell, at, wanted);
            self.write_best(out);
            return wanted;
        }
        if self.certain.len() > RANKED || !self.rank(simd, wanted, out) {
            self.sort(wanted, out);
        }
        wanted
    }

    #[inline(never)]
    fn gather(&mut self, level: &Level, cell: [u32; 3], rings: u32) {
        self.around.move_to(&level.blocks, cell);
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.index.clear();
        let span = 2 * rings + 1;
        for i in 0..span * span * span {
            let offset = [i % span, i / span % span, i / (span * span)];
            let near = [0, 1, 2].map(|a| (cell[a] + offset[a]).wrapping_sub(rings));
            let range = self.around.cell(&level.blocks, near);
            self.x.extend_from_slice(&level.x[range.clone()]);
            self.y.extend_from_slice(&level.y[range.clone()]);
            self.z.extend_from_slice(&level.z[range.clone()]);
            self.index.extend(range.start as u32..range.end as u32);
        }
    }

    #[inline(always)]
    fn measure(&mut self, at: [f32; 3]) {
        self.distance.resize(self.x.len(), 0.0);
        let points = self.x.iter().zip(&self.y).zip(&self.z);
        for (d, ((x, y), z)) in self.distance.iter_mut().zip(points) {
            *d = squared(*x - at[0], *y - at[1], *z - at[2]);
        }
    }

    /// Indices of the candidates within a distance, without a branch.
    #[inline(always)]
    fn keep_certain(&mut self, limit: f32) {
        self.certain.resize(self.distance.len() + 1, 0);
        let mut kept = 0usize;
        for (i, &d) in self.distance.iter().enumerate() {
            self.certain[kept] = i as u32;
            kept = kept.wrapping_add(usize::from(d <= limit));
        }
        self.certain.truncate(kept);
    }

    /// Sorts by counting, for each candidate, those that are nearer. False if a tie makes the order ambiguous.
    #[inline(always)]
    fn rank<S: Simd>(&self, simd: S, wanted: usize, out: &mut [u32]) -> bool {
        let mut distance = [f32::INFINITY; RANKED];
        let n = self.certain.len();
        for (slot, &i) in distance.iter_mut().zip(&self.certain) {
            *slot = self.distance[i as usize];
        }
        let nearer = count_nearer(simd, &distance, n);
        let (mut filled, mut chosen) = (0u64, 0usize);
        for (&rank, &i) in nearer.iter().zip(&self.certain) {
            if let Some(slot) = out.get_mut(rank as usize) {
                *slot = self.index[i as usize];
            }
            filled |= 1 << (rank & 63);
            chosen = chosen.wrapping_add(usize::from((rank as usize) < wanted));
        }
        chosen == wanted && filled.trailing_ones() as usize >= wanted
    }

    #[inline(never)]
    fn sort(&mut self, wanted: usize, out: &mut [u32]) {
        self.best.clear();
        self.best.extend(self.certain.iter().map(|&i| (self.distance[i as usize], self.index[i as usize])));
        shrink(&mut self.best, wanted);
        self.write_best(out);
    }

    /// Writes the nearest candidates in order.
    pub(super) fn write_best(&mut self, out: &mut [u32]) {
        self.best.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        out.iter_mut().zip(&self.best).for_each(|(slot, &(_, index))| *slot = index);
    }

    /// Searches two rings of cells, then every block that may hold a nearer point.
    #[inline(never)]
    pub(super) fn widen(&mut self, level: &Level, cell: [u32; 3], at: [f32; 3], wanted: usize) {
        self.gather(level, cell, 2);
        self.cell = None;
        self.measure(at);
        self.best.clear();
        self.best.extend(self.distance.iter().copied().zip(self.index.iter().copied()));
        shrink(&mut self.best, wanted);
        let wide = [cell.map(|c| c.saturating_sub(1)), cell.map(|c| c + 1)];
        let radius = rim(level, wide, at).max(0.0);
        if self.best.len() == wanted && self.best.iter().all(|b| b.0 <= radius * radius) {
            return;
        }
        self.best.clear();
        let mut limit = f32::INFINITY;
        for (low, group) in near(level, at, level.groups.iter().map(|(key, range)| (*key, 32.0, range.clone()))) {
            if low > limit {
                break;
            }
            for (low, block) in near(level, at, group.map(|b| (level.blocks.key(b), 4.0, b))) {
                if low > limit {
                    break;
                }
                limit = self.visit(level, block, at, Reach { wanted, limit });
            }
        }
    }

    /// Adds the points of a block to the candidates; returns the distance beyond which no point is needed any more.
    fn visit(&mut self, level: &Level, block: usize, at: [f32; 3], reach: Reach) -> f32 {
        let Reach { wanted, limit } = reach;
        for i in level.blocks.points(block) {
            let d = squared(level.x[i] - at[0], level.y[i] - at[1], level.z[i] - at[2]);
            if d <= limit {
                self.best.push((d, i as u32));
            }
        }
        if self.best.len() < wanted {
            return limit;
        }
        shrink(&mut self.best, wanted);
        self.best.iter().fold(0.0, |m, b| b.0.max(m))
    }
}

/// How far a search still goes.
#[derive(Clone, Copy)]
struct Reach {
    /// Number of nearest points.
    wanted: usize,
    /// Squared distance beyond which no point is needed, m².
    limit: f32,
}

/// For each of the distances the number of the first `n` that are smaller.
#[inline(always)]
fn count_nearer<S: Simd>(simd: S, distance: &[f32; RANKED], n: usize) -> [u32; RANKED] {
    let mut nearer = [0u32; RANKED];
    let used = n.next_multiple_of(LANES);
    let (lanes, _) = S::as_simd_f32s(&distance[..used]);
    let (counts, _) = S::as_mut_simd_u32s(&mut nearer[..used]);
    let (one, none) = (simd.splat_u32s(1), simd.splat_u32s(0));
    for (count, &other) in counts.iter_mut().zip(lanes) {
        let mut sum = none;
        for &d in &distance[..n] {
            let is_nearer = simd.less_than_f32s(simd.splat_f32s(d), other);
            sum = simd.add_u32s(sum, simd.select_u32s(is_nearer, one, none));
        }
        *count = sum;
    }
    nearer
}

/// The search of a single query, compiled for each instruction set.
struct Nearest<'a> {
    search: &'a mut Search,
    level: &'a Level,
    at: [f32; 3],
    out: &'a mut [u32],
}

impl WithSimd for Nearest<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        self.search.nearest_with(simd, self.level, self.at, self.out)
    }
}

#[inline(always)]
fn squared(x: f32, y: f32, z: f32) -> f32 {
    x * x + y * y + z * z
}

/// Keeps the `wanted` smallest by (distance, index).
fn shrink(best: &mut Vec<Neighbour>, wanted: usize) {
    if best.len() > wanted {
        best.select_nth_unstable_by(wanted, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        best.truncate(wanted);
    }
}

/// Radius of certainty around `at` when the cells `low..=high` and a ring around them are gathered: the distance to
/// their border.
#[inline(always)]
pub(super) fn rim(level: &Level, [low, high]: [[u32; 3]; 2], at: [f32; 3]) -> f32 {
    let mut distance = f64::INFINITY;
    for a in 0..3 {
        let from = (f64::from(low[a]) - 1.0) * level.cell_size;
        let to = (f64::from(high[a]) + 2.0) * level.cell_size;
        distance = distance.min(f64::from(at[a]) - from).min(to - f64::from(at[a]));
    }
    (distance as f32) * (1.0 - 1e-5) - 4.0 * level.rounding
}

/// Cubes (Morton key, edge in cells, content) with a lower bound of their squared distance, nearest first.
fn near<T>(level: &Level, at: [f32; 3], cubes: impl Iterator<Item = (u64, f64, T)>) -> Vec<(f32, T)> {
    let bound = |(key, cells, content): (u64, f64, T)| {
        let edge = cells * level.cell_size;
        let corner = morton::decode(key).map(|c| f64::from(c) * edge);
        let apart = |a: usize| (corner[a] - f64::from(at[a])).max(f64::from(at[a]) - corner[a] - edge).max(0.0);
        let away = (apart(0).powi(2) + apart(1).powi(2) + apart(2).powi(2)).sqrt();
        let certain = (away as f32 * (1.0 - 1e-5) - 4.0 * level.rounding).max(0.0);
        (certain * certain, content)
    };
    let mut near: Vec<(f32, T)> = cubes.map(bound).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::parallel::Monitor;
    use crate::random::stream;
    use crate::voxels::{Grid, build_levels, sorted};

    /// Every point of every level and points between them, against brute force; ties by index.
    fn check(rows: &[[f64; 3]], size: f64, k: usize) {
        let points = Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0);
        let grid = Grid::new(&points, size).unwrap();
        let points = sorted(points, &grid, &Monitor::default()).unwrap().positions;
        for level in build_levels(&points, &grid, 4, &Monitor::default()).unwrap() {
            let mut search = Search::default();
            for i in (0..points.len()).step_by(points.len().div_ceil(300)) {
                let at = points.xyz(i);
                let mut found = vec![0; k];
                let n = search.nearest(&level, at, &mut found);
                let mut all: Vec<Neighbour> = (0..level.len())
                    .map(|j| (squared(level.x[j] - at[0], level.y[j] - at[1], level.z[j] - at[2]), j as u32))
                    .collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let expected: Vec<u32> = all.iter().take(k).map(|b| b.1).collect();
                found.truncate(n);
                assert_eq!(found, expected, "point {i} of level {}", level.size);
            }
        }
    }

    fn random(n: usize, extent: [f64; 3]) -> Vec<[f64; 3]> {
        let mut s = stream(3, n as u64);
        (0..n).map(|_| extent.map(|e| s.uniform() * e)).collect()
    }

    #[test]
    fn equals_brute_force_on_a_surface_and_in_a_volume() {
        check(&random(4000, [40.0, 40.0, 0.3]), 0.4, 10);
        check(&random(4000, [8.0, 8.0, 8.0]), 0.4, 9);
    }

    #[test]
    fn equals_brute_force_where_the_voxel_is_far_finer_than_the_spacing() {
        check(&random(1500, [300.0, 300.0, 20.0]), 0.025, 10);
    }

    #[test]
    fn equals_brute_force_on_a_lattice_full_of_ties() {
        let lattice: Vec<[f64; 3]> =
            (0..2197).map(|i| [f64::from(i % 13), f64::from(i / 13 % 13), f64::from(i / 169)]).collect();
        check(&lattice, 0.5, 10);
    }

    #[test]
    fn equals_brute_force_with_far_outliers_and_dense_clumps() {
        let mut rows = random(1500, [3.0, 3.0, 1.0]);
        rows.extend(random(300, [2000.0, 2000.0, 100.0]));
        rows.push([20_000.0, 9.0, 700.0]);
        check(&rows, 0.05, 10);
    }

    #[test]
    fn equals_brute_force_on_a_line_and_on_identical_points() {
        check(&(0..33).map(|i| [5.0, 5.0, f64::from(i)]).collect::<Vec<_>>(), 0.25, 10);
        check(&vec![[1.0, 2.0, 3.0]; 5000], 0.25, 10);
    }

    #[test]
    fn a_level_of_fewer_points_gives_them_all() {
        check(&random(7, [5.0, 5.0, 5.0]), 0.1, 10);
    }
}
