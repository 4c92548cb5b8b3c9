//! One symmetric 3 x 3 matrix in `f64`: scatter of points, and its eigenvalues and eigenvectors.

use super::jacobi::jacobi;

/// A symmetric 3 x 3 matrix, stored as its upper triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym3 {
    /// xx, yy, zz.
    pub diagonal: [f64; 3],
    /// xy, xz, yz.
    pub off: [f64; 3],
}

/// Eigenvalues λ1 ≥ λ2 ≥ λ3 (negative rounding errors clamped to 0) and unit eigenvectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigen3 {
    /// λ1 ≥ λ2 ≥ λ3 ≥ 0.
    pub values: [f64; 3],
    /// e1, e2, e3: orthonormal, of arbitrary sign.
    pub vectors: [[f64; 3]; 3],
}

impl Sym3 {
    /// Σ (p − centre)(p − centre)ᵀ / divisor over all points.
    pub fn scatter(points: &[[f64; 3]], centre: [f64; 3], divisor: f64) -> Self {
        let mut sum = Self::default();
        for p in points {
            let d = [0, 1, 2].map(|a| p[a] - centre[a]);
            (0..3).for_each(|a| sum.diagonal[a] += d[a] * d[a] / divisor);
            [(0, 1), (0, 2), (1, 2)]
                .iter()
                .zip(&mut sum.off)
                .for_each(|(&(a, b), slot)| *slot += d[a] * d[b] / divisor);
        }
        sum
    }

    /// xx, yy, zz, xy, xz, yz.
    pub(crate) fn entries(&self) -> [f64; 6] {
        let [xx, yy, zz] = self.diagonal;
        let [xy, xz, yz] = self.off;
        [xx, yy, zz, xy, xz, yz]
    }

    /// Eigenvalues and eigenvectors of a matrix that is positive semi-definite up to rounding, by Jacobi's rotations.
    pub fn eigen(&self) -> Eigen3 {
        let solved = jacobi(&self.entries().map(|entry| [entry]));
        Eigen3 { values: solved.values.map(|[value]| value), vectors: solved.vectors.map(|v| v.map(|[axis]| axis)) }
    }
}

/// Arithmetic mean of points; the origin if there are none.
pub fn mean(points: &[[f64; 3]]) -> [f64; 3] {
    let n = points.len().max(1) as f64;
    [0, 1, 2].map(|a| points.iter().map(|p| p[a]).sum::<f64>() / n)
}

/// Index of the point with the least sum of distances to all (ties: the first); 0 if there are none.
pub fn medoid(points: &[[f64; 3]]) -> usize {
    let total = |p: &[f64; 3]| -> f64 {
        points.iter().map(|q| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>().sqrt()).sum()
    };
    let sums: Vec<f64> = points.iter().map(total).collect();
    (1..sums.len()).fold(0, |best, i| if sums[i] < sums[best] { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Vec<[f64; 3]> {
        (0..10).map(|i| [f64::from(i * 7 % 10), f64::from(i * i % 7) * 0.5, f64::from(i * 3 % 4) * 0.1]).collect()
    }

    #[test]
    fn eigenvectors_rebuild_the_matrix() {
        let matrix = Sym3::scatter(&scene(), mean(&scene()), 10.0);
        let Eigen3 { values, vectors } = matrix.eigen();
        assert!(values[0] >= values[1] && values[1] >= values[2] && values[2] >= 0.0);
        let entry = |a: usize, b: usize| (0..3).map(|i| values[i] * vectors[i][a] * vectors[i][b]).sum::<f64>();
        for (a, b, expected) in [(0, 0, matrix.diagonal[0]), (1, 2, matrix.off[2]), (0, 2, matrix.off[1])] {
            assert!((entry(a, b) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn the_medoid_tensor_is_the_mean_tensor_plus_an_outer_product() {
        let points = scene();
        let (m, med) = (mean(&points), points[medoid(&points)]);
        let (around_mean, around_medoid) = (Sym3::scatter(&points, m, 10.0), Sym3::scatter(&points, med, 10.0));
        for a in 0..3 {
            let shift = m[a] - med[a];
            assert!((around_medoid.diagonal[a] - around_mean.diagonal[a] - shift * shift).abs() < 1e-12);
        }
    }

    #[test]
    fn the_medoid_is_a_member_in_the_middle() {
        assert_eq!(medoid(&[[0.0; 3], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), 1);
        assert_eq!(medoid(&[[0.0; 3], [1.0, 0.0, 0.0]]), 0);
    }
}
