//! Count, mean and covariance of the points around 16 places at once: one SIMD lane a place, all with the same
//! candidates.

use super::Shape;
use crate::cloud::Positions;
use crate::features::params::Divisor;
use crate::linalg::jacobi::{LaneEigen, jacobi};
use pulp::Simd;
use std::ops::Range;

/// Number of places that are described together.
pub(super) const LANES: usize = 16;
/// Candidates whose sums are kept in `f32` before they are added to the totals in `f64`: few enough that their rounding
/// is below that of the coordinates.
const IN_SINGLE: usize = 64;
/// Count, 3 sums of coordinates, 6 of products.
const SUMS: usize = 10;

/// Places whose surroundings are summed together.
#[derive(Clone, Debug)]
pub(super) struct Places {
    pub(super) at: [[f32; LANES]; 3],
    /// Square of the radius.
    pub(super) limit: f32,
}

/// Sums over the points around each place, relative to the place.
#[derive(Clone, Debug)]
pub(super) struct Sums {
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
pub(super) struct Surroundings {
    pub(super) count: [f64; LANES],
    /// Sums of the coordinates relative to the place: x, y, z, xx, yy, zz, xy, xz, yz.
    pub(super) totals: [[f64; LANES]; SUMS - 1],
    pub(super) eigen: LaneEigen<f64, LANES>,
}

impl Sums {
    /// Forgets all points.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds those of a run of candidates that are within the radius of each place.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&mut self, simd: S, shape: Shape, places: &Places, points: Candidates<'_>) {
        let mut run = points.run;
        while !run.is_empty() {
            let end = run.end.min(run.start + IN_SINGLE - self.pending);
            self.pending += end - run.start;
            let part = Candidates { points: points.points, run: run.start..end };
            match shape {
                Shape::Sphere => add_part::<S, true>(simd, &mut self.single, places, part),
                Shape::Cylinder => add_part::<S, false>(simd, &mut self.single, places, part),
            }
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

    /// Eigenvalues and eigenvectors of the covariance of the points of each place.
    #[inline(always)]
    pub(super) fn solve(&mut self, divisor: Divisor) -> Surroundings {
        self.flush();
        let mut matrix = [[0.0; LANES]; 6];
        let mut scale = [0.0; LANES];
        for l in 0..LANES {
            let n = if self.double[0][l] > 1.0 { self.double[0][l] } else { 1.0 };
            let free = if divisor == Divisor::N || n <= 1.0 { n } else { n - 1.0 };
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
        Surroundings { count: self.double[0], totals, eigen: jacobi(&matrix) }
    }
}

/// A run of points that may lie around the places.
#[derive(Clone, Debug)]
pub(super) struct Candidates<'a> {
    pub(super) points: &'a Positions,
    pub(super) run: Range<usize>,
}

/// The kernel: every candidate is compared with every place, without a branch. Distances are `(dx² + dy²) + dz²`.
#[inline(always)]
fn add_part<S: Simd, const SPHERE: bool>(
    simd: S,
    sums: &mut [[f32; LANES]; SUMS],
    places: &Places,
    candidates: Candidates<'_>,
) {
    let Candidates { points, run } = candidates;
    let (xs, ys, zs) = (&points.x[run.clone()], &points.y[run.clone()], &points.z[run]);
    let (limit, one, zero) = (simd.splat_f32s(places.limit), simd.splat_f32s(1.0), simd.splat_f32s(0.0));
    for part in 0..LANES / S::F32_LANES {
        let px = S::as_simd_f32s(&places.at[0]).0[part];
        let py = S::as_simd_f32s(&places.at[1]).0[part];
        let pz = S::as_simd_f32s(&places.at[2]).0[part];
        let mut total = [zero; SUMS];
        for k in 0..SUMS {
            total[k] = S::as_simd_f32s(&sums[k]).0[part];
        }
        let [mut n, mut sx, mut sy, mut sz, mut xx, mut yy, mut zz, mut xy, mut xz, mut yz] = total;
        for ((&x, &y), &z) in xs.iter().zip(ys).zip(zs) {
            let dx = simd.sub_f32s(simd.splat_f32s(x), px);
            let dy = simd.sub_f32s(simd.splat_f32s(y), py);
            let dz = simd.sub_f32s(simd.splat_f32s(z), pz);
            let plan = simd.add_f32s(simd.mul_f32s(dx, dx), simd.mul_f32s(dy, dy));
            let squared = if SPHERE { simd.add_f32s(plan, simd.mul_f32s(dz, dz)) } else { plan };
            let inside = simd.less_than_or_equal_f32s(squared, limit);
            let dx = simd.select_f32s(inside, dx, zero);
            let dy = simd.select_f32s(inside, dy, zero);
            let dz = simd.select_f32s(inside, dz, zero);
            n = simd.add_f32s(n, simd.select_f32s(inside, one, zero));
            sx = simd.add_f32s(sx, dx);
            sy = simd.add_f32s(sy, dy);
            sz = simd.add_f32s(sz, dz);
            xx = simd.add_f32s(xx, simd.mul_f32s(dx, dx));
            yy = simd.add_f32s(yy, simd.mul_f32s(dy, dy));
            zz = simd.add_f32s(zz, simd.mul_f32s(dz, dz));
            xy = simd.add_f32s(xy, simd.mul_f32s(dx, dy));
            xz = simd.add_f32s(xz, simd.mul_f32s(dx, dz));
            yz = simd.add_f32s(yz, simd.mul_f32s(dy, dz));
        }
        let total = [n, sx, sy, sz, xx, yy, zz, xy, xz, yz];
        for k in 0..SUMS {
            S::as_mut_simd_f32s(&mut sums[k]).0[part] = total[k];
        }
    }
}
