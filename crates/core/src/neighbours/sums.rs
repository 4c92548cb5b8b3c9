//! Sums over the points around 16 places at once: one SIMD lane a place, all with the same candidates.
//!
//! From the sums follow the number or weight of the points around a place, their mean and their covariance. Candidates come from
//! [`Stacks`], so that the places of a batch share their runs.

use super::stacks::{Block, Stacks};
use crate::cloud::Positions;
use crate::error::Result;
use crate::linalg::Sym3;
use crate::linalg::jacobi::{LaneEigen, jacobi};
use crate::parallel::{Monitor, concat_watched, map_ordered_with};
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Number of places that are described together.
pub(crate) const LANES: usize = 16;
/// Candidates whose sums are kept in `f32` before they are added to the totals in `f64`: few enough that their rounding
/// is below that of the coordinates.
const IN_SINGLE: usize = 64;
/// Weight, 3 sums of coordinates, 6 of products.
const SUMS: usize = 10;
/// Places that one task of [`Around::map`] takes.
const BLOCK: usize = 2048;

/// The points that count as neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Those within the radius.
    #[default]
    Sphere,
    /// Those within the radius in plan, at any height.
    Cylinder,
}

/// How much the points around a place count.
pub(crate) trait Weighing: Copy + Sync {
    /// Weights of a point of the stacks at some places, from its squared distances.
    fn weights<S: Simd>(&self, simd: S, point: usize, squared: S::f32s) -> S::f32s;
}

/// All count alike.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Alike;

impl Weighing for Alike {
    #[inline(always)]
    fn weights<S: Simd>(&self, simd: S, _: usize, _: S::f32s) -> S::f32s {
        simd.splat_f32s(1.0)
    }
}

/// Each has its own weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weighted<'a> {
    /// In the order of the stacks, not negative.
    pub(crate) weights: &'a [f32],
}

impl Weighing for Weighted<'_> {
    #[inline(always)]
    fn weights<S: Simd>(&self, simd: S, point: usize, _: S::f32s) -> S::f32s {
        simd.splat_f32s(self.weights[point])
    }
}

/// Each has its own weight, times exp(−d² / 2σ²) at the distance d.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaussian<'a> {
    /// In the order of the stacks, not negative.
    weights: &'a [f32],
    /// 1 / 2σ².
    falloff: f32,
}

impl<'a> Gaussian<'a> {
    /// Standard deviations at which the neighbourhood is cut off: as far as the series of the exponential function goes.
    const CUT: f64 = 2.5;

    /// Radius of the neighbourhood for the standard deviation σ, metres.
    pub(crate) fn radius(sigma: f64) -> f64 {
        Self::CUT * sigma
    }

    /// With the standard deviation σ, metres.
    pub(crate) fn new(weights: &'a [f32], sigma: f64) -> Self {
        Self { weights, falloff: (0.5 / (sigma * sigma)) as f32 }
    }
}

impl Weighing for Gaussian<'_> {
    #[inline(always)]
    fn weights<S: Simd>(&self, simd: S, point: usize, squared: S::f32s) -> S::f32s {
        let exponent = simd.mul_f32s(squared, simd.splat_f32s(self.falloff));
        simd.mul_f32s(simd.splat_f32s(self.weights[point]), falling(simd, exponent))
    }
}

/// exp(−x) for x from 0 to 3.2, to 3e-7: the series of exp(−x / 8), to the power of 8.
#[inline(always)]
fn falling<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    const SERIES: [f32; 7] = [-1.0 / 5040.0, 1.0 / 720.0, -1.0 / 120.0, 1.0 / 24.0, -1.0 / 6.0, 0.5, -1.0];
    let eighth = simd.mul_f32s(x, simd.splat_f32s(0.125));
    let mut sum = simd.splat_f32s(1.0 / 40320.0);
    for factor in SERIES {
        sum = simd.add_f32s(simd.mul_f32s(sum, eighth), simd.splat_f32s(factor));
    }
    let mut power = simd.add_f32s(simd.mul_f32s(sum, eighth), simd.splat_f32s(1.0));
    for _ in 0..3 {
        power = simd.mul_f32s(power, power);
    }
    power
}

