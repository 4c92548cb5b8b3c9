//! Structure tensors of 16 neighbourhoods at once: one SIMD lane each, no branches.
//!
//! Every loop over lanes is written so that the compiler vectorises it; operations and their order are the same on
//! every machine.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes index several arrays at once; iterators hide that from the vectoriser"
)]

use super::definition::Feature;
use super::params::{Centre, Divisor};
use crate::linalg::arithmetic::Lanes;
use crate::linalg::jacobi::{LaneEigen, jacobi};
use crate::linalg::shape::{self, Shape};

/// Number of neighbourhoods computed together.
pub(super) const LANES: usize = crate::voxels::LANES;
/// Largest number of points in a neighbourhood.
pub(super) const MOST: usize = 33;

/// One number per lane.
pub(super) type Lane = [f32; LANES];

/// Neighbours of 16 points, relative to the point; only the first `count` rows are valid. No row crosses a line of the
/// cache.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Batch {
    pub(super) x: [Lane; MOST],
    pub(super) y: [Lane; MOST],
    pub(super) z: [Lane; MOST],
}

impl Default for Batch {
    fn default() -> Self {
        let zero = [[0.0; LANES]; MOST];
        Self { x: zero, y: zero, z: zero }
    }
}

/// Eigenvalues λ1 ≥ λ2 ≥ λ3 ≥ 0, e2, e3 and the centre; coincident points have eigenvalues 0 and the coordinate axes.
#[derive(Clone, Debug, Default)]
pub(super) struct Tensor {
    pub(super) values: [Lane; 3],
    pub(super) second: [Lane; 3],
    pub(super) normal: [Lane; 3],
    pub(super) centre: [Lane; 3],
    /// 1 over the divisor.
    pub(super) share: f32,
}

/// Conventions of the tensor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Convention {
    pub(super) centre: Centre,
    pub(super) divisor: Divisor,
}

/// Eigenvalues and eigenvectors of the structure tensor of the first `count` rows.
#[inline(always)]
pub(super) fn tensor(batch: &Batch, count: usize, convention: Convention) -> Tensor {
    let mean = mean(batch, count);
    let mut matrix = covariance(batch, count, &mean);
    let mut centre = mean;
    if convention.centre == Centre::Medoid {
        centre = medoid(batch, count);
        add_shift(&mean, &centre, &mut matrix);
    }
    if convention.divisor == Divisor::NMinusOne && count > 1 {
        let factor = count as f32 / (count as f32 - 1.0);
        scale(&mut matrix, factor);
    }
    let divisor = count - usize::from(convention.divisor == Divisor::NMinusOne && count > 1);
    Tensor { centre, share: 1.0 / divisor.max(1) as f32, ..eigen(&matrix) }
}

/// λ3/Σλ with λ3 as the mean square of the distances from the plane through the centre; 0 where it is no more than the
/// rounding of coordinates. Where λ3 is a millionth of λ1, the third eigenvalue of an `f32` matrix has lost its digits,
/// but its eigenvector is exact enough for these distances. `at` is the largest coordinate of the query.
#[inline(always)]
pub(super) fn exact_variation(batch: &Batch, count: usize, tensor: &Tensor, at: &Lane) -> Lane {
    let Tensor { values, normal, centre, share, .. } = tensor;
    let mut sums = [0.0; LANES];
    for j in 0..count {
        for l in 0..LANES {
            let (x, y, z) = (batch.x[j][l] - centre[0][l], batch.y[j][l] - centre[1][l], batch.z[j][l] - centre[2][l]);
            let apart = x * normal[0][l] + y * normal[1][l] + z * normal[2][l];
            sums[l] += apart * apart;
        }
    }
    let mut out = [0.0; LANES];
    for l in 0..LANES {
        let total = values[0][l] + values[1][l] + values[2][l];
        let third = sums[l] * share;
        let rounding = f32::EPSILON * (at[l] + 4.0 * total.sqrt());
        let real = third > rounding * rounding;
        let safe = if real { total } else { 1.0 };
        out[l] = if real { third / safe } else { 0.0 };
    }
    out
}

