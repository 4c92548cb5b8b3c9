//! Attention: the strongest responses of each channel are kept, so that density, memory and time have an upper bound.

use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Which responses are strong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Attention {
    /// The largest; those not above 0 are dropped (K-ReLU).
    #[default]
    Positive,
    /// Those of largest magnitude (K-abs). In networks the rectified linear unit follows: negative ones, which take places
    /// among the strongest, become 0.
    Magnitude,
}

/// How many responses of a channel are kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// Which responses are strong.
    pub attention: Attention,
    /// Upper bound of the share of the cells of a channel that keep a response, above 0, at most 1.
    pub density: f64,
}

impl Selection {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If the density is out of range.
    pub fn validate(self) -> Result<()> {
        match self.density > 0.0 && self.density <= 1.0 {
            true => Ok(()),
            false => Err(Error::parameter("density", self.density, "above 0, at most 1")),
        }
    }

    /// Most responses of a channel of so many cells: the density times the cells, rounded down, at least 1. The density is a
    /// decimal fraction that `f64` rounds, and so is the product: a product as near to a whole number as that is this number.
    pub fn most(self, cells: usize) -> usize {
        let product = self.density * cells as f64;
        let nearest = product.round();
        let is_whole = (product - nearest).abs() <= 2.0 * f64::EPSILON * nearest;
        let most = if is_whole { nearest } else { product.floor() };
        (most as usize).max(1)
    }

    /// Strength of a response.
    #[inline(always)]
    pub(super) fn strength<T: Scalar>(self, response: T) -> T {
        if self.attention == Attention::Magnitude { response.magnitude() } else { response }
    }

    /// The limit of the strongest so many entries (cell, value); if there are fewer, all are stronger. O(entries).
    pub(super) fn limit<'a, T: Scalar>(self, most: usize, entries: impl Iterator<Item = &'a (usize, T)>) -> Limit<T> {
        let mut strengths: Vec<T> = entries.map(|entry| self.strength(entry.1)).collect();
        if strengths.len() < most {
            return Limit { least: T::ZERO, equal: 0 };
        }
        let by_strength = |a: &T, b: &T| b.partial_cmp(a).unwrap_or(Ordering::Equal);
        let (before, &mut least, _) = strengths.select_nth_unstable_by(most - 1, by_strength);
        let stronger = before.iter().filter(|own| **own > least).count();
        Limit { least, equal: most - stronger }
    }

    /// Keeps the strongest of the entries (cell, value) of a channel, in their order; of equal ones the first.
    /// O(entries).
    pub fn apply<T: Scalar>(self, entries: &mut Vec<(usize, T)>, cells: usize) {
        if self.attention == Attention::Positive {
            entries.retain(|(_, value)| *value > T::ZERO);
        }
        let most = self.most(cells);
        if entries.len() <= most {
            return;
        }
        let mut limit = self.limit(most, entries.iter());
        entries.retain(|&(_, value)| limit.takes(self.strength(value)));
    }
}

/// Which entries are among the strongest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit<T> {
    /// Strength of the weakest of them.
    pub(super) least: T,
    /// How many of exactly this strength are among them.
    equal: usize,
}

impl<T: Scalar> Limit<T> {
    /// A strength just below all that are among the strongest.
    pub(super) fn below(&self) -> T {
        T::of(self.least.wide() * (1.0 - 1e-6))
    }

    /// Whether an entry of this strength is one of them; of equal ones the first are.
    #[inline(always)]
    pub(super) fn takes(&mut self, strength: T) -> bool {
        let as_weak = (strength == self.least) & (self.equal > 0);
        self.equal -= usize::from(as_weak);
        (strength > self.least) | as_weak
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn the_bound_of_a_channel_is_that_of_the_decimal_fraction() {
        // Whole numbers throughout: hundredths of the cells, rounded down.
        for hundredths in 1..=100usize {
            let selection = Selection { attention: Attention::Positive, density: hundredths as f64 / 100.0 };
            for cells in [1, 7, 100, 999, 16usize.pow(3), 128usize.pow(3), 10_000_000] {
                assert_eq!(selection.most(cells), (hundredths * cells / 100).max(1), "{hundredths} % of {cells}");
            }
        }
        let below = Selection { attention: Attention::Positive, density: 0.289_999_999 };
        assert_eq!(below.most(100), 28);
    }

    #[test]
    fn the_strongest_stay_in_their_order_and_staying_is_for_good() {
        let mut draws = stream(5, 0);
        for attention in [Attention::Positive, Attention::Magnitude] {
            for density in [0.001, 0.1, 0.5, 1.0] {
                let selection = Selection { attention, density };
                // Few different values, so that many are equal.
                let all: Vec<(usize, f64)> =
                    (0..400).map(|cell| (cell * 2, f64::from(draws.below(21) as u32) - 10.0)).collect();
                let mut kept = all.clone();
                selection.apply(&mut kept, 800);
                let strong = |v: f64| if attention == Attention::Positive { v } else { v.abs() };
                let offered = all.iter().filter(|e| attention == Attention::Magnitude || e.1 > 0.0);
                assert_eq!(kept.len(), selection.most(800).min(offered.clone().count()));
                assert!(kept.is_sorted_by_key(|entry| entry.0));
                let least = kept.iter().map(|e| strong(e.1)).fold(f64::INFINITY, f64::min);
                let last_of_least = kept.iter().filter(|e| strong(e.1) == least).map(|e| e.0).max().unwrap();
                for dropped in offered.filter(|e| !kept.contains(e)) {
                    let value = strong(dropped.1);
                    assert!(value < least || (value == least && dropped.0 > last_of_least));
                }
                let mut again = kept.clone();
                selection.apply(&mut again, 800);
                assert_eq!(again, kept);
            }
        }
        assert!(Selection { attention: Attention::Positive, density: 0.0 }.validate().is_err());
        assert_eq!(Selection { attention: Attention::Positive, density: 0.001 }.most(100), 1);
    }
}
