//! The k nearest points of a level for 16 queries at once: one SIMD lane a query, all with the same candidates.
//!
//! Consecutive queries in Morton order lie in a few cells. The points of these cells and of the ring of cells around
//! them are the candidates; each is inserted into the sorted list of every lane, without a branch. The lists hold one
//! number a candidate, its key: the first bits of the squared distance, then its place among the candidates. Only if two keys
//! differ in their places alone, distances and indices are compared in full.

use super::candidates::Candidates;
use super::level::Level;
use super::search::{Search, rim};
use pulp::Simd;
use std::ops::Range;

/// Number of queries that are searched together.
pub const LANES: usize = 16;
/// Largest distance of the queries of a batch, in cells on an axis.
const SPAN: u32 = 4;
/// Largest number of cells gathered for a batch.
const CELLS: u32 = 216;
/// Batches of fewer queries are searched one by one.
const FEW: usize = 2;
/// Largest number of bits of a key that are the place of a candidate: 13 or more of the fraction of the distance are left.
const PLACE_BITS: u32 = 10;

/// One number per query.
type Lane<T> = [T; LANES];

/// Up to 16 positions whose nearest points are searched together.
#[derive(Clone, Copy, Debug)]
pub struct Queries<'a> {
    /// x, y and z of each position, metres, not negative.
    pub at: &'a [Lane<f32>; 3],
    /// Number of positions: the first lanes.
    pub lanes: usize,
}

impl Queries<'_> {
    #[inline(always)]
    fn place(&self, lane: usize) -> [f32; 3] {
        [self.at[0][lane], self.at[1][lane], self.at[2][lane]]
    }
}

/// Consecutive queries that are near enough to share their candidates: those of the cells `cells` and of the ring around
/// them.
struct Run<'a> {
    queries: Queries<'a>,
    lanes: Range<usize>,
    cells: [[u32; 3]; 2],
}

/// One query, and the lane of its result.
#[derive(Clone, Copy)]
struct Query {
    at: [f32; 3],
    lane: usize,
}

impl Search {
    /// For each of the queries the indices of the `out.len()` points of `level` nearest to it, ascending by
    /// (distance, index): row j holds the j-th nearest of every query. Returns how many rows there are: fewer only if the
    /// level has fewer points.
    #[inline(always)]
    pub fn nearest_of_batch<S: Simd>(
        &mut self,
        simd: S,
        level: &Level,
        queries: Queries<'_>,
        out: &mut [Lane<u32>],
    ) -> usize {
        let wanted = out.len().min(level.len());
        let mut first = 0;
        while first < queries.lanes {
            let run = run(level, queries, first);
            first = run.lanes.end;
            match (run.lanes.len() >= FEW, &mut *out) {
                (true, out) if wanted == 9 => self.nearest_of_run::<S, 9>(simd, level, run, out),
                (true, out) if wanted == 10 => self.nearest_of_run::<S, 10>(simd, level, run, out),
                (_, out) => run.lanes.for_each(|l| {
                    self.one_lane(simd, level, Query { at: queries.place(l), lane: l }, out);
                }),
            }
        }
        wanted
    }

    /// The search of a single query, written into its lane.
    #[inline(never)]
    fn one_lane<S: Simd>(&mut self, simd: S, level: &Level, query: Query, out: &mut [Lane<u32>]) {
        let mut found = std::mem::take(&mut self.found);
        found.resize(out.len(), 0);
        let single = Single { search: self, level, at: query.at, out: &mut found };
        let count = simd.vectorize(single);
        out.iter_mut().zip(&found[..count]).for_each(|(row, &index)| row[query.lane] = index);
        self.found = found;
    }

    /// The search of a query whose nearest points may lie beyond the ring of its batch, written into its lane.
    #[inline(never)]
    fn widen_lane(&mut self, level: &Level, query: Query, out: &mut [Lane<u32>]) {
        self.widen(level, level.cell(query.at), query.at, out.len());
        let mut found = std::mem::take(&mut self.found);
        found.resize(out.len(), 0);
        self.write_best(&mut found);
        out.iter_mut().zip(&found).for_each(|(row, &index)| row[query.lane] = index);
        self.found = found;
    }