/// xx, yy, zz, xy, xz, yz around the mean, divided by the count.
#[inline(always)]
fn covariance(batch: &Batch, count: usize, mean: &[Lane; 3]) -> [Lane; 6] {
    let mut sums = [[0.0; LANES]; 6];
    for j in 0..count {
        for l in 0..LANES {
            let (x, y, z) = (batch.x[j][l] - mean[0][l], batch.y[j][l] - mean[1][l], batch.z[j][l] - mean[2][l]);
            sums[0][l] += x * x;
            sums[1][l] += y * y;
            sums[2][l] += z * z;
            sums[3][l] += x * y;
            sums[4][l] += x * z;
            sums[5][l] += y * z;
        }
    }
    let share = 1.0 / count.max(1) as f32;
    scale(&mut sums, share);
    sums
}

#[inline(always)]
fn mean(batch: &Batch, count: usize) -> [Lane; 3] {
    let mut sums = [[0.0; LANES]; 3];
    for j in 0..count {
        for l in 0..LANES {
            sums[0][l] += batch.x[j][l];
            sums[1][l] += batch.y[j][l];
            sums[2][l] += batch.z[j][l];
        }
    }
    let share = 1.0 / count.max(1) as f32;
    scale(&mut sums, share);
    sums
}

// A loop instead of `map`, whose closure would be compiled without vector instructions.
#[inline(always)]
fn scale(lanes: &mut [Lane], factor: f32) {
    for lane in lanes {
        for v in lane {
            *v *= factor;
        }
    }
}

/// The row with the least sum of distances to the others; the first of equal ones.
#[inline(always)]
fn medoid(batch: &Batch, count: usize) -> [Lane; 3] {
    let mut totals = [[0.0f32; LANES]; MOST];
    for i in 0..count {
        for j in i + 1..count {
            for l in 0..LANES {
                let (x, y, z) =
                    (batch.x[i][l] - batch.x[j][l], batch.y[i][l] - batch.y[j][l], batch.z[i][l] - batch.z[j][l]);
                let distance = (x * x + y * y + z * z).sqrt();
                totals[i][l] += distance;
                totals[j][l] += distance;
            }
        }
    }
    let (mut least, mut at) = (totals[0], [batch.x[0], batch.y[0], batch.z[0]]);
    for j in 1..count {
        for l in 0..LANES {
            let nearer = totals[j][l] < least[l];
            least[l] = if nearer { totals[j][l] } else { least[l] };
            at[0][l] = if nearer { batch.x[j][l] } else { at[0][l] };
            at[1][l] = if nearer { batch.y[j][l] } else { at[1][l] };
            at[2][l] = if nearer { batch.z[j][l] } else { at[2][l] };
        }
    }
    at
}

/// C around another centre = C around the mean + (mean − centre)(mean − centre)ᵀ.
#[inline(always)]
fn add_shift(mean: &[Lane; 3], at: &[Lane; 3], matrix: &mut [Lane; 6]) {
    for l in 0..LANES {
        let (x, y, z) = (mean[0][l] - at[0][l], mean[1][l] - at[1][l], mean[2][l] - at[2][l]);
        matrix[0][l] += x * x;
        matrix[1][l] += y * y;
        matrix[2][l] += z * z;
        matrix[3][l] += x * y;
        matrix[4][l] += x * z;
        matrix[5][l] += y * z;
    }
}

/// Eigenvalues, e2 with a fixed sign, and e3.
#[inline(always)]
fn eigen(matrix: &[Lane; 6]) -> Tensor {
    let LaneEigen { values, vectors } = jacobi(matrix);
    Tensor { values, second: with_fixed_sign(vectors[1]), normal: vectors[2], centre: Default::default(), share: 1.0 }
}

