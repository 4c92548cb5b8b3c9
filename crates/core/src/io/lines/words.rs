//! The words of a line of text, and the numbers they denote.

use super::decimal;
use crate::cloud::Values;

/// A word and its position.
#[derive(Clone, Copy, Debug)]
pub(in crate::io) struct Word<'a> {
    /// Column of the first byte, from 1.
    pub(in crate::io) at: usize,
    pub(in crate::io) text: &'a [u8],
    /// The number, if the word denotes one; `nan` and `inf` do, numbers that overflow do not.
    pub(in crate::io) value: Option<f64>,
}

/// The words of a line, separated by blanks, tabs, commas and semicolons.
#[derive(Clone, Debug)]
pub(in crate::io) struct Words<'a> {
    line: &'a [u8],
    at: usize,
}

#[inline]
pub(in crate::io) fn separator(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b'\x0c' | b',' | b';')
}

impl<'a> Words<'a> {
    pub(in crate::io) fn new(line: &'a [u8]) -> Self {
        Self { line, at: 0 }
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = Word<'a>;

    #[inline]
    fn next(&mut self) -> Option<Word<'a>> {
        while separator(*self.line.get(self.at)?) {
            self.at += 1;
        }
        let (start, rest) = (self.at, self.line.get(self.at..)?);
        if let Some((value, length)) = decimal::leading(rest)
            && rest.get(length).is_none_or(|&b| separator(b))
        {
            self.at += length;
            return Some(Word { at: start + 1, text: rest.get(..length)?, value: Some(value) });
        }
        let length = rest.iter().position(|&b| separator(b)).unwrap_or(rest.len());
        let text = rest.get(..length)?;
        self.at += length;
        let digits = text.iter().any(u8::is_ascii_digit);
        Some(Word { at: start + 1, text, value: decimal::parse(text).filter(|v| v.is_finite() || !digits) })
    }
}

macro_rules! whole {
    ($v:expr, $word:expr, $value:expr, $type:ty) => {{
        let inside = ($value as $type) as f64 == $value && $value.abs() < 9e15;
        let number = if inside { Some($value as $type) } else { $word.string().parse().ok() };
        number.map(|number| $v.push(number)).is_some()
    }};
}

impl Word<'_> {
    /// The word as text for messages.
    pub(in crate::io) fn string(&self) -> String {
        String::from_utf8_lossy(self.text).into_owned()
    }

    /// Appends the number to values of its type; false if there is none or it does not fit.
    #[expect(clippy::float_cmp, reason = "whether a number is whole is an exact question")]
    pub(in crate::io) fn push(&self, values: &mut Values) -> bool {
        let Some(value) = self.value else { return false };
        match values {
            Values::U8(v) => whole!(v, self, value, u8),
            Values::I8(v) => whole!(v, self, value, i8),
            Values::U16(v) => whole!(v, self, value, u16),
            Values::I16(v) => whole!(v, self, value, i16),
            Values::U32(v) => whole!(v, self, value, u32),
            Values::I32(v) => whole!(v, self, value, i32),
            Values::U64(v) => whole!(v, self, value, u64),
            Values::I64(v) => whole!(v, self, value, i64),
            Values::F32(v) => {
                v.push(value as f32);
                true
            }
            Values::F64(v) => {
                v.push(value);
                true
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_numbers_with_their_places() {
        let words: Vec<_> = Words::new(b" 1.5,-2;\t1e400 nan q").map(|w| (w.at, w.value)).collect();
        assert_eq!(words[..3], [(2, Some(1.5)), (6, Some(-2.0)), (10, None)]);
        assert!(words[3].1.unwrap().is_nan());
        assert_eq!(words[4], (20, None));
    }

    #[test]
    fn integers_fit_or_are_refused() {
        let push = |text: &str, mut values: Values| {
            let word = Words::new(text.as_bytes()).next().unwrap();
            word.push(&mut values).then_some(values)
        };
        assert_eq!(push("255", Values::U8(vec![])), Some(Values::U8(vec![255])));
        assert_eq!(push("-1", Values::U8(vec![])), None);
        assert_eq!(push("1.5", Values::I32(vec![])), None);
        assert_eq!(push("18446744073709551615", Values::U64(vec![])), Some(Values::U64(vec![u64::MAX])));
        assert_eq!(push("18446744073709551616", Values::U64(vec![])), None);
        assert_eq!(push("nan", Values::U8(vec![])), None);
    }
}
