//! Class shares: labels are picked class by class, but in a cloud some classes are much more frequent than others.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Adaptation of class probabilities to the class shares of the cloud.
///
/// The forest learns that classes are as frequent as their labels. In the cloud to classify, p_k is multiplied by (π_k
/// / τ_k)^power and normalised, where π_k is the share of points whose most probable class is k, and τ_k that of the
/// labels. With power 1 and the true shares this would be the exact change of priors (M. Saerens, P. Latinne, C.
/// Decaestecker, *Adjusting the outputs of a classifier to new a priori probabilities*, 2002, equation 2.4); as the
/// shares are only estimated, a smaller power is better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClassShares {
    /// Exponent, 0..=1; 0 leaves probabilities unchanged (the paper).
    pub power: f64,
    /// Set by training: share of each class in the labels, in the order of the classes.
    pub learned: Vec<f64>,
}

impl Default for ClassShares {
    fn default() -> Self {
        Self { power: 0.25, learned: Vec::new() }
    }
}

impl ClassShares {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.power) {
            return Err(Error::parameter("shares.power", self.power, "0 to 1"));
        }
        match self.learned.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
            Some(share) => Err(Error::parameter("shares.learned", share, "shares, above 0, up to 1")),
            None => Ok(()),
        }
    }

    /// Stores the shares of the labels; `labels` are positions of classes.
    pub(super) fn learn(&mut self, labels: &[u16], classes: usize) {
        let count = |class: usize| labels.iter().filter(|&&l| usize::from(l) == class).count().max(1);
        self.learned = (0..classes).map(|class| count(class) as f64 / labels.len().max(1) as f64).collect();
    }

    /// Adapts the probabilities of all points of a cloud (row-major) to the estimated shares.
    pub(super) fn apply(&self, values: &mut [f32], classes: usize) {
        if self.power <= 0.0 || self.learned.len() != classes {
            return;
        }
        let mut counts = vec![1u64; classes];
        for row in values.chunks_exact(classes) {
            let best = (1..classes).fold(0, |best, c| if row[c] > row[best] { c } else { best });
            counts[best] += 1;
        }
        let points = counts.iter().sum::<u64>() as f64;
        let factors: Vec<f32> = counts
            .iter()
            .zip(&self.learned)
            .map(|(&count, learned)| (count as f64 / points / learned).powf(self.power) as f32)
            .collect();
        for row in values.chunks_exact_mut(classes) {
            row.iter_mut().zip(&factors).for_each(|(p, factor)| *p *= factor);
            let sum: f32 = row.iter().sum();
            if sum > 0.0 {
                row.iter_mut().for_each(|p| *p /= sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rare_classes_lose_where_labels_are_even_and_nothing_changes_where_they_are_not() {
        let mut shares = ClassShares { power: 1.0, ..ClassShares::default() };
        shares.learn(&[0, 1], 2);
        // Nine points of class 0, one of class 1 that is nearly undecided.
        let rows: Vec<f32> = [[0.8, 0.2].repeat(9), vec![0.45, 0.55]].concat();
        let mut even = rows.clone();
        shares.apply(&mut even, 2);
        let odds = |row: &[f32]| row[0] / row[1];
        let change = (10.0f32 / 12.0) / (2.0 / 12.0);
        assert!((odds(&even[18..]) - change * odds(&rows[18..])).abs() < 1e-4);
        assert!(even.chunks_exact(2).all(|row| (row[0] + row[1] - 1.0).abs() < 1e-6));
        shares.learned = vec![10.0 / 12.0, 2.0 / 12.0];
        let mut natural = rows.clone();
        shares.apply(&mut natural, 2);
        assert!(natural.iter().zip(&rows).all(|(a, b)| (a - b).abs() < 1e-6));
        shares.power = 0.0;
        let mut off = rows.clone();
        shares.apply(&mut off, 2);
        assert_eq!(off, rows);
    }
}
