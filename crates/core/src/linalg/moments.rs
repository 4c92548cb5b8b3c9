//! Count, mean and covariance of a set of points from sums.

use super::Sym3;

/// Sums over points relative to a reference position near them, in `f64`: mean and covariance (divisor n) in one pass.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moments {
    count: f64,
    sum: [f64; 3],
    diagonal: [f64; 3],
    off: [f64; 3],
}

impl Moments {
    /// Adds a point, given relative to the reference position.
    #[inline(always)]
    pub(crate) fn add(&mut self, d: [f64; 3]) {
        self.count += 1.0;
        for (a, &v) in d.iter().enumerate() {
            self.sum[a] += v;
            self.diagonal[a] += v * v;
        }
        self.off[0] += d[0] * d[1];
        self.off[1] += d[0] * d[2];
        self.off[2] += d[1] * d[2];
    }

    /// Number of points.
    pub(crate) fn count(&self) -> f64 {
        self.count
    }

    /// Mean, relative to the reference position; zero if there are no points.
    pub(crate) fn mean(&self) -> [f64; 3] {
        self.sum.map(|s| s / self.count.max(1.0))
    }

    /// Covariance around the mean, divided by the count; m².
    pub(crate) fn covariance(&self) -> Sym3 {
        let n = self.count.max(1.0);
        let m = self.mean();
        let diagonal = [0, 1, 2].map(|a| (self.diagonal[a] / n - m[a] * m[a]).max(0.0));
        let pairs = [(0, 1), (0, 2), (1, 2)];
        let off = [0, 1, 2].map(|i| self.off[i] / n - m[pairs[i].0] * m[pairs[i].1]);
        Sym3 { diagonal, off }
    }
}