    #[inline(always)]
    fn nearest_of_run<S: Simd, const K: usize>(&mut self, simd: S, level: &Level, run: Run<'_>, out: &mut [Lane<u32>]) {
        self.candidates.gather(level, run.cells);
        let whole = self.candidates.index.len() == level.len();
        let [(x, _), (y, _), (z, _)] = [0, 1, 2].map(|a| S::as_simd_f32s(&run.queries.at[a]));
        for (part, ((&x, &y), &z)) in x.iter().zip(y).zip(z).enumerate() {
            let start = part * S::F32_LANES;
            let lanes = run.lanes.start.max(start)..run.lanes.end.min(start + S::F32_LANES);
            if lanes.is_empty() {
                continue;
            }
            let wanted = lanes.start - start..lanes.end - start;
            let found = match nearest_by_keys::<S, K>(simd, &self.candidates, [x, y, z], wanted) {
                Some(found) => found,
                None => nearest_lanes::<S, K>(simd, &self.candidates, [x, y, z]),
            };
            for l in lanes {
                let query = Query { at: run.queries.place(l), lane: l };
                let radius = rim(level, run.cells, query.at).max(0.0);
                if whole || found.farthest[l - start] <= radius * radius {
                    (0..K).for_each(|j| out[j][l] = found.rows[j][l - start]);
                } else {
                    self.widen_lane(level, query, out);
                }
            }
        }
    }
}

/// The search of a single query, compiled for each instruction set; called from the loop over lanes.
struct Single<'a> {
    search: &'a mut Search,
    level: &'a Level,
    at: [f32; 3],
    out: &'a mut [u32],
}

impl pulp::WithSimd for Single<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        self.search.nearest_with(simd, self.level, self.at, self.out)
    }
}

/// The queries from `first` on that are near enough to share their candidates.
#[inline(always)]
fn run<'a>(level: &Level, queries: Queries<'a>, first: usize) -> Run<'a> {
    let cell = |l: usize| level.cell(queries.place(l));
    let (mut low, mut high) = (cell(first), cell(first));
    for l in first + 1..queries.lanes {
        let next = cell(l);
        let (wider_low, wider_high) = ([0, 1, 2].map(|a| low[a].min(next[a])), [0, 1, 2].map(|a| high[a].max(next[a])));
        let edges = [0, 1, 2].map(|a| wider_high[a] - wider_low[a] + 1);
        if edges.iter().any(|&e| e > SPAN) || edges.iter().map(|e| e + 2).product::<u32>() > CELLS {
            return Run { queries, lanes: first..l, cells: [low, high] };
        }
        (low, high) = (wider_low, wider_high);
    }
    Run { queries, lanes: first..queries.lanes, cells: [low, high] }
}

/// The nearest candidates of every lane.
struct Nearest<const K: usize> {
    /// Their indices, nearest first.
    rows: [Lane<u32>; K],
    /// A squared distance that none of them exceeds.
    farthest: Lane<f32>,
}

/// The squared distance of a position from each lane. (Closures are not always inlined, and would be calls then.)
#[inline(always)]
fn apart<S: Simd>(simd: S, place: [f32; 3], at: [S::f32s; 3]) -> S::f32s {
    let x = simd.sub_f32s(simd.splat_f32s(place[0]), at[0]);
    let y = simd.sub_f32s(simd.splat_f32s(place[1]), at[1]);
    let z = simd.sub_f32s(simd.splat_f32s(place[2]), at[2]);
    let (x, y, z) = (simd.mul_f32s(x, x), simd.mul_f32s(y, y), simd.mul_f32s(z, z));
    simd.add_f32s(simd.add_f32s(x, y), z)
}

/// Whether no lane is set, if that is fast to tell: masks of one bit per lane are, wide masks are not.
#[inline(always)]
fn none<S: Simd>(simd: S, mask: S::m32s) -> bool {
    let is_fast = const { size_of::<S::m32s>() < size_of::<S::u32s>() };
    is_fast && simd.first_true_m32s(mask) == S::F32_LANES
}

