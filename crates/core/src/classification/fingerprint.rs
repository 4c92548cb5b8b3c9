//! Summary of the training data, by which a user can see whether a model fits other data.

use super::samples::Samples;
use rayon::prelude::*;

/// Summary of the training samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fingerprint {
    /// For every feature the quantiles at [`Fingerprint::LEVELS`] of its finite values, row-major `features x 5`; NaN
    /// if a feature has none.
    pub quantiles: Vec<f32>,
    /// Mean of the finite values of every feature, NaN if it has none.
    pub means: Vec<f64>,
    /// Point density, points per square metre.
    pub density: f64,
    /// Number of samples of every class.
    pub class_counts: Vec<u64>,
}

impl Fingerprint {
    /// Levels of the quantiles (nearest rank).
    pub const LEVELS: [f64; 5] = [0.0, 0.05, 0.5, 0.95, 1.0];

    /// Summarises the samples; `density` in points per square metre.
    pub fn of(samples: &Samples<'_>, density: f64) -> Self {
        let mut class_counts = vec![0; samples.classes];
        for &label in samples.labels {
            if let Some(count) = class_counts.get_mut(usize::from(label)) {
                *count += 1;
            }
        }
        let features = (0..samples.width.min(samples.features.len())).into_par_iter();
        let found: Vec<([f32; 5], f64)> =
            features.map(|f| summary(samples.features[f..].iter().step_by(samples.width))).collect();
        let quantiles = found.iter().flat_map(|(quantiles, _)| *quantiles).collect();
        let means = found.iter().map(|(_, mean)| *mean).collect();
        Self { quantiles, means, density, class_counts }
    }

    /// The summary of these features only, for a model without the others (see
    /// [`Predictor::retain_used`](super::Predictor::retain_used)).
    #[must_use]
    pub fn select(&self, features: &[usize]) -> Self {
        let levels = Self::LEVELS.len();
        Self {
            quantiles: features.iter().flat_map(|&f| &self.quantiles[f * levels..(f + 1) * levels]).copied().collect(),
            means: features.iter().map(|&f| self.means[f]).collect(),
            ..self.clone()
        }
    }
}

/// Quantiles and mean of the finite values.
fn summary<'a>(column: impl Iterator<Item = &'a f32>) -> ([f32; 5], f64) {
    let mut values: Vec<f32> = column.copied().filter(|v| v.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let last = values.len().saturating_sub(1) as f64;
    let quantile = |q: f64| values.get((q * last).round() as usize).copied().unwrap_or(f32::NAN);
    (Fingerprint::LEVELS.map(quantile), values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_means_and_counts_of_known_values() {
        let features: Vec<f32> = (0..101).flat_map(|i| [i as f32, f32::NAN]).collect();
        let labels: Vec<u16> = (0..101).map(|i| u16::from(i > 90)).collect();
        let samples = Samples { features: &features, width: 2, labels: &labels, weights: None, classes: 3 };
        let print = Fingerprint::of(&samples, 4.0);
        assert_eq!(print.quantiles[..5], [0.0, 5.0, 50.0, 95.0, 100.0]);
        assert!(print.quantiles[5..].iter().all(|q| q.is_nan()) && print.means[1].is_nan());
        assert!((print.means[0] - 50.0).abs() < 1e-12);
        assert_eq!(print.class_counts, [91, 10, 0]);
        assert_eq!(print.select(&[0]).quantiles, print.quantiles[..5]);
    }
}