/// Flips the vector so that its largest component is positive (ties: the first of them).
#[inline(always)]
fn with_fixed_sign(mut v: [Lane; 3]) -> [Lane; 3] {
    for l in 0..LANES {
        let (x, y, z) = (v[0][l], v[1][l], v[2][l]);
        let xy = if y.abs() > x.abs() { y } else { x };
        let largest = if z.abs() > xy.abs() { z } else { xy };
        let sign = if largest < 0.0 { -1.0 } else { 1.0 };
        v[0][l] = sign * x;
        v[1][l] = sign * y;
        v[2][l] = sign * z;
    }
    v
}

/// The covariance features of each lane.
#[derive(Clone, Debug)]
pub(super) struct CovarianceFeatures {
    pub(super) sum: Lane,
    pub(super) omnivariance: Lane,
    pub(super) eigenentropy: Lane,
    pub(super) anisotropy: Lane,
    pub(super) planarity: Lane,
    pub(super) linearity: Lane,
    pub(super) surface_variation: Lane,
    pub(super) sphericity: Lane,
    pub(super) verticality: Lane,
}

impl CovarianceFeatures {
    /// The features with their keys.
    #[inline(always)]
    pub(super) fn keyed(&self) -> [(Feature, &Lane); 9] {
        [
            (Feature::Sum, &self.sum),
            (Feature::Omnivariance, &self.omnivariance),
            (Feature::Eigenentropy, &self.eigenentropy),
            (Feature::Anisotropy, &self.anisotropy),
            (Feature::Planarity, &self.planarity),
            (Feature::Linearity, &self.linearity),
            (Feature::SurfaceVariation, &self.surface_variation),
            (Feature::Sphericity, &self.sphericity),
            (Feature::Verticality, &self.verticality),
        ]
    }
}

