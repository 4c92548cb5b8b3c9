//! Linear algebra for neighbourhoods: symmetric 3 x 3 matrices, their eigenvalues and eigenvectors, and the formulas of
//! the shape features that follow from eigenvalues.
//!
//! | solver | method | result | used for |
//! |---|---|---|---|
//! | `jacobi`, [`Sym3::eigen`] | Jacobi's rotations, lanes of `f32` or `f64` | λ and e | features, normals, segments |
//! | `closed_form` | Smith 1961, lanes of `f64` | λ | optimal neighbourhoods, octree cells, Riemannian graph |
//!
//! The closed form is for loops that need no eigenvectors: it has no iterations, but only half of the digits are
//! correct where two eigenvalues are close to each other. The tests compare both with nalgebra's Householder and QR
//! iterations.

pub(crate) mod arithmetic;
pub(crate) mod closed_form;
pub(crate) mod jacobi;
mod moments;
pub(crate) mod shape;
mod spread;
mod sym3;

pub(crate) use moments::Moments;
pub(crate) use spread::Spread;
pub use sym3::{Eigen3, Sym3, mean, medoid};

#[cfg(test)]
pub(crate) mod testing {
    use crate::random::stream;

    /// Matrices of solids, planes and lines, of every ratio of their eigenvalues down to 0; xx, yy, zz, xy, xz, yz.
    pub(crate) fn matrices() -> Vec<[f64; 6]> {
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
}

#[cfg(test)]
mod tests {
    use super::closed_form::{eigenvalues, unit_eigenvalues};
    use super::jacobi::jacobi;
    use super::testing::matrices;
    use super::*;
    use nalgebra::{Matrix3, SymmetricEigen};

    fn sym3(m: [f64; 6]) -> Sym3 {
        Sym3 { diagonal: [m[0], m[1], m[2]], off: [m[3], m[4], m[5]] }
    }

    /// Eigenvalues by Householder's reduction and QR iterations, descending.
    fn by_qr([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 3] {
        let solved = SymmetricEigen::new(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
        let mut values: [f64; 3] = solved.eigenvalues.into();
        values.sort_by(|a, b| b.total_cmp(a));
        values.map(|v| v.max(0.0))
    }

    /// Largest difference between the matrix times a unit vector and `value` times that vector.
    fn residual(m: [f64; 6], value: f64, v: [f64; 3]) -> f64 {
        let image = [
            m[0] * v[0] + m[3] * v[1] + m[4] * v[2],
            m[3] * v[0] + m[1] * v[1] + m[5] * v[2],
            m[4] * v[0] + m[5] * v[1] + m[2] * v[2],
        ];
        (0..3).map(|a| (image[a] - value * v[a]).abs()).fold(0.0, f64::max)
    }

    fn norm(v: [f64; 3]) -> f64 {
        v.iter().map(|c| c * c).sum::<f64>().sqrt()
    }

    #[test]
    fn lanes_of_both_precisions_solve_the_eigen_system() {
        for m in matrices() {
            let expected = by_qr(m);
            let sum: f64 = expected.iter().sum();
            let (double, single) = (jacobi(&m.map(|v| [v; 8])), jacobi(&m.map(|v| [v as f32; 16])));
            let one = sym3(m).eigen();
            assert_eq!(
                (one.values, one.vectors),
                (double.values.map(|v| v[3]), double.vectors.map(|e| e.map(|a| a[3])))
            );
            for (i, expected) in expected.into_iter().enumerate() {
                let (value, vector) = (double.values[i][3], double.vectors[i].map(|a| a[3]));
                assert!((value - expected).abs() <= 1e-14 * sum, "{m:?}");
                assert!((norm(vector) - 1.0).abs() < 1e-13 && residual(m, value, vector) < 1e-13 * sum, "{m:?}");
                let (value, vector) = (f64::from(single.values[i][9]), single.vectors[i].map(|a| f64::from(a[9])));
                assert!((value - expected).abs() <= 2e-6 * sum, "{m:?}");
                assert!((norm(vector) - 1.0).abs() < 1e-5 && residual(m, value, vector) < 1e-5 * sum, "{m:?}");
            }
        }
    }

    #[test]
    fn closed_forms_give_the_eigenvalues_of_the_iterative_solver() {
        for m in matrices() {
            let expected = by_qr(m);
            let sum: f64 = expected.iter().sum();
            let mut unit = unit_eigenvalues(m);
            unit.sort_by(|a, b| b.total_cmp(a));
            for (i, found) in eigenvalues(&sym3(m)).into_iter().enumerate() {
                assert!((found - expected[i]).abs() <= 1e-7 * sum, "{m:?}");
                assert!((unit[i] * sum - expected[i]).abs() <= 1e-7 * sum, "{m:?}");
            }
        }
    }
}