/// What is summed around each place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around<'a, W> {
    /// The points; sorted for this radius or a smaller one.
    pub(crate) stacks: &'a Stacks,
    /// Metres.
    pub(crate) radius: f64,
    pub(crate) shape: Shape,
    pub(crate) weighing: W,
}

/// Scratch memory of one thread.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    runs: Vec<Range<u32>>,
    pub(crate) sums: Sums,
}

impl<W: Weighing> Around<'_, W> {
    /// What a function makes of the points around each place, in the order of the places. Places that follow each other should be
    /// close: up to 16 share a search.
    ///
    /// O(m) for m points around all places together; memory for the results twice. The same for any number of threads.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(crate) fn map<T, F>(&self, places: &Positions, monitor: &Monitor, each: F) -> Result<Vec<T>>
    where
        T: Send,
        F: Fn(usize, &Surrounding) -> T + Sync,
    {
        let parts = map_ordered_with(0..places.len().div_ceil(BLOCK), monitor, Scratch::default, |scratch, block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(places.len());
            Arch::new().dispatch(MapBlock { around: self, places, range, each: &each, monitor, scratch })
        })?;
        concat_watched(parts, monitor)
    }
}

/// The places of a block, compiled for each instruction set.
struct MapBlock<'a, W, F> {
    around: &'a Around<'a, W>,
    places: &'a Positions,
    range: Range<usize>,
    each: &'a F,
    monitor: &'a Monitor,
    scratch: &'a mut Scratch,
}

impl<W: Weighing, T, F: Fn(usize, &Surrounding) -> T> WithSimd for MapBlock<'_, W, F> {
    type Output = Result<Vec<T>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Vec<T>> {
        let Self { around, places, range, each, monitor, scratch } = self;
        let mut found = Vec::with_capacity(range.len());
        let mut first = range.start;
        while first < range.end {
            monitor.check()?;
            let batch = Batch::of(around, places, first..range.end);
            batch.sum(simd, scratch);
            let solved = scratch.sums.solve(0.0);
            found.extend((0..batch.points.len()).map(|lane| each(first + lane, &solved.of(lane))));
            first = batch.points.end;
        }
        Ok(found)
    }
}

/// Up to 16 consecutive places whose neighbours are searched together.
pub(crate) struct Batch<'a, W> {
    around: &'a Around<'a, W>,
    places: &'a Positions,
    pub(crate) points: Range<usize>,
    /// The box that holds them.
    block: Block,
}

impl<'a, W: Weighing> Batch<'a, W> {
    /// The first of these places that lie within a cube of the radius; neighbours are points of the stacks.
    pub(crate) fn of(around: &'a Around<'a, W>, places: &'a Positions, range: Range<usize>) -> Self {
        let mut block = Block::at(places.xyz(range.start));
        let mut end = range.start + 1;
        while end < range.end.min(range.start + LANES) {
            let wider = block.with(places.xyz(end));
            if !wider.is_within(around.radius) {
                break;
            }
            (block, end) = (wider, end + 1);
        }
        Self { around, places, points: range.start..end, block }
    }

