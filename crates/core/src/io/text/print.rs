//! Numbers as text: the same bytes as `Display`, but faster.

use crate::cloud::Values;
use std::io::Write;

/// Magnitudes that zmij writes without an exponent, in both precisions.
const PLAIN: std::ops::Range<f64> = 1e-5..1e12;

/// Appends value `i`.
pub(super) fn value(values: &Values, i: usize, text: &mut Vec<u8>) {
    match values {
        Values::U8(v) => whole(v[i], text),
        Values::I8(v) => whole(v[i], text),
        Values::U16(v) => whole(v[i], text),
        Values::I16(v) => whole(v[i], text),
        Values::U32(v) => whole(v[i], text),
        Values::I32(v) => whole(v[i], text),
        Values::U64(v) => whole(v[i], text),
        Values::I64(v) => whole(v[i], text),
        Values::F32(v) => single(v[i], text),
        Values::F64(v) => double(v[i], text),
    }
}

fn whole(value: impl itoa::Integer, text: &mut Vec<u8>) {
    text.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// Appends the shortest decimal that is parsed as `value`, without an exponent.
pub(super) fn double(value: f64, text: &mut Vec<u8>) {
    let mut buffer = zmij::Buffer::new();
    let bits = value.to_bits();
    let lowest = (bits & ((1 << 52) - 1) | 1 << 52).trailing_zeros() as i32 + (bits >> 52 & 0x7ff) as i32 - 1075;
    let digits = match PLAIN.contains(&value.abs()) {
        true => shortest(buffer.format_finite(value).as_bytes(), lowest),
        false => None,
    };
    spell(digits, value, text);
}

fn single(value: f32, text: &mut Vec<u8>) {
    let mut buffer = zmij::Buffer::new();
    let bits = value.to_bits();
    let lowest = (bits & ((1 << 23) - 1) | 1 << 23).trailing_zeros() as i32 + (bits >> 23 & 0xff) as i32 - 150;
    let digits = match PLAIN.contains(&f64::from(value.abs())) {
        true => shortest(buffer.format_finite(value).as_bytes(), lowest),
        false => None,
    };
    spell(digits, value, text);
}

/// The digits as `Display` writes them; `lowest` is the exponent (base 2) of the last bit.
///
/// `None` if the number is exactly halfway between two shortest decimals: zmij takes the even one, `Display` the
/// larger. A number with n binary places has n decimal places, the last of which is 5; so it is halfway if all but one
/// are written.
fn shortest(digits: &[u8], lowest: i32) -> Option<&[u8]> {
    let point = digits.iter().rposition(|&c| c == b'.')?;
    let places = digits.len() - point - 1;
    match digits.strip_suffix(b".0") {
        Some(whole) => Some(whole),
        None => (places as i32 + 1 != -lowest).then_some(digits),
    }
}

fn spell(digits: Option<&[u8]>, value: impl std::fmt::Display, text: &mut Vec<u8>) {
    match digits {
        Some(digits) => text.extend_from_slice(digits),
        // Writing to a vector cannot fail.
        None => _ = write!(text, "{value}"),
    }
}

/// Numbers rounded to a number of decimal places, at most 15.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounded {
    places: u32,
    steps: f64,
}

impl Rounded {
    pub(in crate::io) fn new(places: u32) -> Self {
        let places = places.min(15);
        Self { places, steps: 10u64.pow(places) as f64 }
    }

    /// Appends the number without trailing zeros, rounded half away from zero if it is below 10^(15 - places).
    ///
    /// Different decimals of at most 15 digits are never parsed as the same number, so that these are the shortest.
    pub(super) fn append(self, value: f64, text: &mut Vec<u8>) {
        let scaled = value * self.steps;
        if scaled.abs() >= 1e15 || scaled.is_nan() {
            return double(value, text);
        }
        let cut = scaled as i64;
        let number = cut.unsigned_abs() + u64::from((scaled - cut as f64).abs() >= 0.5);
        if value.is_sign_negative() {
            text.push(b'-');
        }
        let unit = 10u64.pow(self.places);
        whole(number / unit, text);
        if !number.is_multiple_of(unit) {
            // Adding the unit keeps the zeros after the decimal point.
            let mut buffer = itoa::Buffer::new();
            let digits = buffer.format(unit + number % unit).as_bytes();
            let length = digits.iter().rposition(|&c| c != b'0').unwrap_or(0);
            text.push(b'.');
            text.extend_from_slice(&digits[1..=length]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use proptest::prelude::*;

    fn same(value: f64) {
        let mut text = Vec::new();
        double(value, &mut text);
        assert_eq!(String::from_utf8(text).unwrap(), value.to_string());
        let (mut text, value) = (Vec::new(), value as f32);
        single(value, &mut text);
        assert_eq!(String::from_utf8(text).unwrap(), value.to_string());
    }

    fn same_rounded(value: f64, places: u32) {
        let steps = 10f64.powi(places as i32);
        let expected = if (value * steps).abs() < 1e15 { (value * steps).round() / steps } else { value };
        let mut text = Vec::new();
        Rounded::new(places).append(value, &mut text);
        assert_eq!(String::from_utf8(text).unwrap(), expected.to_string(), "{value} to {places}");
    }

    #[test]
    fn odd_numbers_are_spelt_as_by_the_standard_library() {
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        for value in
            [0.0, 0.1, 0.5, 2.5e-1, 1.0, 1e-5, 1e-6, 9.9e-6, 1e11, 1e12, 1e15, 1e16, 1e17, 1e22, 5e-324, nan, inf]
        {
            same(value);
            same(-value);
            (7..=15).for_each(|places| same_rounded(value, places));
            (7..=15).for_each(|places| same_rounded(-value, places));
        }
        same(f64::MAX);
        same(f64::MIN_POSITIVE);
    }

    #[test]
    fn numbers_in_the_middle_between_two_decimals_are_spelt_as_by_the_standard_library() {
        for value in [17_062.562_5, 1_539_213.25, 2f64.powi(49) + 0.125, 2f64.powi(42) + 0.062_5, 0.000_012_207_031_25]
        {
            same(value);
        }
        let mut random = stream(4, 0);
        for _ in 0..200_000 {
            let ticks = (random.uniform() * 2f64.powi(30)) as u64;
            same(ticks as f64 / 2f64.powi(random.below(26) as i32));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100_000))]

        #[test]
        fn every_number_is_spelt_as_by_the_standard_library(bits in any::<u64>(), power in -20i32..60, places in 7u32..=15) {
            same(f64::from_bits(bits));
            let near = f64::from_bits(bits & !(0x7ff << 52) | 1023 << 52) * 2f64.powi(power);
            same(near);
            same((near * 1000.0).round() / 1000.0);
            same_rounded(near, places);
            same_rounded((near * 1000.0).round() / 1000.0, places);
        }
    }
}
