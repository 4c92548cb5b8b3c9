//! Covariances of growing neighbourhoods, their eigenentropy and eigenvalues, for 8 points at once in `f64`.
//!
//! Every loop over lanes is written so that the compiler vectorises it; operations and their order are the same on
//! every machine, without fused multiply-adds.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes index several arrays at once; iterators hide that from the vectoriser"
)]

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
            entropy[l] = eigenentropy(lane(&matrix, l));
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
/// λ = q + p t with t³ − 3 t = 2 r (O. K. Smith, *Eigenvalues of a symmetric 3 × 3 matrix*, CACM 4, 1961). If two
/// eigenvalues are close, each is accurate only to the square root of the rounding, but the errors cancel in the
/// entropy: its error is below 1e-9, and below [`TIE`] for lines at least a hundred times longer than wide.
#[inline(always)]
fn eigenentropy([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> f64 {
    let trace = xx + yy + zz;
    let positive = trace > 0.0;
    let scale = 1.0 / if positive { trace } else { 1.0 };
    // Scaled to trace 1: the mean of the eigenvalues is 1/3.
    let (a, b, c) = (xx * scale - THIRD, yy * scale - THIRD, zz * scale - THIRD);
    let (d, e, f) = (xy * scale, xz * scale, yz * scale);
    let square = (a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) * (1.0 / 6.0);
    let p = square.sqrt();
    let determinant = a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - b * e);
    let spread = square * p;
    let r = (0.5 * determinant) / if spread > 1e-300 { spread } else { 1.0 };
    let magnitude = if r.abs() < 1.0 { r.abs() } else { 1.0 };
    let turn = if r < 0.0 { -p } else { p };
    let t = outer_root(magnitude);
    let rest = 12.0 - 3.0 * t * t;
    let half = 0.5 * (if rest > 0.0 { rest } else { 0.0 }).sqrt();
    let sum =
        x_ln_x(THIRD + turn * t) + x_ln_x(THIRD + turn * (half - 0.5 * t)) + x_ln_x(THIRD - turn * (half + 0.5 * t));
    if positive { -sum } else { f64::INFINITY }
}

const THIRD: f64 = 1.0 / 3.0;

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

/// x ln x for x in 0..=1; 0 if x is not above 1e-300. ln from the exponent and 2 artanh((m − 1) / (m + 1)), m in
/// √½..√2.
#[inline(always)]
fn x_ln_x(x: f64) -> f64 {
    let fine = x > 1e-300;
    let bits = (if fine { x } else { 1.0 }).to_bits();
    // The exponent is counted from √½, so that m lies in √½..√2.
    let shifted = bits.wrapping_sub(ROOT_HALF);
    let exponent = f64::from_bits((shifted.wrapping_add(1 << 62) >> 52) | TWO_52) - TWO_52_AND_BIAS;
    let m = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff).wrapping_add(ROOT_HALF));
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let mut series = 1.0 / 17.0;
    series = series * q + 1.0 / 15.0;
    series = series * q + 1.0 / 13.0;
    series = series * q + 1.0 / 11.0;
    series = series * q + 1.0 / 9.0;
    series = series * q + 1.0 / 7.0;
    series = series * q + 1.0 / 5.0;
    series = series * q + 1.0 / 3.0;
    let ln = 2.0 * (s + s * q * series) + exponent * std::f64::consts::LN_2;
    if fine { x * ln } else { 0.0 }
}

/// Bit pattern of √½.
const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
/// Bit pattern of 2^52: a small integer can be added to the lower bits.
const TWO_52: u64 = 0x4330_0000_0000_0000;
/// 2^52 and the bias added before the shift.
const TWO_52_AND_BIAS: f64 = 4_503_599_627_370_496.0 + 1024.0;

/// Eigenvalues λ1 ≥ λ2 ≥ λ3 ≥ 0 and their unit eigenvectors, one matrix per lane.
#[derive(Clone, Debug)]
pub(super) struct Eigen {
    pub(super) values: [Lane; 3],
    pub(super) vectors: [[Lane; 3]; 3],
}

/// Jacobi's method: six sweeps reduce every off-diagonal entry to below the rounding of `f64`.
#[inline(always)]
pub(super) fn eigen(matrix: &Matrix) -> Eigen {
    let [xx, yy, zz, xy, xz, yz] = *matrix;
    let mut values = [xx, yy, zz];
    // off[i] couples the two axes other than i.
    let mut off = [yz, xz, xy];
    let (one, zero) = ([1.0; LANES], [0.0; LANES]);
    let mut vectors = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..6 {
        rotate(&mut values, &mut off, &mut vectors, (0, 1, 2));
        rotate(&mut values, &mut off, &mut vectors, (0, 2, 1));
        rotate(&mut values, &mut off, &mut vectors, (1, 2, 0));
    }
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        order(&mut values, &mut vectors, (i, j));
    }
    for value in &mut values {
        for v in value {
            *v = if *v > 0.0 { *v } else { 0.0 };
        }
    }
    Eigen { values, vectors }
}

