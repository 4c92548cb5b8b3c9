//! Class balancing: draws training samples so that no class dominates the others.

use crate::error::{Error, Result};
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// A class counts as rare only if another has at least this many times its samples; if all classes are small, none is
/// rare.
const RARE_BESIDE: usize = 100;

/// Treatment of classes that are too rare to be learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rare {
    /// The class is not part of the model.
    #[default]
    LeaveOut,
    /// The class is learned from its few samples.
    Keep,
}

/// Parameters of [`balance`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BalanceParams {
    /// No class keeps more than this multiple of the samples of the smallest class that is learned, 1 or more; infinite:
    /// classes keep all their samples, and none has a higher weight.
    pub max_ratio: f64,
    /// `max_ratio` reduces no class below this many samples.
    pub keep_samples: usize,
    /// A class is rare if it has fewer samples than this and than a hundredth of the largest class; 0: no class is
    /// rare.
    pub rare_below: usize,
    /// Treatment of rare classes.
    pub rare: Rare,
    /// Largest total number of samples, 1 or more; above it all classes are reduced by the same factor.
    pub max_samples: usize,
    /// Seed of the draw.
    pub seed: u64,
}

impl Default for BalanceParams {
    fn default() -> Self {
        Self {
            max_ratio: 4.0,
            keep_samples: 10_000,
            rare_below: 20,
            rare: Rare::LeaveOut,
            max_samples: 1_000_000,
            seed: 0,
        }
    }
}

impl BalanceParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if self.max_ratio.is_nan() || self.max_ratio < 1.0 {
            return Err(Error::parameter("max_ratio", self.max_ratio, "1 or more"));
        }
        match self.max_samples {
            0 => Err(Error::parameter("max_samples", 0, "1 or more")),
            _ => Ok(()),
        }
    }
}

/// The samples that [`balance`] has drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Balance {
    /// Indices of the drawn samples, ascending.
    pub chosen: Vec<u32>,
    /// Weight of a sample of each class: 1, or more if the class has fewer samples than `max_ratio` asks for; 0 if it
    /// has none.
    pub weights: Vec<f32>,
    /// Rare classes, ascending, whether they are left out or not.
    pub rare: Vec<u16>,
}

/// Draws the samples to train on (Hackel 2018, chapter 4.6.1, extended for rare classes), in O(n):
///
/// 1. classes that are too rare are left out, or kept, as [`Rare`] says;
/// 2. every other class keeps at most `max_ratio` times the samples of the smallest of them, but never fewer than
///    `keep_samples`, drawn without replacement, so that a small class does not shrink the others too far;
/// 3. all classes are reduced by one factor to `max_samples` in total, each to one sample at least;
/// 4. if a class still has fewer samples than the largest one divided by `max_ratio`, its weights make up for it.
///
/// # Errors
/// If a parameter is out of range or there are more than 2^32 labels.
pub fn balance(labels: &[u16], params: &BalanceParams) -> Result<Balance> {
    params.validate()?;
    if u32::try_from(labels.len()).is_err() {
        return Err(Error::input(format!("{} labels; at most 2^32 - 1 are possible", labels.len())));
    }
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); labels.iter().max().map_or(0, |&l| usize::from(l) + 1)];
    labels.iter().zip(0u32..).for_each(|(&label, i)| members[usize::from(label)].push(i));
    let rare = rare(&members, params.rare_below);
    if params.rare == Rare::LeaveOut {
        rare.iter().for_each(|&class| members[usize::from(class)].clear());
    }
    let sizes = capped(&members, params);
    Ok(Balance { chosen: draw(&members, &sizes, params), weights: weights(&sizes, params.max_ratio), rare })
}

/// Classes with too few samples compared with the largest.
fn rare(members: &[Vec<u32>], below: usize) -> Vec<u16> {
    let largest = members.iter().map(Vec::len).max().unwrap_or(0);
    let few = |n: usize| n > 0 && n < below && n < largest / RARE_BESIDE;
    (0..members.len()).filter(|&class| few(members[class].len())).map(|class| class as u16).collect()
}

/// Number of samples of each class after `max_ratio` and `keep_samples`.
fn capped(members: &[Vec<u32>], params: &BalanceParams) -> Vec<usize> {
    let smallest = members.iter().map(Vec::len).filter(|&n| n > 0).min().unwrap_or(0);
    let cap = ((params.max_ratio * smallest as f64) as usize).max(params.keep_samples);
    members.iter().map(|m| m.len().min(cap)).collect()
}

