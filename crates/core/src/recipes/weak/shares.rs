//! Class shares: labels are picked class by class, but in a cloud some classes are much more frequent than others.

use crate::classification::argmax;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Adaptation of class probabilities to the class shares of the cloud.
///
/// The forest assumes that classes are as frequent as their labels. In the cloud to classify, p_k is multiplied by (π_k
/// / τ_k)^power and normalised, where π_k is the share of points whose most probable class is k, and τ_k that of the
/// labels. With power 1 and the true shares this would be the exact change of priors (M. Saerens, P. Latinne, C.
/// Decaestecker, *Adjusting the outputs of a classifier to new a priori probabilities*, 2002, equation 2.4); as the
/// shares are only estimated, a smaller power is better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClassShares {
    /// Exponent, 0..=1; 0 leaves probabilities unchanged (the paper).
    pub power: f64,
}

impl Default for ClassShares {
    fn default() -> Self {
        Self { power: 0.25 }
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
        Ok(())
    }

    /// Adapts the probabilities of points (row-major) to the shares of the cloud, of which `counts` are the numbers of
    /// points by their most probable class; `learned` are the shares of the labels.
    pub(super) fn apply(&self, values: &mut [f32], counts: &[u64], learned: &[f64]) {
        let classes = learned.len();
        if self.power <= 0.0 || classes == 0 {
            return;
        }
        // Every class counts one point more, so that none becomes impossible.
        let points = counts.iter().map(|count| count + 1).sum::<u64>() as f64;
        let factors: Vec<f32> = counts
            .iter()
            .zip(learned)
            .map(|(&count, learned)| ((count + 1) as f64 / points / learned).powf(self.power) as f32)
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

/// Number of points whose most probable class is each of the classes; ties go to the first.
pub(super) fn most_probable(values: &[f32], classes: usize) -> Vec<u64> {
    let mut counts = vec![0u64; classes];
    for row in values.chunks_exact(classes.max(1)) {
        counts[argmax(row)] += 1;
    }
    counts
}

/// Share of each class among these labels (positions of classes); a class without a label counts as one label.
pub(super) fn shares_of(labels: &[u16], classes: usize) -> Vec<f64> {
    let count = |class: usize| labels.iter().filter(|&&l| usize::from(l) == class).count().max(1);
    (0..classes).map(|class| count(class) as f64 / labels.len().max(1) as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rare_classes_lose_where_labels_are_even_and_nothing_changes_where_they_are_not() {
        let shares = ClassShares { power: 1.0 };
        // Nine points of class 0, one of class 1 that is nearly undecided.
        let rows: Vec<f32> = [[0.8, 0.2].repeat(9), vec![0.45, 0.55]].concat();
        let mut even = rows.clone();
        let counts = most_probable(&rows, 2);
        assert_eq!(counts, [9, 1]);
        shares.apply(&mut even, &counts, &shares_of(&[0, 1], 2));
        let odds = |row: &[f32]| row[0] / row[1];
        let change = (10.0f32 / 12.0) / (2.0 / 12.0);
        assert!((odds(&even[18..]) - change * odds(&rows[18..])).abs() < 1e-4);
        assert!(even.chunks_exact(2).all(|row| (row[0] + row[1] - 1.0).abs() < 1e-6));
        let learned = [10.0 / 12.0, 2.0 / 12.0];
        let mut natural = rows.clone();
        shares.apply(&mut natural, &counts, &learned);
        assert!(natural.iter().zip(&rows).all(|(a, b)| (a - b).abs() < 1e-6));
        let mut off = rows.clone();
        ClassShares { power: 0.0 }.apply(&mut off, &counts, &learned);
        assert_eq!(off, rows);
    }
}
