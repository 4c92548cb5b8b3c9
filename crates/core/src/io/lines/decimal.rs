//! Decimal numbers from bytes: the same result as `str::parse::<f64>`, bit for bit, but faster for short numbers.
//!
//! W. D. Clinger, *How to read floating point numbers accurately*, PLDI 1990, section 3: a mantissa of at most 53 bits
//! times or divided by a power of ten of at most 22 is a single correctly rounded operation. Everything else is left to
//! the standard library.

const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Number of decimal digits that always fit into a `u64`.
const DIGITS: usize = 19;
const EXACT: u64 = 1 << 53;

/// The number that the complete word denotes.
pub(super) fn parse(word: &[u8]) -> Option<f64> {
    match leading(word) {
        Some((value, length)) if length == word.len() => Some(value),
        _ => std::str::from_utf8(word).ok()?.parse().ok(),
    }
}

/// The number at the start of `text` and its length; `None` if it needs the slow path.
#[inline]
pub(super) fn leading(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let start = usize::from(negative || text.first() == Some(&b'+'));
    let (mut mantissa, whole) = digits(text.get(start..)?, 0);
    let mut at = start + whole;
    let (mut count, mut exponent) = (whole, 0);
    if text.get(at) == Some(&b'.') {
        let (longer, fraction) = digits(text.get(at + 1..)?, mantissa);
        (mantissa, count, exponent) = (longer, whole + fraction, -(fraction as i64));
        at += 1 + fraction;
    }
    if count == 0 || count > DIGITS || mantissa > EXACT {
        return None;
    }
    if matches!(text.get(at), Some(b'e' | b'E')) {
        let (power, length) = power(text.get(at + 1..)?)?;
        exponent += power;
        at += 1 + length;
    }
    let power = *POWERS.get(usize::try_from(exponent.unsigned_abs()).ok()?)?;
    let value = if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
    Some((if negative { -value } else { value }, at))
}

/// Appends leading digits to a number; returns how many there were. More than 19 overflow, which the caller sees from
/// the count.
#[inline]
fn digits(text: &[u8], mut number: u64) -> (u64, usize) {
    let mut count = 0;
    for byte in text {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        number = number.wrapping_mul(10).wrapping_add(u64::from(digit));
        count += 1;
    }
    (number, count)
}

/// The exponent after `e`: a sign and one to four digits.
fn power(text: &[u8]) -> Option<(i64, usize)> {
    let sign = usize::from(matches!(text.first(), Some(b'-' | b'+')));
    let (number, count) = digits(text.get(sign..)?, 0);
    let value = if text.first() == Some(&b'-') { -(number as i64) } else { number as i64 };
    (1..=4).contains(&count).then_some((value, sign + count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same(word: &str) {
        let expected = word.parse::<f64>().ok().map(f64::to_bits);
        assert_eq!(parse(word.as_bytes()).map(f64::to_bits), expected, "{word}");
    }

    #[test]
    fn odd_spellings_are_what_the_standard_library_says() {
        for word in [
            "",
            ".",
            "-",
            "+",
            "e5",
            "1.",
            ".5",
            "-.5",
            "+1",
            "1e",
            "1e+",
            "1e-",
            "1e5",
            "1E-5",
            "1.e3",
            "-0",
            "-0.0e9",
            "nan",
            "inf",
            "-inf",
            "Infinity",
            "1_0",
            "0x1",
            "1e400",
            "1e22",
            "1e23",
            "1e-22",
            "1e-23",
            "1e00005",
            "9007199254740992",
            "9007199254740993",
            "9007199254740993.5",
            "18446744073709551616",
            "1 ",
            "1e99999",
            "00000000000000000000001",
            "0.000000000000000000000001",
            "123456789012345678901234567890",
            "1,5",
            "1-2",
        ] {
            same(word);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn every_decimal_is_parsed_to_the_bits_of_the_standard_library(
            word in "[+-]?[0-9]{0,20}(\\.[0-9]{0,20})?([eE][+-]?[0-9]{0,3})?",
        ) {
            same(&word);
        }

        #[test]
        fn every_float_is_read_back_from_its_shortest_form(bits in any::<u64>(), places in 0usize..9) {
            let value = f64::from_bits(bits);
            same(&value.to_string());
            same(&format!("{value:e}"));
            same(&format!("{:.places$}", value % 1e7));
        }
    }
}