/// The covariance features; omnivariance and eigenentropy of λ / Σλ if `normalise`, else of λ.
#[inline(always)]
pub(super) fn covariance_features(tensor: &Tensor, normalise: bool) -> CovarianceFeatures {
    let zero = [0.0; LANES];
    let mut out = CovarianceFeatures {
        sum: zero,
        omnivariance: zero,
        eigenentropy: zero,
        anisotropy: zero,
        planarity: zero,
        linearity: zero,
        surface_variation: zero,
        sphericity: zero,
        verticality: zero,
    };
    for l in 0..LANES {
        let values = [tensor.values[0][l], tensor.values[1][l], tensor.values[2][l]];
        let shares = shape::normalised::<Lanes, f32>(values);
        let used = if normalise { shares } else { values };
        let found = Shape::of::<Lanes>(values);
        out.sum[l] = shape::sum(values);
        out.omnivariance[l] = shape::omnivariance::<Lanes, f32>(used);
        out.eigenentropy[l] = shape::eigenentropy::<Lanes, f32>(used);
        out.anisotropy[l] = found.anisotropy;
        out.planarity[l] = found.planarity;
        out.linearity[l] = found.linearity;
        out.surface_variation[l] = found.surface_variation;
        out.sphericity[l] = found.scattering;
        let upright = 1.0 - tensor.normal[2][l].abs();
        out.verticality[l] = if values[0] > 0.0 && upright > 0.0 { upright } else { 0.0 };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{self, Sym3};
    use crate::random::{Stream, stream};

    pub(crate) fn points_of(batch: &Batch, count: usize, lane: usize) -> Vec<[f64; 3]> {
        (0..count).map(|j| [batch.x[j][lane], batch.y[j][lane], batch.z[j][lane]].map(f64::from)).collect()
    }

    fn random_batch(s: &mut Stream, count: usize, extent: [f64; 3]) -> Batch {
        let mut batch = Batch::default();
        for j in 0..count {
            for l in 0..LANES {
                batch.x[j][l] = ((s.uniform() - 0.5) * extent[0]) as f32;
                batch.y[j][l] = ((s.uniform() - 0.5) * extent[1]) as f32;
                batch.z[j][l] = ((s.uniform() - 0.5) * extent[2]) as f32;
            }
        }
        batch
    }

    fn reference(points: &[[f64; 3]], convention: Convention) -> linalg::Eigen3 {
        let centre = match convention.centre {
            Centre::Mean => linalg::mean(points),
            Centre::Medoid => points[linalg::medoid(points)],
        };
        let divisor = points.len() as f64 - if convention.divisor == Divisor::N { 0.0 } else { 1.0 };
        Sym3::scatter(points, centre, divisor).eigen()
    }

    #[test]
    fn lanes_equal_the_scalar_reference() {
        let mut s = stream(1, 1);
        for extent in [[1.0, 1.0, 1.0], [8.0, 6.0, 0.02], [50.0, 0.1, 0.1], [0.01, 0.01, 0.03]] {
            for (centre, divisor) in [(Centre::Medoid, Divisor::N), (Centre::Mean, Divisor::NMinusOne)] {
                let convention = Convention { centre, divisor };
                let batch = random_batch(&mut s, 10, extent);
                let found = tensor(&batch, 10, convention);
                for l in 0..LANES {
                    let expected = reference(&points_of(&batch, 10, l), convention);
                    for i in 0..3 {
                        let error = (f64::from(found.values[i][l]) - expected.values[i]).abs();
                        assert!(error < 2e-6 * expected.values[0], "λ{i} {error} of {:?}", expected.values);
                    }
                    let cosine: f64 = (0..3).map(|a| f64::from(found.normal[a][l]) * expected.vectors[2][a]).sum();
                    let gap = (expected.values[1] - expected.values[2]) / expected.values[0];
                    assert!(cosine.abs() > 1.0 - 1e-5 || gap < 1e-2, "normal {cosine}, gap {gap}");
                }
            }
        }
    }

    #[test]
    fn ratios_obey_their_identities() {
        let batch = random_batch(&mut stream(2, 0), 10, [3.0, 2.0, 1.0]);
        let convention = Convention { centre: Centre::Medoid, divisor: Divisor::N };
        let f = covariance_features(&tensor(&batch, 10, convention), true);
        for l in 0..LANES {
            assert!((f.linearity[l] + f.planarity[l] + f.sphericity[l] - 1.0).abs() < 1e-6);
            assert!((f.anisotropy[l] - f.linearity[l] - f.planarity[l]).abs() < 1e-6);
            assert!((0.0..=1.0 / 3.0 + 1e-6).contains(&f.surface_variation[l]));
            assert!((0.0..=3f32.ln() + 1e-5).contains(&f.eigenentropy[l]));
        }
    }

    #[test]
    fn a_plane_a_line_and_a_single_place_have_known_features() {
        let mut batch = Batch::default();
        for j in 0..10 {
            batch.x[j][0] = (j % 5) as f32;
            batch.y[j][0] = (j / 5) as f32;
            batch.x[j][1] = j as f32;
            batch.y[j][1] = j as f32;
            batch.z[j][1] = j as f32;
            batch.z[j][2] = (j % 5) as f32;
            batch.x[j][2] = (j / 5) as f32;
        }
        let convention = Convention { centre: Centre::Mean, divisor: Divisor::N };
        let f = covariance_features(&tensor(&batch, 10, convention), false);
        assert!(
            (f.sum[0] - 2.25).abs() < 1e-6 && f.surface_variation[0] == 0.0 && f.verticality[0] < 1e-6,
            "horizontal plane: λ = 2, 1/4, 0"
        );
        assert!((f.linearity[0] - 0.875).abs() < 1e-6 && (f.planarity[0] - 0.125).abs() < 1e-6);
        let entropy = -(2.0f32 * 2.0f32.ln() + 0.25 * 0.25f32.ln());
        assert!((f.eigenentropy[0] - entropy).abs() < 1e-6);
        assert!((f.linearity[1] - 1.0).abs() < 1e-5 && f.planarity[1] < 1e-5, "a line");
        assert!((f.verticality[2] - 1.0).abs() < 1e-6, "a vertical plane");
        assert!(f.keyed().iter().all(|(_, lanes)| lanes[3] == 0.0), "all points in one place");
    }
}
