//! Eigenvalues of a symmetric 3 x 3 matrix in closed form (O. K. Smith, *Eigenvalues of a symmetric 3 × 3 matrix*,
//! Communications of the ACM 4(4), 1961).
//!
//! λ = q + p t with q = trace / 3, p² = Σ(A − q)² / 6, r = det(A − q) / (2 p³) and t³ − 3 t = 2 r. If two eigenvalues
//! are close to each other, each is accurate only to the square root of the rounding error.
//!
//! t is 2 cos(acos(r) / 3), taken from a polynomial, so that loops over lanes vectorise.

use super::Sym3;

/// λ1 ≥ λ2 ≥ λ3 ≥ 0 of a positive semi-definite matrix, accurate to about 1e-8 λ1.
pub(crate) fn eigenvalues(matrix: &Sym3) -> [f64; 3] {
    let [xx, yy, zz] = matrix.diagonal;
    let trace = xx + yy + zz;
    if trace <= 0.0 {
        return [0.0; 3];
    }
    let mut values = unit_eigenvalues(matrix.entries()).map(|share| (trace * share).max(0.0));
    values.sort_unstable_by(|a, b| b.total_cmp(a));
    values
}

/// λ / Σλ of xx, yy, zz, xy, xz, yz in no order, without branches; rounding may make them slightly negative. 1/3 each
/// for the zero matrix.
#[inline(always)]
pub(crate) fn unit_eigenvalues([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 3] {
    let trace = xx + yy + zz;
    let scale = 1.0 / if trace > 0.0 { trace } else { 1.0 };
    // Scaled to trace 1: the mean of the eigenvalues is 1/3.
    let centred = [xx * scale - THIRD, yy * scale - THIRD, zz * scale - THIRD];
    let off = [xy * scale, xz * scale, yz * scale];
    let square = sum_of_squares(centred, off) * (1.0 / 6.0);
    let p = square.sqrt();
    let spread = square * p;
    let r = (0.5 * determinant(centred, off)) / if spread > 1e-300 { spread } else { 1.0 };
    let magnitude = if r.abs() < 1.0 { r.abs() } else { 1.0 };
    let turn = if r < 0.0 { -p } else { p };
    let t = outer_root(magnitude);
    let rest = 12.0 - 3.0 * t * t;
    let half = 0.5 * (if rest > 0.0 { rest } else { 0.0 }).sqrt();
    [THIRD + turn * t, THIRD + turn * (half - 0.5 * t), THIRD - turn * (half + 0.5 * t)]
}

const THIRD: f64 = 1.0 / 3.0;

/// Sum of the squares of all nine entries; `off` is xy, xz, yz.
#[inline(always)]
fn sum_of_squares([x, y, z]: [f64; 3], [xy, xz, yz]: [f64; 3]) -> f64 {
    x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)
}

/// Determinant; `off` is xy, xz, yz.
#[inline(always)]
fn determinant([x, y, z]: [f64; 3], [xy, xz, yz]: [f64; 3]) -> f64 {
    x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)
}

/// The largest root of t³ − 3 t = 2 r for r in 0..=1, 2 cos(acos(r) / 3): a polynomial and one Newton step.
#[inline(always)]
fn outer_root(r: f64) -> f64 {
    const SERIES: [f64; 8] = [
        1.73205083,
        0.333330086,
        -0.0961547007,
        0.0487847677,
        -0.0285791297,
        0.0153286035,
        -0.005845661,
        0.00108521542,
    ];
    let mut t = SERIES[7];
    t = t * r + SERIES[6];
    t = t * r + SERIES[5];
    t = t * r + SERIES[4];
    t = t * r + SERIES[3];
    t = t * r + SERIES[2];
    t = t * r + SERIES[1];
    t = t * r + SERIES[0];
    let square = t * t;
    (2.0 * t * square + 2.0 * r) / (3.0 * square - 3.0)
}

#[cfg(test)]
mod tests {
    use super::super::{Moments, mean};
    use super::*;
    use crate::random::stream;

    #[test]
    fn the_outer_root_is_the_cosine_of_a_third_of_the_angle() {
        for i in 0..=1000 {
            let r = f64::from(i) / 1000.0;
            assert!((outer_root(r) - 2.0 * (r.acos() / 3.0).cos()).abs() < 3e-15, "{r}");
        }
    }

    #[test]
    fn eigenvalues_of_moments_are_those_of_the_scatter() {
        let mut random = stream(1, 1);
        for trial in 0..300 {
            let flat = [1.0, 1.0, if trial % 3 == 0 { 0.0 } else { 0.3 }];
            let turn = random.uniform();
            let points: Vec<[f64; 3]> = (0..9)
                .map(|_| flat.map(|f| f * random.uniform()))
                .map(|p| [p[0] + turn * p[2], p[1] - turn * p[0], p[2]])
                .collect();
            let mut moments = Moments::default();
            points.iter().for_each(|p| moments.add(p.map(|v| v - 0.4)));
            let expected = Sym3::scatter(&points, mean(&points), 9.0).eigen().values;
            for (found, expected) in eigenvalues(&moments.covariance()).into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-8, "{found} {expected}");
            }
        }
    }

    #[test]
    fn points_in_one_place_or_on_a_line_have_no_spread_there() {
        let mut moments = Moments::default();
        assert_eq!(eigenvalues(&moments.covariance()), [0.0; 3]);
        moments.add([2.0, 1.0, -1.0]);
        assert_eq!(moments.mean(), [2.0, 1.0, -1.0]);
        assert_eq!(eigenvalues(&moments.covariance()), [0.0; 3]);
        moments.add([2.0, 3.0, -1.0]);
        let [first, second, third] = eigenvalues(&moments.covariance());
        assert!((first - 1.0).abs() < 1e-12 && second < 1e-7 && third < 1e-7);
    }
}