    /// The box whose surroundings are searched: for cylinders, of any height.
    fn reach(&self) -> Block {
        let mut reach = self.block;
        if self.around.shape == Shape::Cylinder {
            (reach.low[2], reach.high[2]) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        reach
    }

    /// Sums over the points around each place; lanes without a place repeat the first.
    #[inline(always)]
    pub(crate) fn sum<S: Simd>(&self, simd: S, scratch: &mut Scratch) {
        let Self { around: &Around { stacks, radius, shape, weighing }, ref points, .. } = *self;
        let mut places = Places { at: [[0.0; LANES]; 3], limit: (radius * radius) as f32 };
        for lane in 0..LANES {
            let point = if lane < points.len() { points.start + lane } else { points.start };
            let at = self.places.xyz(point);
            (0..3).for_each(|a| places.at[a][lane] = at[a]);
        }
        stacks.runs(&self.reach(), radius, &mut scratch.runs);
        scratch.sums.clear();
        for run in &scratch.runs {
            let run = run.start as usize..run.end as usize;
            let candidates = Candidates { points: &stacks.positions, run, weighing };
            match shape {
                Shape::Sphere => scratch.sums.add::<S, W, true>(simd, &places, candidates),
                Shape::Cylinder => scratch.sums.add::<S, W, false>(simd, &places, candidates),
            }
        }
    }
}

/// Places whose surroundings are summed together.
#[derive(Clone, Debug)]
struct Places {
    at: [[f32; LANES]; 3],
    /// Square of the radius.
    limit: f32,
}

/// Sums over the points around each place, relative to the place.
#[derive(Clone, Debug)]
pub(crate) struct Sums {
    single: [[f32; LANES]; SUMS],
    double: [[f64; LANES]; SUMS],
    /// Candidates in `single`.
    pending: usize,
}

impl Default for Sums {
    fn default() -> Self {
        Self { single: [[0.0; LANES]; SUMS], double: [[0.0; LANES]; SUMS], pending: 0 }
    }
}

/// The points around each place.
#[derive(Clone, Debug)]
pub(crate) struct Surroundings {
    /// Sum of the weights: the number of points, if all count alike.
    pub(crate) count: [f64; LANES],
    /// Covariance: xx, yy, zz, xy, xz, yz.
    covariance: [[f64; LANES]; 6],
    /// Weighted sums of the coordinates relative to the place: x, y, z, xx, yy, zz, xy, xz, yz.
    pub(crate) totals: [[f64; LANES]; SUMS - 1],
    pub(crate) eigen: LaneEigen<f64, LANES>,
}

impl Sums {
    /// Forgets all points.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds those of a run of candidates that are within the radius of each place.
    #[inline(always)]
    fn add<S: Simd, W: Weighing, const SPHERE: bool>(&mut self, simd: S, places: &Places, from: Candidates<'_, W>) {
        let mut run = from.run.clone();
        while !run.is_empty() {
            let end = run.end.min(run.start + IN_SINGLE - self.pending);
            self.pending += end - run.start;
            let part = Candidates { run: run.start..end, ..from };
            add_part::<S, W, SPHERE>(simd, &mut self.single, places, part);
            if self.pending == IN_SINGLE {
                self.flush();
            }
            run.start = end;
        }
    }

    #[inline(always)]
    fn flush(&mut self) {
        for k in 0..SUMS {
            for l in 0..LANES {
                self.double[k][l] += f64::from(self.single[k][l]);
                self.single[k][l] = 0.0;
            }
        }
        self.pending = 0;
    }

    /// Covariance of the points of each place, its eigenvalues and eigenvectors. The divisor is the sum of the weights, less
    /// `constraints` (0 or 1) where the sum is above 1; 1 has a meaning only if all points count alike.
    #[inline(always)]
    pub(crate) fn solve(&mut self, constraints: f64) -> Surroundings {
        self.flush();
        let mut matrix = [[0.0; LANES]; 6];
        let mut scale = [0.0; LANES];
        for l in 0..LANES {
            let n = if self.double[0][l] > 0.0 { self.double[0][l] } else { 1.0 };
            let free = if n <= 1.0 { n } else { n - constraints };
            // Of n points: (Σ x y − n x̄ ȳ) / divisor.
            scale[l] = 1.0 / free;
            let mean = [self.double[1][l] / n, self.double[2][l] / n, self.double[3][l] / n];
            matrix[0][l] = self.double[4][l] - n * mean[0] * mean[0];
            matrix[1][l] = self.double[5][l] - n * mean[1] * mean[1];
            matrix[2][l] = self.double[6][l] - n * mean[2] * mean[2];
            matrix[3][l] = self.double[7][l] - n * mean[0] * mean[1];
            matrix[4][l] = self.double[8][l] - n * mean[0] * mean[2];
            matrix[5][l] = self.double[9][l] - n * mean[1] * mean[2];
        }
        for entry in &mut matrix {
            for l in 0..LANES {
                entry[l] *= scale[l];
            }
        }
        let totals = std::array::from_fn(|k| self.double[k + 1]);
        Surroundings { count: self.double[0], covariance: matrix, totals, eigen: jacobi(&matrix) }
    }
}

/// The points around one place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surrounding {
    /// Sum of the weights.
    pub(crate) weight: f64,
    /// Mean of the points relative to the place; zeros without weight.
    pub(crate) mean: [f64; 3],
    pub(crate) covariance: Sym3,
    /// Its eigenvalues, descending.
    pub(crate) values: [f64; 3],
    /// Direction of the largest spread, of arbitrary sign.
    pub(crate) axis: [f64; 3],
}

