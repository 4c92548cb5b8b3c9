//! A grid of settings.

use crate::error::{Error, Result};
use std::str::FromStr;

/// Largest number of combinations.
const MOST: usize = 10_000;

/// A key of a recipe and the values to try.
#[derive(Clone, Debug, PartialEq)]
pub struct GridAxis {
    /// The key, e.g. `forest.max_depth`.
    pub key: String,
    /// Its values as TOML; a bare word counts as text.
    pub values: Vec<String>,
}

/// All combinations of the values of some keys; the last key changes fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// The keys.
    pub axes: Vec<GridAxis>,
}

impl FromStr for GridAxis {
    type Err = Error;

    /// Reads `key=value,value,...`; commas within brackets belong to a value.
    fn from_str(text: &str) -> Result<Self> {
        let bad = || Error::parameter("grid", text, "KEY=VALUE,VALUE,..., e.g. forest.max_depth=18,30");
        let (key, list) = text.split_once('=').ok_or_else(bad)?;
        let mut values = vec![String::new()];
        let mut depth = 0i32;
        for ch in list.chars() {
            depth += i32::from("[{".contains(ch)) - i32::from("]}".contains(ch));
            match (ch, values.last_mut()) {
                (',', _) if depth == 0 => values.push(String::new()),
                (_, Some(value)) => value.push(ch),
                _ => {}
            }
        }
        let values: Vec<String> = values.iter().map(|value| value.trim().to_string()).collect();
        match key.trim().is_empty() || values.iter().any(String::is_empty) {
            true => Err(bad()),
            false => Ok(Self { key: key.trim().to_string(), values }),
        }
    }
}

impl Grid {
    /// The settings of each combination; one without settings if there is no key.
    ///
    /// # Errors
    /// If there are more than 10,000, or a key has no value or occurs twice.
    pub fn candidates(&self) -> Result<Vec<Vec<String>>> {
        for (at, axis) in self.axes.iter().enumerate() {
            if axis.values.is_empty() || self.axes[..at].iter().any(|other| other.key == axis.key) {
                return Err(Error::parameter("grid", &axis.key, "each key once, with one value or more"));
            }
        }
        let count = self.axes.iter().fold(1usize, |count, axis| count.saturating_mul(axis.values.len()));
        if count > MOST {
            return Err(Error::parameter("grid", count, format!("at most {MOST} combinations")));
        }
        let mut all: Vec<Vec<String>> = vec![Vec::new()];
        for GridAxis { key, values } in &self.axes {
            let longer = |before: &Vec<String>| {
                let with = |value: &String| [&before[..], &[format!("{key}={value}")]].concat();
                values.iter().map(with).collect::<Vec<_>>()
            };
            all = all.iter().flat_map(longer).collect();
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_tried_once() {
        let axis = |text: &str| text.parse::<GridAxis>().unwrap();
        let grid = Grid { axes: vec![axis("a.b=1, 2"), axis("c=[1,2],{ x = 1, y = 2 },word")] };
        let expected = ["[1,2]", "{ x = 1, y = 2 }", "word"];
        let found = grid.candidates().unwrap();
        assert_eq!(found.len(), 6);
        for (at, settings) in found.iter().enumerate() {
            assert_eq!(settings, &[format!("a.b={}", 1 + at / 3), format!("c={}", expected[at % 3])]);
        }
        assert_eq!(Grid::default().candidates().unwrap(), [Vec::<String>::new()]);
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        for text in ["a", "a=", "=1", "a=1,,2"] {
            assert!(text.parse::<GridAxis>().is_err(), "{text}");
        }
        let axis = GridAxis { key: "a".into(), values: vec!["1".into(); 101] };
        let other = GridAxis { key: "b".into(), ..axis.clone() };
        assert!(Grid { axes: vec![axis.clone(), axis.clone()] }.candidates().is_err());
        assert!(Grid { axes: vec![axis, other] }.candidates().unwrap_err().to_string().contains("10201"));
    }
}