/// Draws this many samples of each class, reduced to `max_samples`.
fn draw(members: &[Vec<u32>], sizes: &[usize], params: &BalanceParams) -> Vec<u32> {
    let total: usize = sizes.iter().sum();
    let factor = (params.max_samples as f64 / total.max(1) as f64).min(1.0);
    let mut chosen = Vec::new();
    for (class, members) in members.iter().enumerate().filter(|(_, m)| !m.is_empty()) {
        let count = ((sizes[class] as f64 * factor) as usize).max(1);
        let picks = stream(params.seed, class as u64).choose(members.len(), count);
        chosen.extend(picks.into_iter().map(|p| members[p as usize]));
    }
    chosen.sort_unstable();
    chosen
}

/// Weights with which no class counts more than `max_ratio` times another.
fn weights(sizes: &[usize], max_ratio: f64) -> Vec<f32> {
    let largest = sizes.iter().copied().max().unwrap_or(0) as f64;
    let weight = |&n: &usize| if n == 0 { 0.0 } else { (largest / (max_ratio * n as f64)).max(1.0) as f32 };
    sizes.iter().map(weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parameters without a minimum and without rare classes.
    fn plain() -> BalanceParams {
        BalanceParams { keep_samples: 0, rare_below: 0, ..BalanceParams::default() }
    }

    fn found(labels: &[u16], params: &BalanceParams) -> Balance {
        let found = balance(labels, params).unwrap();
        assert!(found.chosen.windows(2).all(|w| w[0] < w[1]));
        assert_eq!(found, balance(labels, params).unwrap());
        found
    }

    fn counts(labels: &[u16], params: &BalanceParams) -> [usize; 3] {
        let mut counts = [0; 3];
        let chosen = found(labels, params).chosen;
        chosen.iter().for_each(|&i| counts[usize::from(labels[i as usize])] += 1);
        counts
    }

    #[test]
    fn large_classes_are_cut_to_the_ratio_and_the_total() {
        let labels: Vec<u16> = (0..1000).map(|i| if i < 10 { 2 } else { u16::from(i % 10 == 0) }).collect();
        assert_eq!(counts(&labels, &plain()), [40, 40, 10]);
        assert_eq!(found(&labels, &plain()).weights, [1.0; 3]);
        assert_eq!(counts(&labels, &BalanceParams { max_samples: 45, ..plain() }), [20, 20, 5]);
        assert_eq!(counts(&labels, &BalanceParams { max_samples: 1, ..plain() }), [1, 1, 1]);
        assert_eq!(counts(&[0, 2, 2], &plain()), [1, 0, 2]);
        assert_eq!(counts(&[], &plain()), [0, 0, 0]);
        for wrong in [0.5, -f64::INFINITY, f64::NAN] {
            assert!(balance(&[], &BalanceParams { max_ratio: wrong, ..plain() }).is_err(), "{wrong}");
        }
    }

    #[test]
    fn without_a_limit_all_samples_are_drawn_and_weigh_the_same() {
        let labels: Vec<u16> = (0..1000).map(|i| if i < 3 { 2 } else { 0 }).collect();
        let params = BalanceParams { max_ratio: f64::INFINITY, ..plain() };
        assert_eq!(counts(&labels, &params), [997, 0, 3]);
        // Class 1 has no samples.
        assert_eq!(found(&labels, &params).weights, [1.0, 0.0, 1.0]);
        assert_eq!(counts(&labels, &BalanceParams { max_samples: 500, ..params }), [498, 0, 1]);
    }

    #[test]
    fn a_rare_class_does_not_throttle_the_others() {
        // 12 samples of class 2 beside 100,000 and 30,000.
        let labels: Vec<u16> = (0..130_012).map(|i| u16::from(i >= 100_000) + u16::from(i >= 130_000)).collect();
        let params = BalanceParams { keep_samples: 6000, rare_below: 50, ..BalanceParams::default() };
        assert_eq!(counts(&labels, &params), [100_000, 30_000, 0]);
        assert_eq!(found(&labels, &params).rare, [2]);
        let kept = BalanceParams { rare: Rare::Keep, ..params.clone() };
        assert_eq!(counts(&labels, &kept), [6000, 6000, 12]);
        // 6000 / (4 * 12): the weight of 1500 samples, a quarter of the largest class.
        assert_eq!(found(&labels, &kept).weights, [1.0, 1.0, 125.0]);
        assert_eq!(counts(&labels, &BalanceParams { rare_below: 0, ..params }), [6000, 6000, 12]);
    }

    #[test]
    fn where_all_classes_have_few_samples_none_is_rare() {
        let picked: Vec<u16> = (0..45).map(|i| i / 15).collect();
        assert_eq!(counts(&picked, &BalanceParams::default()), [15, 15, 15]);
        assert_eq!(found(&picked, &BalanceParams::default()).rare, [0u16; 0]);
    }
}