/// Jacobi rotation that makes the entry of axes p and q zero; r is the third axis.
#[inline(always)]
fn rotate(values: &mut [Lane; 3], off: &mut [Lane; 3], vectors: &mut [[Lane; 3]; 3], (p, q, r): (usize, usize, usize)) {
    for l in 0..LANES {
        let coupling = off[r][l];
        let (a, b) = (values[p][l], values[q][l]);
        let half = 0.5 * (b - a);
        let below = half.abs() + (half * half + coupling * coupling).sqrt();
        let t = coupling / if below > 0.0 { below } else { 1.0 };
        let t = if half < 0.0 { -t } else { t };
        let c = 1.0 / (1.0 + t * t).sqrt();
        let s = t * c;
        values[p][l] = a - t * coupling;
        values[q][l] = b + t * coupling;
        off[r][l] = 0.0;
        // off[q] couples p and r, off[p] couples q and r.
        let (pr, qr) = (off[q][l], off[p][l]);
        off[q][l] = c * pr - s * qr;
        off[p][l] = s * pr + c * qr;
        for axis in 0..3 {
            let (u, v) = (vectors[p][axis][l], vectors[q][axis][l]);
            vectors[p][axis][l] = c * u - s * v;
            vectors[q][axis][l] = s * u + c * v;
        }
    }
}

/// Swaps the eigenpairs i and j if the first is smaller.
#[inline(always)]
fn order(values: &mut [Lane; 3], vectors: &mut [[Lane; 3]; 3], (i, j): (usize, usize)) {
    for l in 0..LANES {
        let swap = values[i][l] < values[j][l];
        let (a, b) = (values[i][l], values[j][l]);
        values[i][l] = if swap { b } else { a };
        values[j][l] = if swap { a } else { b };
        for axis in 0..3 {
            let (a, b) = (vectors[i][axis][l], vectors[j][axis][l]);
            vectors[i][axis][l] = if swap { b } else { a };
            vectors[j][axis][l] = if swap { a } else { b };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Sym3;
    use crate::random::stream;

    #[test]
    fn x_ln_x_equals_the_library_within_rounding() {
        let mut s = stream(1, 1);
        for _ in 0..20_000 {
            let x = (-s.uniform() * 40.0).exp();
            assert!((x_ln_x(x) - x * x.ln()).abs() <= 2e-15 * (x * x.ln()).abs() + 2e-16 * x, "{x}");
        }
        assert_eq!((x_ln_x(0.0), x_ln_x(-1e-9), x_ln_x(1.0)), (0.0, 0.0, 0.0));
    }

    #[test]
    fn the_outer_root_is_the_cosine_of_a_third_of_the_angle() {
        for i in 0..=1000 {
            let r = f64::from(i) / 1000.0;
            assert!((outer_root(r) - 2.0 * (r.acos() / 3.0).cos()).abs() < 3e-15, "{r}");
        }
    }

    fn random_matrices() -> Vec<[f64; 6]> {
        let mut s = stream(2, 2);
        let mut all: Vec<[f64; 6]> = (0..4000)
            .map(|i| {
                let flat = [1.0, 1e-3, 1e-7, 0.0][i % 4];
                let thin = [1.0, 1e-4, 1.0][i % 3];
                let unit = [0; 9].map(|_| s.uniform() - 0.5);
                let row = |a: usize| [unit[a], unit[a + 3] * thin, unit[a + 6] * flat];
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let (x, y, z) = (row(0), row(1), row(2));
                [dot(x, x), dot(y, y), dot(z, z), dot(x, y), dot(x, z), dot(y, z)]
            })
            .collect();
        all.extend([[1.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0, 0.0, 0.0], [3.0, 3.0, 3.0, 0.0, 0.0, 0.0]]);
        all
    }

    #[test]
    fn entropy_and_eigen_systems_agree_with_the_reference() {
        for m in random_matrices() {
            let reference = Sym3 { diagonal: [m[0], m[1], m[2]], off: [m[3], m[4], m[5]] }.eigen();
            let sum: f64 = reference.values.iter().sum();
            let terms = reference.values.map(|v| if v > 0.0 { -v / sum * (v / sum).ln() } else { 0.0 });
            let allowed = if reference.values[0] < (1.0 - 1e-4) * sum { 1e-9 } else { TIE };
            assert!((eigenentropy(m) - terms.iter().sum::<f64>()).abs() < allowed, "{m:?}");
            let found = eigen(&m.map(|v| [v; LANES]));
            for i in 0..3 {
                assert!((found.values[i][3] - reference.values[i]).abs() <= 1e-14 * sum);
                let (v, unit) = (found.vectors[i].map(|a| a[3]), found.vectors[i].iter().map(|a| a[3] * a[3]));
                assert!((unit.sum::<f64>() - 1.0).abs() < 1e-13);
                let image = [
                    m[0] * v[0] + m[3] * v[1] + m[4] * v[2],
                    m[3] * v[0] + m[1] * v[1] + m[5] * v[2],
                    m[4] * v[0] + m[5] * v[1] + m[2] * v[2],
                ];
                assert!((0..3).all(|a| (image[a] - found.values[i][3] * v[a]).abs() < 1e-13 * sum));
            }
        }
        assert_eq!(eigenentropy([0.0; 6]), f64::INFINITY);
    }
}
