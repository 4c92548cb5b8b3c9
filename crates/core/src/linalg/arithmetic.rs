//! Real numbers of two precisions, and two ways to divide and to take logarithms and cube roots: [`Exact`] for one
//! value at a time, [`Lanes`] for loops over SIMD lanes.
//!
//! Nothing here branches on a lane or uses a fused multiply-add, so that loops vectorise and every machine gives the
//! same bytes.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real number: `f32` or `f64`.
pub(crate) trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1/2.
    const HALF: Self;
    /// 1.
    const ONE: Self;
    /// Sweeps after which Jacobi's method has reduced every off-diagonal entry to below the rounding of this type.
    const SWEEPS: usize;

    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const HALF: Self = 0.5;
    const ONE: Self = 1.0;
    const SWEEPS: usize = 4;

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const HALF: Self = 0.5;
    const ONE: Self = 1.0;
    const SWEEPS: usize = 6;

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
}

/// Division of several numbers by one; 0 if that one is not above 0.
pub(crate) trait Division<T> {
    /// What [`Division::quotient`] needs of a divisor.
    fn divisor(of: T) -> T;
    /// The numerator divided by the number that the divisor was made of.
    fn quotient(numerator: T, divisor: T) -> T;
}

/// The function x ln x of x ≥ 0, with 0 ln 0 = 0.
pub(crate) trait Logarithm<T> {
    /// x ln x.
    fn x_ln_x(x: T) -> T;
}

/// The cube root of numbers ≥ 0.
pub(crate) trait CubeRoot<T> {
    /// Cube root.
    fn cbrt(x: T) -> T;
}

/// The functions of the standard library, and one division for each quotient.
pub(crate) struct Exact;

/// Polynomials, and one division for all quotients of a divisor: the reciprocal is multiplied.
pub(crate) struct Lanes;

impl<T: Real> Division<T> for Exact {
    #[inline(always)]
    fn divisor(of: T) -> T {
        of
    }

    #[inline(always)]
    fn quotient(numerator: T, divisor: T) -> T {
        if divisor > T::ZERO { numerator / divisor } else { T::ZERO }
    }
}

impl<T: Real> Division<T> for Lanes {
    #[inline(always)]
    fn divisor(of: T) -> T {
        if of > T::ZERO { T::ONE / of } else { T::ZERO }
    }

    #[inline(always)]
    fn quotient(numerator: T, divisor: T) -> T {
        numerator * divisor
    }
}

impl Logarithm<f64> for Exact {
    fn x_ln_x(x: f64) -> f64 {
        if x > 0.0 { x * x.ln() } else { 0.0 }
    }
}

impl CubeRoot<f64> for Exact {
    fn cbrt(x: f64) -> f64 {
        x.cbrt()
    }
}

impl Logarithm<f32> for Lanes {
    #[inline(always)]
    fn x_ln_x(x: f32) -> f32 {
        x * ln(x)
    }
}

impl CubeRoot<f32> for Lanes {
    #[inline(always)]
    fn cbrt(x: f32) -> f32 {
        cbrt(x)
    }
}

impl Logarithm<f64> for Lanes {
    /// For x in 0..=1; 0 if x is not above 1e-300. ln from the exponent and 2 artanh((m − 1) / (m + 1)), m in √½..√2.
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
}

/// Bit pattern of √½.
const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
/// Bit pattern of 2^52: a small integer can be added to the lower bits.
const TWO_52: u64 = 0x4330_0000_0000_0000;
/// 2^52 and the bias added before the shift.
const TWO_52_AND_BIAS: f64 = 4_503_599_627_370_496.0 + 1024.0;

/// Natural logarithm of a non-negative number, relative error below 3e-7; 0 for 0 and denormal numbers.
#[inline(always)]
fn ln(x: f32) -> f32 {
    let bits = x.to_bits();
    // Mantissa in sqrt(1/2)..sqrt(2).
    let shifted = bits.wrapping_sub(0x3f35_04f3);
    let exponent = (shifted as i32 >> 23) as f32;
    let m = f32::from_bits((shifted & 0x007f_ffff).wrapping_add(0x3f35_04f3)) - 1.0;
    // 2 atanh(m / (2 + m)), by its series.
    let r = m / (2.0 + m);
    let s = r * r;
    let series = 2.0 + s * (0.666_666_7 + s * (0.4 + s * (0.285_714_3 + s * 0.222_222_2)));
    let value = exponent * std::f32::consts::LN_2 + r * series;
    if x >= f32::MIN_POSITIVE { value } else { 0.0 }
}

/// Cube root of a non-negative number, relative error below 3e-7.
#[inline(always)]
fn cbrt(x: f32) -> f32 {
    let mut y = f32::from_bits((x.to_bits() / 3).wrapping_add(0x2a51_4067));
    for _ in 0..3 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    if x >= f32::MIN_POSITIVE { y } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn logarithm_and_cube_root_are_accurate() {
        let mut x = 1e-30f32;
        while x < 1e30 {
            assert!((ln(x) - x.ln()).abs() <= 3e-7 * x.ln().abs().max(0.1), "ln {x}");
            assert!((cbrt(x) - x.cbrt()).abs() <= 3e-7 * x.cbrt(), "cbrt {x}");
            x *= 1.0173;
        }
        assert_eq!((ln(0.0), cbrt(0.0), ln(1.0)), (0.0, 0.0, 0.0));
    }

    #[test]
    fn x_ln_x_equals_the_library_within_rounding() {
        let mut s = stream(1, 1);
        for _ in 0..20_000 {
            let x = (-s.uniform() * 40.0).exp();
            let (lanes, exact) = (Lanes::x_ln_x(x), <Exact as Logarithm<f64>>::x_ln_x(x));
            assert!((lanes - exact).abs() <= 2e-15 * exact.abs() + 2e-16 * x, "{x}");
        }
        let lanes: fn(f64) -> f64 = Lanes::x_ln_x;
        assert_eq!((lanes(0.0), lanes(-1e-9), lanes(1.0)), (0.0, 0.0, 0.0));
        assert_eq!((Exact::x_ln_x(0.0), Exact::x_ln_x(1.0)), (0.0, 0.0));
    }

    #[test]
    fn nothing_divided_by_nothing_is_nothing() {
        let both = |n: f64, d: f64| {
            let (exact, lanes) = (<Exact as Division<f64>>::divisor(d), <Lanes as Division<f64>>::divisor(d));
            [Exact::quotient(n, exact), Lanes::quotient(n, lanes)]
        };
        assert_eq!((both(0.0, 0.0), both(3.0, 4.0)), ([0.0; 2], [0.75; 2]));
    }
}