/// The K nearest candidates of every lane, ascending by distance; `None` if keys cannot tell which of two is nearer in one of
/// the `wanted` lanes.
#[inline(always)]
fn nearest_by_keys<S: Simd, const K: usize>(
    simd: S,
    candidates: &Candidates,
    at: [S::f32s; 3],
    wanted: Range<usize>,
) -> Option<Nearest<K>> {
    let count = candidates.index.len();
    let bits = usize::BITS - count.leading_zeros();
    if count < K || bits > PLACE_BITS {
        return None;
    }
    let places = (1u32 << bits) - 1;
    let distances = simd.splat_u32s(!places);
    // One more than the K: the next one tells whether the last of them is certain.
    let (mut keys, mut next) = ([simd.splat_u32s(u32::MAX); K], simd.splat_u32s(u32::MAX));
    let positions = candidates.x.iter().zip(&candidates.y).zip(&candidates.z);
    for (i, ((&x, &y), &z)) in (0u32..).zip(positions) {
        let distance = simd.transmute_u32s_f32s(apart(simd, [x, y, z], at));
        let key = simd.or_u32s(simd.and_u32s(distance, distances), simd.splat_u32s(i));
        if none(simd, simd.less_than_u32s(key, next)) {
            continue;
        }
        next = simd.min_u32s(next, simd.max_u32s(keys[K - 1], key));
        for s in (1..K).rev() {
            keys[s] = simd.min_u32s(keys[s], simd.max_u32s(keys[s - 1], key));
        }
        keys[0] = simd.min_u32s(keys[0], key);
    }
    let mut least = simd.xor_u32s(keys[K - 1], next);
    for s in 1..K {
        least = simd.min_u32s(least, simd.xor_u32s(keys[s - 1], keys[s]));
    }
    let mut differ = [0; LANES];
    S::as_mut_simd_u32s(&mut differ).0[0] = least;
    if differ[wanted].iter().any(|&bits| bits <= places) {
        return None;
    }
    let mut found = Nearest { rows: [[0; LANES]; K], farthest: [0.0; LANES] };
    let farthest = simd.transmute_f32s_u32s(simd.or_u32s(keys[K - 1], simd.splat_u32s(places)));
    S::as_mut_simd_f32s(&mut found.farthest).0[0] = farthest;
    for (row, key) in found.rows.iter_mut().zip(keys) {
        S::as_mut_simd_u32s(row).0[0] = key;
        // Lanes that are not wanted may hold anything.
        row[..S::F32_LANES]
            .iter_mut()
            .for_each(|key| *key = candidates.index[((*key & places) as usize).min(count - 1)]);
    }
    Some(found)
}

