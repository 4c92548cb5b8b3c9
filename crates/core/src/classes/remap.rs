//! Mapping of class codes, as in `--map 3=5,4=5`.

use crate::error::{Error, Result};
use std::str::FromStr;

/// A mapping of all codes; codes without an entry map to themselves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelMap([u8; 256]);

impl Default for LabelMap {
    fn default() -> Self {
        Self(std::array::from_fn(|i| i as u8))
    }
}

impl LabelMap {
    /// The code that `code` is mapped to.
    pub fn apply(&self, code: u8) -> u8 {
        self.0[usize::from(code)]
    }

    /// Maps `from` to `to`.
    pub fn set(&mut self, from: u8, to: u8) {
        self.0[usize::from(from)] = to;
    }
}

impl FromStr for LabelMap {
    type Err = Error;

    /// Reads `old=new` pairs separated by commas; `a-b=new` maps a range.
    fn from_str(text: &str) -> Result<Self> {
        let mut map = Self::default();
        let bad = |part: &str| Error::parameter("map", part, "old=new pairs of codes 0..255, e.g. 3=5,4=5 or 3-4=5");
        for part in text.split(',').map(str::trim).filter(|p| !p.is_empty()) {
            let (from, to) = part.split_once('=').ok_or_else(|| bad(part))?;
            let (low, high) = from.split_once('-').unwrap_or((from, from));
            let code = |s: &str| s.trim().parse::<u8>().map_err(|_| bad(part));
            let (low, high, to) = (code(low)?, code(high)?, code(to)?);
            (low..=high).for_each(|from| map.set(from, to));
        }
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_and_ranges_are_read() {
        let map: LabelMap = "3-4=5, 1=0".parse().unwrap();
        assert_eq!([0, 1, 2, 3, 4, 5].map(|c| map.apply(c)), [0, 0, 2, 5, 5, 5]);
        assert!("3=256".parse::<LabelMap>().is_err());
        assert!("car=2".parse::<LabelMap>().is_err());
    }
}
