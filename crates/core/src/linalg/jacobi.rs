//! Jacobi's method for the eigenvalues and eigenvectors of symmetric 3 x 3 matrices, one matrix per SIMD lane.
//!
//! Every loop over lanes is written so that the compiler vectorises it; operations and their order are the same on
//! every machine and in both precisions.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes index several arrays at once; iterators hide that from the vectoriser"
)]

use super::arithmetic::Real;

/// Eigenvalues λ1 ≥ λ2 ≥ λ3 ≥ 0 (negative rounding errors are 0) and unit eigenvectors of arbitrary sign; of the zero
/// matrix, the coordinate axes.
#[derive(Clone, Debug)]
pub(crate) struct LaneEigen<T, const N: usize> {
    /// λ1, λ2, λ3.
    pub(crate) values: [[T; N]; 3],
    /// e1, e2, e3, each x, y, z.
    pub(crate) vectors: [[[T; N]; 3]; 3],
}

/// Solves matrices given as xx, yy, zz, xy, xz, yz.
#[inline(always)]
pub(crate) fn jacobi<T: Real, const N: usize>(matrix: &[[T; N]; 6]) -> LaneEigen<T, N> {
    let [xx, yy, zz, xy, xz, yz] = *matrix;
    let mut values = [xx, yy, zz];
    // off[i] couples the two axes other than i.
    let mut off = [yz, xz, xy];
    let (one, zero) = ([T::ONE; N], [T::ZERO; N]);
    let mut vectors = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..T::SWEEPS {
        rotate::<T, N, 0, 1, 2>(&mut values, &mut off, &mut vectors);
        rotate::<T, N, 0, 2, 1>(&mut values, &mut off, &mut vectors);
        rotate::<T, N, 1, 2, 0>(&mut values, &mut off, &mut vectors);
    }
    order::<T, N, 0, 1>(&mut values, &mut vectors);
    order::<T, N, 1, 2>(&mut values, &mut vectors);
    order::<T, N, 0, 1>(&mut values, &mut vectors);
    for value in &mut values {
        for v in value {
            *v = if *v > T::ZERO { *v } else { T::ZERO };
        }
    }
    LaneEigen { values, vectors }
}

/// Jacobi rotation that makes the entry of axes P and Q zero; R is the third axis.
#[inline(always)]
fn rotate<T: Real, const N: usize, const P: usize, const Q: usize, const R: usize>(
    values: &mut [[T; N]; 3],
    off: &mut [[T; N]; 3],
    vectors: &mut [[[T; N]; 3]; 3],
) {
    for l in 0..N {
        let coupling = off[R][l];
        let (a, b) = (values[P][l], values[Q][l]);
        let half = T::HALF * (b - a);
        let below = half.abs() + (half * half + coupling * coupling).sqrt();
        let t = coupling / if below > T::ZERO { below } else { T::ONE };
        let t = if half < T::ZERO { -t } else { t };
        let c = T::ONE / (T::ONE + t * t).sqrt();
        let s = t * c;
        values[P][l] = a - t * coupling;
        values[Q][l] = b + t * coupling;
        off[R][l] = T::ZERO;
        // off[Q] couples P and R, off[P] couples Q and R.
        let (pr, qr) = (off[Q][l], off[P][l]);
        off[Q][l] = c * pr - s * qr;
        off[P][l] = s * pr + c * qr;
        for axis in 0..3 {
            let (u, v) = (vectors[P][axis][l], vectors[Q][axis][l]);
            vectors[P][axis][l] = c * u - s * v;
            vectors[Q][axis][l] = s * u + c * v;
        }
    }
}

/// Swaps the eigenpairs I and J where the first is smaller.
#[inline(always)]
fn order<T: Real, const N: usize, const I: usize, const J: usize>(
    values: &mut [[T; N]; 3],
    vectors: &mut [[[T; N]; 3]; 3],
) {
    for l in 0..N {
        let (a, b) = (values[I][l], values[J][l]);
        let swap = a < b;
        values[I][l] = if swap { b } else { a };
        values[J][l] = if swap { a } else { b };
        for axis in 0..3 {
            let (a, b) = (vectors[I][axis][l], vectors[J][axis][l]);
            vectors[I][axis][l] = if swap { b } else { a };
            vectors[J][axis][l] = if swap { a } else { b };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_without_coupling_is_only_sorted_and_the_zero_matrix_keeps_the_axes() {
        let found = jacobi(&[2.0f64, 5.0, -1e-20, 0.0, 0.0, 0.0].map(|v| [v; 2]));
        assert_eq!(found.values.map(|v| v[1]), [5.0, 2.0, 0.0]);
        assert_eq!(found.vectors.map(|v| v.map(|a| a[1])), [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        let none = jacobi(&[[0.0f32; 2]; 6]);
        assert_eq!(none.values, [[0.0; 2]; 3]);
        assert_eq!(none.vectors.map(|v| v.map(|a| a[0])), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }
}