/// The K nearest candidates of every lane, ascending by (distance, index): candidates come in ascending order of the
/// index, and only a smaller distance is inserted before another.
#[inline(always)]
fn nearest_lanes<S: Simd, const K: usize>(simd: S, candidates: &Candidates, at: [S::f32s; 3]) -> Nearest<K> {
    let mut best = [simd.splat_f32s(f32::INFINITY); K];
    let mut index = [simd.splat_u32s(u32::MAX); K];
    let places = candidates.x.iter().zip(&candidates.y).zip(&candidates.z).zip(&candidates.index);
    for (((&x, &y), &z), &i) in places {
        let d = apart(simd, [x, y, z], at);
        let mut here = simd.less_than_f32s(d, best[K - 1]);
        if none(simd, here) {
            continue;
        }
        let i = simd.splat_u32s(i);
        for s in (1..K).rev() {
            let above = simd.less_than_f32s(d, best[s - 1]);
            index[s] = simd.select_u32s(here, simd.select_u32s(above, index[s - 1], i), index[s]);
            best[s] = simd.min_f32s(best[s], simd.max_f32s(best[s - 1], d));
            here = above;
        }
        index[0] = simd.select_u32s(here, i, index[0]);
        best[0] = simd.min_f32s(best[0], d);
    }
    let mut found = Nearest { rows: [[0; LANES]; K], farthest: [0.0; LANES] };
    S::as_mut_simd_f32s(&mut found.farthest).0[0] = best[K - 1];
    found.rows.iter_mut().zip(index).for_each(|(row, index)| S::as_mut_simd_u32s(row).0[0] = index);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::parallel::Monitor;
    use crate::random::stream;
    use crate::voxels::{Grid, build_levels, sorted};
    use pulp::{Arch, WithSimd};

    struct Batch<'a>(&'a mut Search, &'a Level, [Lane<f32>; 3], usize, &'a mut [Lane<u32>]);

    impl WithSimd for Batch<'_> {
        type Output = usize;

        fn with_simd<S: Simd>(self, simd: S) -> usize {
            self.0.nearest_of_batch(simd, self.1, Queries { at: &self.2, lanes: self.3 }, self.4)
        }
    }

    /// Every batch of every level against brute force, in order of (distance, index); also without vector instructions.
    fn check(rows: &[[f64; 3]], size: f64, k: usize) {
        let points = Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0);
        let grid = Grid::new(&points, size).unwrap();
        let points = sorted(points, &grid, &Monitor::default()).unwrap().positions;
        for level in build_levels(&points, &grid, 4, &Monitor::default()).unwrap() {
            let (mut search, mut scalar) = (Search::default(), Search::default());
            for first in (0..points.len()).step_by(LANES * points.len().div_ceil(600)) {
                let lanes = LANES.min(points.len() - first);
                let at = [&points.x, &points.y, &points.z]
                    .map(|axis| std::array::from_fn(|l| axis[(first + l).min(points.len() - 1)]));
                let mut found = vec![[0; LANES]; k];
                let n = Arch::new().dispatch(Batch(&mut search, &level, at, lanes, &mut found));
                let mut plain = vec![[0; LANES]; k];
                pulp::Scalar::new().vectorize(Batch(&mut scalar, &level, at, lanes, &mut plain));
                for l in 0..lanes {
                    let apart = |j: usize| {
                        [(level.x[j], at[0][l]), (level.y[j], at[1][l]), (level.z[j], at[2][l])]
                            .map(|(v, a)| (v - a) * (v - a))
                    };
                    let mut all: Vec<(f32, u32)> =
                        (0..level.len()).map(|j| (apart(j)[0] + apart(j)[1] + apart(j)[2], j as u32)).collect();
                    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    let expected: Vec<u32> = all.iter().take(k).map(|b| b.1).collect();
                    let lane = |rows: &[Lane<u32>]| rows[..n].iter().map(|row| row[l]).collect::<Vec<u32>>();
                    assert_eq!(lane(&found), expected, "query {} of level {}", first + l, level.size);
                    assert_eq!(lane(&plain), expected, "query {} of level {}, no vectors", first + l, level.size);
                }
            }
        }
    }

    fn random(n: usize, extent: [f64; 3]) -> Vec<[f64; 3]> {
        let mut s = stream(4, n as u64);
        (0..n).map(|_| extent.map(|e| s.uniform() * e)).collect()
    }

    #[test]
    fn batches_equal_brute_force_on_surfaces_volumes_and_sparse_clouds() {
        check(&random(4000, [40.0, 40.0, 0.3]), 0.4, 9);
        check(&random(3000, [8.0, 8.0, 8.0]), 0.4, 10);
        check(&random(1500, [300.0, 300.0, 20.0]), 0.025, 9);
        check(&random(1000, [30.0, 30.0, 3.0]), 0.4, 5);
    }

    #[test]
    fn batches_order_ties_by_index() {
        let lattice: Vec<[f64; 3]> =
            (0..2197).map(|i| [f64::from(i % 13), f64::from(i / 13 % 13), f64::from(i / 169)]).collect();
        check(&lattice, 0.5, 9);
        check(&lattice, 0.5, 10);
        check(&lattice, 0.5, 12);
    }

    #[test]
    fn batches_equal_brute_force_with_outliers_clumps_and_few_points() {
        let mut rows = random(1500, [3.0, 3.0, 1.0]);
        rows.extend(random(300, [2000.0, 2000.0, 100.0]));
        rows.push([20_000.0, 9.0, 700.0]);
        check(&rows, 0.05, 9);
        check(&random(7, [5.0, 5.0, 5.0]), 0.1, 9);
        check(&random(9, [5.0, 5.0, 5.0]), 0.1, 9);
        check(&vec![[1.0, 2.0, 3.0]; 500], 0.25, 10);
        check(&(0..33).map(|i| [5.0, 5.0, f64::from(i)]).collect::<Vec<_>>(), 0.25, 9);
    }
}