impl Surroundings {
    #[inline(always)]
    fn of(&self, lane: usize) -> Surrounding {
        let weight = self.count[lane];
        let [diagonal, off] = [0, 3].map(|first| [0, 1, 2].map(|a| self.covariance[first + a][lane]));
        Surrounding {
            weight,
            mean: [0, 1, 2].map(|a| if weight > 0.0 { self.totals[a][lane] / weight } else { 0.0 }),
            covariance: Sym3 { diagonal, off },
            values: self.eigen.values.map(|value| value[lane]),
            axis: self.eigen.vectors[0].map(|axis| axis[lane]),
        }
    }
}

/// A run of points that may lie around the places.
#[derive(Clone, Debug)]
struct Candidates<'a, W> {
    points: &'a Positions,
    run: Range<usize>,
    weighing: W,
}

/// The kernel: every candidate is compared with every place, without a branch. Distances are `(dx² + dy²) + dz²`.
#[inline(always)]
fn add_part<S: Simd, W: Weighing, const SPHERE: bool>(
    simd: S,
    sums: &mut [[f32; LANES]; SUMS],
    places: &Places,
    candidates: Candidates<'_, W>,
) {
    let Candidates { points, run, weighing } = candidates;
    let (xs, ys, zs) = (&points.x[run.clone()], &points.y[run.clone()], &points.z[run.clone()]);
    let (limit, zero) = (simd.splat_f32s(places.limit), simd.splat_f32s(0.0));
    for part in 0..LANES / S::F32_LANES {
        let px = S::as_simd_f32s(&places.at[0]).0[part];
        let py = S::as_simd_f32s(&places.at[1]).0[part];
        let pz = S::as_simd_f32s(&places.at[2]).0[part];
        let mut total = [zero; SUMS];
        for k in 0..SUMS {
            total[k] = S::as_simd_f32s(&sums[k]).0[part];
        }
        let [mut n, mut sx, mut sy, mut sz, mut xx, mut yy, mut zz, mut xy, mut xz, mut yz] = total;
        for (point, ((&x, &y), &z)) in run.clone().zip(xs.iter().zip(ys).zip(zs)) {
            let dx = simd.sub_f32s(simd.splat_f32s(x), px);
            let dy = simd.sub_f32s(simd.splat_f32s(y), py);
            let dz = simd.sub_f32s(simd.splat_f32s(z), pz);
            let plan = simd.add_f32s(simd.mul_f32s(dx, dx), simd.mul_f32s(dy, dy));
            let squared = if SPHERE { simd.add_f32s(plan, simd.mul_f32s(dz, dz)) } else { plan };
            let inside = simd.less_than_or_equal_f32s(squared, limit);
            let weight = simd.select_f32s(inside, weighing.weights(simd, point, squared), zero);
            let wx = simd.mul_f32s(weight, dx);
            let wy = simd.mul_f32s(weight, dy);
            let wz = simd.mul_f32s(weight, dz);
            n = simd.add_f32s(n, weight);
            sx = simd.add_f32s(sx, wx);
            sy = simd.add_f32s(sy, wy);
            sz = simd.add_f32s(sz, wz);
            xx = simd.add_f32s(xx, simd.mul_f32s(wx, dx));
            yy = simd.add_f32s(yy, simd.mul_f32s(wy, dy));
            zz = simd.add_f32s(zz, simd.mul_f32s(wz, dz));
            xy = simd.add_f32s(xy, simd.mul_f32s(wx, dy));
            xz = simd.add_f32s(xz, simd.mul_f32s(wx, dz));
            yz = simd.add_f32s(yz, simd.mul_f32s(wy, dz));
        }
        let total = [n, sx, sy, sz, xx, yy, zz, xy, xz, yz];
        for k in 0..SUMS {
            S::as_mut_simd_f32s(&mut sums[k]).0[part] = total[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    struct Falling(Vec<f32>);

    impl WithSimd for Falling {
        type Output = Vec<f32>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
            let mut found = vec![0.0f32; self.0.len()];
            let (from, _) = S::as_simd_f32s(&self.0);
            let (to, _) = S::as_mut_simd_f32s(&mut found);
            to.iter_mut().zip(from).for_each(|(to, &from)| *to = falling(simd, from));
            found
        }
    }

    #[test]
    fn the_series_is_the_exponential_function() {
        let x: Vec<f32> = (0..3200).map(|i| i as f32 * 1e-3).collect();
        for (x, found) in x.clone().into_iter().zip(Arch::new().dispatch(Falling(x))) {
            let expected = (-f64::from(x)).exp();
            assert!((f64::from(found) - expected).abs() < 1e-6 * expected, "{x}: {found}, not {expected}");
        }
    }

    /// Weight, mean and covariance by definition, in `f64`.
    fn expected(points: &Positions, weight: impl Fn(usize) -> f64, at: [f64; 3]) -> (f64, [f64; 3], [f64; 6]) {
        let apart = |i: usize| [0, 1, 2].map(|a| f64::from(points.xyz(i)[a]) - at[a]);
        let rows: Vec<([f64; 3], f64)> = (0..points.len()).map(|i| (apart(i), weight(i))).collect();
        let total: f64 = rows.iter().map(|row| row.1).sum();
        let mean = [0, 1, 2].map(|a| rows.iter().map(|(d, w)| w * d[a]).sum::<f64>() / total);
        let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        let product = |(a, b)| rows.iter().map(|(d, w)| w * (d[a] - mean[a]) * (d[b] - mean[b])).sum::<f64>() / total;
        (total, mean, pairs.map(product))
    }

    #[test]
    fn weighted_sums_equal_those_by_definition() {
        let mut random = stream(3, 3);
        let points: Positions =
            (0..1500).map(|_| [1.0, 1.0, 0.2].map(|extent| 50.0 + random.uniform() as f32 * extent)).collect();
        let own: Vec<f32> = (0..points.len()).map(|_| random.uniform() as f32).collect();
        let places = points.select(&(0..60).collect::<Vec<_>>(), &Monitor::default()).unwrap();
        let (radius, sigma) = (0.25, 0.1);
        let stacks = Stacks::new(&points, radius, &Monitor::default()).unwrap();
        let weights: Vec<f32> = stacks.index.iter().map(|&i| own[i as usize]).collect();
        let around = |falls: bool| {
            let (shape, monitor) = (Shape::Sphere, Monitor::default());
            let each = |_: usize, found: &Surrounding| *found;
            if falls {
                let weighing = Gaussian::new(&weights, sigma);
                Around { stacks: &stacks, radius, shape, weighing }.map(&places, &monitor, each)
            } else {
                let weighing = Weighted { weights: &weights };
                Around { stacks: &stacks, radius, shape, weighing }.map(&places, &monitor, each)
            }
        };
        for falls in [false, true] {
            for (at, found) in around(falls).unwrap().into_iter().enumerate() {
                let place = places.xyz(at).map(f64::from);
                let weight = |i: usize| {
                    let squared: f64 = points.xyz(i).iter().zip(place).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum();
                    let fall = if falls { (-squared / (2.0 * sigma * sigma)).exp() } else { 1.0 };
                    if squared <= radius * radius { f64::from(own[i]) * fall } else { 0.0 }
                };
                let (total, mean, covariance) = expected(&points, weight, place);
                assert!((found.weight - total).abs() < 1e-5 * total);
                assert!((0..3).all(|a| (found.mean[a] - mean[a]).abs() < 1e-6), "{:?} {mean:?}", found.mean);
                let entries = found.covariance.entries();
                assert!((0..6).all(|k| (entries[k] - covariance[k]).abs() < 1e-7), "{entries:?} {covariance:?}");
                let solved = found.covariance.eigen();
                assert_eq!(found.values, solved.values);
                assert_eq!(found.axis, solved.vectors[0]);
            }
        }
    }

    #[test]
    fn places_without_points_have_no_weight() {
        let points: Positions = [[0.0; 3]; 3].into_iter().collect();
        let stacks = Stacks::new(&points, 1.0, &Monitor::default()).unwrap();
        let around = Around { stacks: &stacks, radius: 1.0, shape: Shape::Sphere, weighing: Alike };
        let places: Positions = [[9.0; 3], [0.5, 0.0, 0.0]].into_iter().collect();
        let found =
            around.map(&places, &Monitor::default(), |_, found| (found.weight, found.mean, found.values)).unwrap();
        assert_eq!(found, [(0.0, [0.0; 3], [0.0; 3]), (3.0, [-0.5, 0.0, 0.0], [0.0; 3])]);
    }
}
