//! Permutation importance: loss of accuracy when one feature is shuffled (Breiman 2001, section 10).

use super::Forest;
use crate::classification::learner::Predictor;
use crate::classification::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use crate::random::{Stream, stream};

/// Loss of accuracy caused by shuffling one feature, over the repeats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Importance {
    /// Mean loss; negative if shuffling improved the accuracy by chance.
    pub mean: f64,
    /// Standard deviation over the repeats (divided by their number).
    pub deviation: f64,
}

/// Parameters of [`permutation_importance`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PermutationParams {
    /// Number of shuffles of each feature, 1 or more. More: less random, in proportion slower.
    pub repeats: usize,
    /// Seed of the shuffles.
    pub seed: u64,
}

impl Default for PermutationParams {
    fn default() -> Self {
        Self { repeats: 5, seed: 0 }
    }
}

/// Permutation importance of every feature on these samples, which are best held out from training.
///
/// Sample weights count in the accuracy. O(features x repeats) predictions; features that occur in no split cost
/// nothing and get 0.
///
/// # Errors
/// If samples are inconsistent or do not fit the forest, `repeats` is 0, or the work was cancelled.
pub fn permutation_importance(
    forest: &Forest,
    samples: &Samples<'_>,
    params: PermutationParams,
    monitor: &Monitor,
) -> Result<Vec<Importance>> {
    let PermutationParams { repeats, seed } = params;
    samples.check()?;
    if samples.width != forest.width() || samples.classes != forest.classes() {
        return Err(Error::ModelMismatch(format!(
            "samples of {} features and {} classes, a forest of {} and {}",
            samples.width,
            samples.classes,
            forest.width(),
            forest.classes()
        )));
    }
    if repeats == 0 {
        return Err(Error::parameter("repeats", 0, "1 or more"));
    }
    let whole = accuracy(forest, samples, samples.features)?;
    let used = forest.used_features();
    monitor.stage("permutation importance", used.len() as u64);
    let losses = map_ordered(used.len(), monitor, |u| {
        let loss = |r: usize| {
            monitor.check()?;
            let index = (used[u] * repeats + r) as u64;
            Ok(whole - accuracy(forest, samples, &shuffled(samples, used[u], stream(seed, index)))?)
        };
        let losses = (0..repeats).map(loss).collect::<Result<Vec<f64>>>()?;
        monitor.advance(1);
        Ok(summary(&losses))
    })?;
    let mut all = vec![Importance::default(); forest.width()];
    used.iter().zip(losses).for_each(|(&f, importance)| all[f] = importance);
    Ok(all)
}

fn shuffled(samples: &Samples<'_>, feature: usize, mut random: Stream) -> Vec<f32> {
    let mut column: Vec<f32> = samples.features[feature..].iter().step_by(samples.width).copied().collect();
    random.shuffle(&mut column);
    let mut features = samples.features.to_vec();
    features[feature..].iter_mut().step_by(samples.width).zip(column).for_each(|(to, value)| *to = value);
    features
}

fn accuracy(forest: &Forest, samples: &Samples<'_>, features: &[f32]) -> Result<f64> {
    let named = forest.predict(features)?;
    let (mut right, mut total) = (0.0, 0.0);
    for (i, (a, b)) in named.iter().zip(samples.labels).enumerate() {
        total += samples.weight(i);
        right += if a == b { samples.weight(i) } else { 0.0 };
    }
    Ok(right / total)
}

fn summary(losses: &[f64]) -> Importance {
    let n = losses.len() as f64;
    let mean = losses.iter().sum::<f64>() / n;
    let variance = losses.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / n;
    Importance { mean, deviation: variance.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::ForestParams;
    use crate::classification::testing::blobs;

    #[test]
    fn only_features_that_tell_something_matter() {
        let mut data = blobs(1500, 3, 2, 0.0);
        data.labels = data.features.chunks(3).map(|row| u16::from(row[2] > 0.3)).collect();
        let forest = Forest::fit(&data.samples(), &ForestParams::default(), &Monitor::default()).unwrap();
        let importance = permutation_importance(
            &forest,
            &data.samples(),
            PermutationParams { repeats: 3, seed: 7 },
            &Monitor::default(),
        )
        .unwrap();
        assert!(importance[2].mean > 0.2 && importance[0].mean < 0.1 && importance[1].mean < 0.1, "{importance:?}");
        assert!(
            permutation_importance(
                &forest,
                &data.samples(),
                PermutationParams { repeats: 0, seed: 7 },
                &Monitor::default()
            )
            .is_err()
        );
    }
}
