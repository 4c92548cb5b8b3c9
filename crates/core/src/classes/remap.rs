//! Mapping of class codes, as in `--map 3=5,4=5`.

use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::str::FromStr;

/// A mapping of all codes; codes without an entry map to themselves. Codes above 255 need an entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelMap {
    codes: [u8; 256],
    /// First and last code above 255, and the code that they become.
    large: Vec<[u32; 3]>,
    /// First and last code of each entry of the text that the map was read from.
    entries: Vec<[u32; 2]>,
}

impl Default for LabelMap {
    fn default() -> Self {
        Self { codes: std::array::from_fn(|i| i as u8), large: Vec::new(), entries: Vec::new() }
    }
}

impl LabelMap {
    /// The code that `code` is mapped to.
    pub fn apply(&self, code: u8) -> u8 {
        self.codes[usize::from(code)]
    }

    /// The code that a value, 0 or more, is mapped to; `None` if it is no whole number, or above 255 without an entry.
    pub fn of_value(&self, value: f64) -> Option<u8> {
        let code = value as u32;
        if (f64::from(code) - value).abs() > 0.0 {
            return None;
        }
        match u8::try_from(code) {
            Ok(code) => Some(self.apply(code)),
            // The last entry counts.
            Err(_) => {
                let entry = self.large.iter().rev().find(|[low, high, _]| (*low..=*high).contains(&code));
                entry.map(|[_, _, to]| *to as u8)
            }
        }
    }

    /// The entries of the map's text that name none of these codes, as text: `99`, `7-9`.
    pub fn unused(&self, codes: &BTreeSet<u32>) -> Vec<String> {
        let used = |[low, high]: [u32; 2]| codes.range(low..=high).next().is_some();
        let text = |[low, high]: [u32; 2]| if low == high { low.to_string() } else { format!("{low}-{high}") };
        self.entries.iter().copied().filter(|&entry| !used(entry)).map(text).collect()
    }

    /// Maps `from` to `to`.
    pub fn set(&mut self, from: u8, to: u8) {
        self.codes[usize::from(from)] = to;
    }
}

impl FromStr for LabelMap {
    type Err = Error;

    /// Reads `old=new` pairs separated by commas; `a-b=new` maps a range.
    fn from_str(text: &str) -> Result<Self> {
        let mut map = Self::default();
        let bad = |part: &str| {
            Error::parameter("map", part, "old=new pairs of codes, e.g. 3=5,4=5 or 3-4=5; new ones 0..255")
        };
        for part in text.split(',').map(str::trim).filter(|p| !p.is_empty()) {
            let (from, to) = part.split_once('=').ok_or_else(|| bad(part))?;
            let (low, high) = from.split_once('-').unwrap_or((from, from));
            let code = |s: &str| s.trim().parse::<u32>().map_err(|_| bad(part));
            let (low, high, to) = (code(low)?, code(high)?, to.trim().parse::<u8>().map_err(|_| bad(part))?);
            if low > high {
                return Err(bad(part));
            }
            map.entries.push([low, high]);
            (low..=high.min(255)).for_each(|from| map.set(from as u8, to));
            if high > 255 {
                map.large.push([low.max(256), high, to.into()]);
            }
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
        assert!("3=256".parse::<LabelMap>().is_err() && "9-3=2".parse::<LabelMap>().is_err());
        let large: LabelMap = "250-259=20,1004=6,258=18".parse().unwrap();
        let of = |value: f64| large.of_value(value);
        assert_eq!([249.0, 250.0, 255.0, 257.0, 258.0, 1004.0].map(of), [249, 20, 20, 20, 18, 6].map(Some));
        assert_eq!([256.5, 260.0, 1e12].map(of), [None; 3]);
        assert!("car=2".parse::<LabelMap>().is_err());
    }

    #[test]
    fn entries_for_codes_that_do_not_occur_are_told() {
        let map: LabelMap = "3-5=4,99=4, 7-9=1,1004=6,2=2".parse().unwrap();
        assert_eq!(map.unused(&BTreeSet::from([2, 5, 6])), ["99", "7-9", "1004"]);
        assert_eq!(map.unused(&BTreeSet::from([2, 5, 7, 1004])), ["99"]);
        assert!(LabelMap::default().unused(&BTreeSet::new()).is_empty());
    }
}
