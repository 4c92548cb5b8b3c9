//! Multinomial logistic regression: soft-max of linear functions of the features.
//!
//! D. R. Cox, *The regression analysis of binary sequences*, JRSS B 1958, for several classes. The objective is that of
//! scikit-learn's `LogisticRegression`.

mod codec;
mod fit;
mod params;

pub use params::LinearParams;

use super::learner::{PartCount, Predictor, check_lengths};
use crate::error::Result;
use rayon::prelude::*;

/// Rows that one task takes.
const BLOCK: usize = 4096;

/// A trained soft-max classifier: the score of a class is a linear function of the features.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Number of classes.
    pub(crate) classes: usize,
    /// Features by classes, row-major.
    pub(crate) weights: Vec<f32>,
    /// One a class.
    pub(crate) bias: Vec<f32>,
    /// Means of the features in training, which missing values count as.
    pub(crate) means: Vec<f32>,
    /// Share of each feature in the spread of the scores.
    pub(crate) importance: Vec<f64>,
}

impl Predictor for Linear {
    type Scratch = ();

    fn classes(&self) -> usize {
        self.classes
    }

    fn width(&self) -> usize {
        self.importance.len()
    }

    fn parts(&self) -> Vec<PartCount> {
        vec![PartCount { kind: "weights", count: self.weights.len() + self.bias.len() }]
    }

    fn importance(&self) -> &[f64] {
        &self.importance
    }

    fn retain_used(self) -> (Self, Vec<usize>) {
        let row = |feature: usize| &self.weights[feature * self.classes..][..self.classes];
        let mut used: Vec<usize> = (0..self.width()).filter(|&f| row(f).iter().any(|&w| w != 0.0)).collect();
        if used.is_empty() {
            used.push(0);
        }
        let weights = used.iter().flat_map(|&f| row(f)).copied().collect();
        let importance = used.iter().map(|&f| self.importance[f]).collect();
        // What an unused feature adds is 0 for every value.
        let means = used.iter().map(|&f| self.means[f]).collect();
        (Self { weights, importance, means, ..self }, used)
    }

    fn predict_block(&self, rows: &[f32], _scratch: &mut (), out: &mut [f32]) -> Result<()> {
        check_lengths(self, rows, out)?;
        for (row, scores) in rows.chunks_exact(self.width()).zip(out.chunks_exact_mut(self.classes)) {
            scores.copy_from_slice(&self.bias);
            let values = row.iter().zip(&self.means).map(|(&value, &mean)| if value.is_nan() { mean } else { value });
            for (value, weights) in values.zip(self.weights.chunks_exact(self.classes)) {
                scores.iter_mut().zip(weights).for_each(|(s, &w)| *s += value * w);
            }
            let highest = scores.iter().copied().fold(f32::MIN, f32::max);
            scores.iter_mut().for_each(|s| *s = (*s - highest).exp());
            let sum: f32 = scores.iter().sum();
            scores.iter_mut().for_each(|s| *s /= sum);
        }
        Ok(())
    }

    fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
        check_lengths(self, rows, out)?;
        let parts = rows.par_chunks(BLOCK * self.width()).zip(out.par_chunks_mut(BLOCK * self.classes));
        parts.try_for_each(|(rows, out)| self.predict_block(rows, &mut (), out))
    }
}
