//! Count, mean and covariance of a set of points from sums, and eigenvalues in closed form.

use crate::linalg::Sym3;

/// Sums over points relative to a reference position near them, in `f64`: mean and covariance (divisor n) in one pass.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::segmentation) struct Moments {
    count: f64,
    sum: [f64; 3],
    diagonal: [f64; 3],
    off: [f64; 3],
}

impl Moments {
    /// Adds a point, given relative to the reference position.
    #[inline(always)]
    pub(in crate::segmentation) fn add(&mut self, d: [f64; 3]) {
        self.count += 1.0;
        for (a, &v) in d.iter().enumerate() {
            self.sum[a] += v;
            self.diagonal[a] += v * v;
        }
        self.off[0] += d[0] * d[1];
        self.off[1] += d[0] * d[2];
        self.off[2] += d[1] * d[2];
    }

    /// Mean, relative to the reference position; zero if there are no points.
    pub(in crate::segmentation) fn mean(&self) -> [f64; 3] {
        self.sum.map(|s| s / self.count.max(1.0))
    }

    /// Covariance, m².
    pub(in crate::segmentation) fn covariance(&self) -> Sym3 {
        let n = self.count.max(1.0);
        let m = self.mean();
        let diagonal = [0, 1, 2].map(|a| (self.diagonal[a] / n - m[a] * m[a]).max(0.0));
        let pairs = [(0, 1), (0, 2), (1, 2)];
        let off = [0, 1, 2].map(|i| self.off[i] / n - m[pairs[i].0] * m[pairs[i].1]);
        Sym3 { diagonal, off }
    }
}

/// λ1 ≥ λ2 ≥ λ3 ≥ 0 of a positive semi-definite matrix, accurate to about 1e-8 λ1.
///
/// O. K. Smith, *Eigenvalues of a symmetric 3 × 3 matrix*, Communications of the ACM 4(4), 1961.
pub(in crate::segmentation) fn eigenvalues(matrix: &Sym3) -> [f64; 3] {
    let [xx, yy, zz] = matrix.diagonal;
    let [xy, xz, yz] = matrix.off;
    let third = (xx + yy + zz) / 3.0;
    let [x, y, z] = [xx - third, yy - third, zz - third];
    let scale = ((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0).sqrt();
    if scale <= 0.0 {
        return [third.max(0.0); 3];
    }
    let determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
    let angle = (determinant / (2.0 * scale * scale * scale)).clamp(-1.0, 1.0).acos() / 3.0;
    let first = third + 2.0 * scale * angle.cos();
    let last = third + 2.0 * scale * (angle + std::f64::consts::TAU / 3.0).cos();
    let middle = (3.0 * third - first - last).clamp(last, first);
    [first.max(0.0), middle.max(0.0), last.max(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn eigenvalues_are_those_of_the_iterative_solver() {
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
            let expected = Sym3::scatter(&points, crate::linalg::mean(&points), 9.0).eigen().values;
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
