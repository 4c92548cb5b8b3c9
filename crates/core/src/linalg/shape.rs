//! The formulas of features that follow from eigenvalues λ1 ≥ λ2 ≥ λ3 ≥ 0 alone: one copy of each, for points and
//! segments, for one value at a time ([`Exact`](super::arithmetic::Exact)) and for SIMD lanes
//! ([`Lanes`](super::arithmetic::Lanes)).

use super::arithmetic::{CubeRoot, Division, Logarithm, Real};

/// Shares of the eigenvalues; all 0 if λ1 is 0.
///
/// Linearity, planarity and scattering sum to 1 (M. Weinmann et al. 2015, doi:10.1016/j.isprsjprs.2015.01.016); all are
/// the same for λ of any unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shape<T> {
    /// (λ1 − λ2) / λ1, 0..=1.
    pub(crate) linearity: T,
    /// (λ2 − λ3) / λ1, 0..=1.
    pub(crate) planarity: T,
    /// λ3 / λ1, 0..=1; also called sphericity.
    pub(crate) scattering: T,
    /// (λ1 − λ3) / λ1, 0..=1.
    pub(crate) anisotropy: T,
    /// λ3 / (λ1 + λ2 + λ3), 0..=1/3; also called change of curvature.
    pub(crate) surface_variation: T,
}

impl<T: Real> Shape<T> {
    /// The shares, by the division `D`.
    #[inline(always)]
    pub(crate) fn of<D: Division<T>>([l1, l2, l3]: [T; 3]) -> Self {
        let (first, total) = (D::divisor(l1), D::divisor(sum([l1, l2, l3])));
        Self {
            linearity: D::quotient(l1 - l2, first),
            planarity: D::quotient(l2 - l3, first),
            scattering: D::quotient(l3, first),
            anisotropy: D::quotient(l1 - l3, first),
            surface_variation: D::quotient(l3, total),
        }
    }
}

/// λ1 + λ2 + λ3.
#[inline(always)]
pub(crate) fn sum<T: Real>([l1, l2, l3]: [T; 3]) -> T {
    l1 + l2 + l3
}

/// λ / (λ1 + λ2 + λ3); all 0 if the sum is.
#[inline(always)]
pub(crate) fn normalised<D: Division<T>, T: Real>(values: [T; 3]) -> [T; 3] {
    let divisor = D::divisor(sum(values));
    let [l1, l2, l3] = values;
    [D::quotient(l1, divisor), D::quotient(l2, divisor), D::quotient(l3, divisor)]
}

/// (λ1 λ2 λ3)^(1/3).
#[inline(always)]
pub(crate) fn omnivariance<F: CubeRoot<T>, T: Real>([l1, l2, l3]: [T; 3]) -> T {
    F::cbrt(l1 * l2 * l3)
}

/// −Σ λ ln λ with 0 ln 0 = 0; of normalised eigenvalues in 0..=ln 3.
#[inline(always)]
pub(crate) fn eigenentropy<F: Logarithm<T>, T: Real>([l1, l2, l3]: [T; 3]) -> T {
    -(F::x_ln_x(l1) + F::x_ln_x(l2) + F::x_ln_x(l3))
}

#[cfg(test)]
mod tests {
    use super::super::arithmetic::{Exact, Lanes};
    use super::*;

    #[test]
    fn a_box_of_sides_four_two_one_has_its_known_shape() {
        // Variances in the ratio 16 : 4 : 1.
        let expected = Shape {
            linearity: 0.75,
            planarity: 0.1875,
            scattering: 0.0625,
            anisotropy: 0.9375,
            surface_variation: 1.0 / 21.0,
        };
        assert_eq!(Shape::of::<Exact>([16.0, 4.0, 1.0]), expected);
        assert_eq!(normalised::<Exact, f64>([16.0, 4.0, 1.0]), [16.0 / 21.0, 4.0 / 21.0, 1.0 / 21.0]);
        assert!((omnivariance::<Exact, _>([16.0, 4.0, 1.0f64]) - 4.0).abs() < 1e-15);
        let thirds = [1.0 / 3.0; 3];
        assert!((eigenentropy::<Exact, f64>(thirds) - 3f64.ln()).abs() < 1e-15);
        assert!((eigenentropy::<Lanes, f64>(thirds) - 3f64.ln()).abs() < 1e-15);
    }

    #[test]
    fn lanes_and_single_values_agree_and_no_extent_gives_zeros() {
        for values in [[9.0f32, 4.0, 1.0], [5.0, 5.0, 0.0], [3.0, 0.0, 0.0], [1e-20, 1e-21, 1e-22]] {
            let (one, lane) = (Shape::of::<Exact>(values), Shape::of::<Lanes>(values));
            let list = |s: Shape<f32>| [s.linearity, s.planarity, s.scattering, s.anisotropy, s.surface_variation];
            assert!(list(one).into_iter().zip(list(lane)).all(|(a, b)| (a - b).abs() < 1e-6), "{one:?} {lane:?}");
            let wide = values.map(f64::from);
            let entropies = [f64::from(eigenentropy::<Lanes, f32>(values)), eigenentropy::<Exact, f64>(wide)];
            assert!((entropies[0] - entropies[1]).abs() < 1e-5, "{entropies:?}");
        }
        assert_eq!(Shape::of::<Exact>([0.0f64; 3]), Shape::default());
        assert_eq!(Shape::of::<Lanes>([0.0f32; 3]), Shape::default());
        assert_eq!(normalised::<Lanes, f32>([0.0; 3]), [0.0; 3]);
        assert_eq!((omnivariance::<Lanes, f32>([0.0; 3]), eigenentropy::<Lanes, f32>([0.0; 3])), (0.0, 0.0));
    }
}
