//! Covariances of growing neighbourhoods and their eigenentropy, for 8 points at once in `f64`.
//!
//! Every loop over lanes is written so that the compiler vectorises it; operations and their order are the same on
//! every machine, without fused multiply-adds.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes index several arrays at once; iterators hide that from the vectoriser"
)]

use crate::linalg::arithmetic::Lanes;
use crate::linalg::closed_form::unit_eigenvalues;
use crate::linalg::shape;

/// Number of points computed together.
pub(super) const LANES: usize = 8;
/// One number per lane.
pub(super) type Lane = [f64; LANES];
/// xx, yy, zz, xy, xz, yz.
pub(super) type Matrix = [Lane; 6];

/// Entropies closer than this are treated as equal, so that rounding does not choose the neighbourhood.
const TIE: f64 = 1e-6;

/// The chosen neighbourhood of each lane.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    /// Number of neighbours.
    pub(super) rows: Lane,
    /// Infinite if no neighbourhood has an extent.
    pub(super) entropy: Lane,
    pub(super) matrix: Matrix,
}

/// The neighbourhood of lowest eigenentropy; ties go to the smallest.
///
/// `rows[j]` is the offset of the (j + 1)-th nearest neighbour from the point; neighbourhoods with the numbers of rows
/// in `wanted` (ascending) are compared, each including the point itself.
#[inline(always)]
pub(super) fn choose(rows: &[[Lane; 3]], wanted: &[u32]) -> Chosen {
    let mut sums = [[0.0; LANES]; 9];
    let first = f64::from(wanted.first().copied().unwrap_or(0));
    let mut chosen = Chosen { rows: [first; LANES], entropy: [f64::INFINITY; LANES], matrix: [[0.0; LANES]; 6] };
    let mut from = 0usize;
    for &to in wanted {
        rows[from..to as usize].iter().for_each(|row| add(&mut sums, row));
        from = to as usize;
        let matrix = covariance(&sums, f64::from(to) + 1.0);
        let mut entropy = [0.0; LANES];
        for l in 0..LANES {
            entropy[l] = entropy_of(lane(&matrix, l));
        }
        for l in 0..LANES {
            let lower = entropy[l] < chosen.entropy[l] - TIE;
            chosen.entropy[l] = if lower { entropy[l] } else { chosen.entropy[l] };
            chosen.rows[l] = if lower { f64::from(to) } else { chosen.rows[l] };
            for i in 0..6 {
                chosen.matrix[i][l] = if lower { matrix[i][l] } else { chosen.matrix[i][l] };
            }
        }
    }
    chosen
}

#[inline(always)]
fn add(sums: &mut [Lane; 9], row: &[Lane; 3]) {
    for l in 0..LANES {
        let (x, y, z) = (row[0][l], row[1][l], row[2][l]);
        sums[0][l] += x * x;
        sums[1][l] += y * y;
        sums[2][l] += z * z;
        sums[3][l] += x * y;
        sums[4][l] += x * z;
        sums[5][l] += y * z;
        sums[6][l] += x;
        sums[7][l] += y;
        sums[8][l] += z;
    }
}

/// Σ d dᵀ / n − m mᵀ.
#[inline(always)]
fn covariance(sums: &[Lane; 9], n: f64) -> Matrix {
    let share = 1.0 / n;
    let mut matrix = [[0.0; LANES]; 6];
    for l in 0..LANES {
        let (x, y, z) = (sums[6][l] * share, sums[7][l] * share, sums[8][l] * share);
        matrix[0][l] = sums[0][l] * share - x * x;
        matrix[1][l] = sums[1][l] * share - y * y;
        matrix[2][l] = sums[2][l] * share - z * z;
        matrix[3][l] = sums[3][l] * share - x * y;
        matrix[4][l] = sums[4][l] * share - x * z;
        matrix[5][l] = sums[5][l] * share - y * z;
    }
    matrix
}

#[inline(always)]
fn lane(matrix: &Matrix, l: usize) -> [f64; 6] {
    [matrix[0][l], matrix[1][l], matrix[2][l], matrix[3][l], matrix[4][l], matrix[5][l]]
}

/// −Σ x ln x, x = λ / Σλ, from the closed form of the eigenvalues; infinite for the zero matrix.
///
/// Errors of close eigenvalues cancel in the entropy: its error is below 1e-9, and below [`TIE`] for lines at least a
/// hundred times longer than wide.
#[inline(always)]
fn entropy_of(matrix: [f64; 6]) -> f64 {
    let [xx, yy, zz, ..] = matrix;
    let entropy = shape::eigenentropy::<Lanes, f64>(unit_eigenvalues(matrix));
    if xx + yy + zz > 0.0 { entropy } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Sym3;
    use crate::linalg::testing::matrices;

    #[test]
    fn the_entropy_is_that_of_the_iterative_solver() {
        for m in matrices() {
            let reference = Sym3 { diagonal: [m[0], m[1], m[2]], off: [m[3], m[4], m[5]] }.eigen();
            let sum: f64 = reference.values.iter().sum();
            let terms = reference.values.map(|v| if v > 0.0 { -v / sum * (v / sum).ln() } else { 0.0 });
            let allowed = if reference.values[0] < (1.0 - 1e-4) * sum { 1e-9 } else { TIE };
            assert!((entropy_of(m) - terms.iter().sum::<f64>()).abs() < allowed, "{m:?}");
        }
        assert_eq!(entropy_of([0.0; 6]), f64::INFINITY);
    }
}
