//! Choosing samples so that no class drowns the others.

use crate::error::{Error, Result};
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// Settings of [`balance`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BalanceParams {
    /// No class keeps more than this many times the samples of the smallest class, 1 or more.
    pub max_ratio: f64,
    /// Most samples in all, 1 or more; above it all classes are thinned by the same factor.
    pub max_samples: usize,
    /// Seed of the draw.
    pub seed: u64,
}

impl Default for BalanceParams {
    fn default() -> Self {
        Self { max_ratio: 4.0, max_samples: 1_000_000, seed: 0 }
    }
}

impl BalanceParams {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<()> {
        if !(self.max_ratio.is_finite() && self.max_ratio >= 1.0) {
            return Err(Error::parameter("max_ratio", self.max_ratio, "a number from 1 up"));
        }
        match self.max_samples {
            0 => Err(Error::parameter("max_samples", 0, "1 or more")),
            _ => Ok(()),
        }
    }
}

/// Indices of the samples to learn from, ascending: of every class at most `max_ratio` times the smallest present class,
/// drawn without replacement, then all classes thinned by one factor to `max_samples` (Hackel 2018, chapter 4.6.1). A
/// class that is present keeps at least one sample.
///
/// # Errors
/// A parameter out of range; more than 2^32 labels.
pub fn balance(labels: &[u16], params: &BalanceParams) -> Result<Vec<u32>> {
    params.validate()?;
    if u32::try_from(labels.len()).is_err() {
        return Err(Error::input(format!("{} labels; at most 2^32 - 1 are possible", labels.len())));
    }
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); labels.iter().max().map_or(0, |&l| usize::from(l) + 1)];
    labels.iter().zip(0u32..).for_each(|(&label, i)| members[usize::from(label)].push(i));
    let smallest = members.iter().map(Vec::len).filter(|&n| n > 0).min().unwrap_or(0);
    let cap = (params.max_ratio * smallest as f64) as usize;
    let total: usize = members.iter().map(|m| m.len().min(cap)).sum();
    let factor = (params.max_samples as f64 / total.max(1) as f64).min(1.0);
    let mut chosen = Vec::new();
    for (class, members) in members.iter().enumerate().filter(|(_, m)| !m.is_empty()) {
        let count = ((members.len().min(cap) as f64 * factor) as usize).max(1);
        let picks = stream(params.seed, class as u64).choose(members.len(), count);
        chosen.extend(picks.into_iter().map(|p| members[p as usize]));
    }
    chosen.sort_unstable();
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(labels: &[u16], params: &BalanceParams) -> [usize; 3] {
        let mut counts = [0; 3];
        let chosen = balance(labels, params).unwrap();
        assert!(chosen.windows(2).all(|w| w[0] < w[1]));
        assert_eq!(chosen, balance(labels, params).unwrap());
        chosen.iter().for_each(|&i| counts[usize::from(labels[i as usize])] += 1);
        counts
    }

    #[test]
    fn large_classes_are_cut_to_the_ratio_and_the_total() {
        let labels: Vec<u16> = (0..1000).map(|i| if i < 10 { 2 } else { u16::from(i % 10 == 0) }).collect();
        let params = BalanceParams::default();
        assert_eq!(counts(&labels, &params), [40, 40, 10]);
        assert_eq!(counts(&labels, &BalanceParams { max_samples: 45, ..params.clone() }), [20, 20, 5]);
        assert_eq!(counts(&labels, &BalanceParams { max_samples: 1, ..params.clone() }), [1, 1, 1]);
        assert_eq!(counts(&[0, 2, 2], &params), [1, 0, 2]);
        assert_eq!(counts(&[], &params), [0, 0, 0]);
        assert!(balance(&[], &BalanceParams { max_ratio: 0.5, ..params }).is_err());
    }
}
