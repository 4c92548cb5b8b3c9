//! Cross-validation: trains on all folds but one and evaluates on that one.

use super::classifier::ClassifierParams;
use super::learner::Predictor;
use super::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::random::stream;

/// Scores of one held-out fold.
#[derive(Clone, Debug, PartialEq)]
pub struct FoldScore {
    /// The fold.
    pub fold: u32,
    /// Share of correctly classified samples, 0..=1.
    pub accuracy: f64,
    /// Mean F1 over the classes that occur in the fold's labels or in its predictions, 0..=1.
    pub mean_f1: f64,
    /// Row-major `classes x classes` counts: row is the true class, column the predicted one.
    pub confusion: Vec<u64>,
}

/// Mean scores of one parameter set over the folds.
#[derive(Clone, Debug, PartialEq)]
pub struct GridScore {
    /// Position of the parameter set in the grid.
    pub index: usize,
    /// Mean accuracy of the folds.
    pub accuracy: f64,
    /// Mean of the folds' mean F1.
    pub mean_f1: f64,
    /// The folds, ascending.
    pub folds: Vec<FoldScore>,
}

/// Assigns every sample a random fold `0..folds` so that each class is spread evenly. O(n log n).
///
/// # Errors
/// If there are fewer than 2 folds.
pub fn stratified_folds(labels: &[u16], folds: usize, seed: u64) -> Result<Vec<u32>> {
    if !(2..=65_535).contains(&folds) {
        return Err(Error::parameter("folds", folds, "2 to 65535"));
    }
    let mut order: Vec<u32> = (0..labels.len() as u32).collect();
    stream(seed, 0).shuffle(&mut order);
    order.sort_by_key(|&i| labels[i as usize]);
    let mut fold = vec![0; labels.len()];
    order.iter().enumerate().for_each(|(rank, &i)| fold[i as usize] = (rank % folds) as u32);
    Ok(fold)
}

/// Assigns whole groups (spatial blocks, scans) to folds `0..folds`: large groups first, each to the smallest fold, so
/// that no group is in both training and evaluation. O(n log g + g · folds) for g groups.
///
/// # Errors
/// If there are fewer than 2 folds, or fewer groups than folds.
pub fn grouped_folds(groups: &[u32], folds: usize) -> Result<Vec<u32>> {
    let mut sizes = std::collections::BTreeMap::<u32, usize>::new();
    groups.iter().for_each(|&g| *sizes.entry(g).or_default() += 1);
    if folds < 2 || folds > sizes.len() {
        return Err(Error::parameter("folds", folds, format!("2 to the number of groups, {}", sizes.len())));
    }
    let mut ranked: Vec<(u32, usize)> = sizes.iter().map(|(&g, &n)| (g, n)).collect();
    ranked.sort_by_key(|&(g, n)| (std::cmp::Reverse(n), g));
    let mut filled = vec![0usize; folds];
    let mut fold_of = std::collections::BTreeMap::new();
    for (group, size) in ranked {
        let smallest = (1..folds).fold(0, |best, f| if filled[f] < filled[best] { f } else { best });
        filled[smallest] += size;
        fold_of.insert(group, smallest as u32);
    }
    Ok(groups.iter().map(|g| fold_of[g]).collect())
}

/// Scores of every fold: `folds[i]` is the fold of sample `i` (any numbers, at least two different ones). Samples of
/// weight 0 are ignored. Trains once per fold.
///
/// # Errors
/// If lengths do not fit or there are fewer than two folds, and as [`ClassifierParams::train`].
pub fn cross_validate(
    samples: &Samples<'_>,
    params: &ClassifierParams,
    folds: &[u32],
    monitor: &Monitor,
) -> Result<Vec<FoldScore>> {
    samples.check()?;
    if folds.len() != samples.len() {
        return Err(Error::input(format!("{} folds for {} samples", folds.len(), samples.len())));
    }
    let present: std::collections::BTreeSet<u32> =
        (0..folds.len()).filter(|&i| samples.weight(i) > 0.0).map(|i| folds[i]).collect();
    if present.len() < 2 {
        return Err(Error::input("cross-validation needs samples in at least two folds"));
    }
    let held_out = HeldOut { samples, params, folds, monitor };
    present.into_iter().map(|fold| held_out.score(fold)).collect()
}

/// Cross-validates every parameter set of a grid on the same folds; returns scores in the order of the grid.
/// Trains once per fold and parameter set.
///
/// # Errors
/// As [`cross_validate`].
pub fn grid_search(
    samples: &Samples<'_>,
    grid: &[ClassifierParams],
    folds: &[u32],
    monitor: &Monitor,
) -> Result<Vec<GridScore>> {
    let score = |(index, params)| {
        let folds = cross_validate(samples, params, folds, monitor)?;
        let mean = |of: fn(&FoldScore) -> f64| folds.iter().map(of).sum::<f64>() / folds.len() as f64;
        Ok(GridScore { index, accuracy: mean(|f| f.accuracy), mean_f1: mean(|f| f.mean_f1), folds })
    };
    grid.iter().enumerate().map(score).collect()
}

/// Samples and their folds, of which one is held out at a time.
struct HeldOut<'a> {
    samples: &'a Samples<'a>,
    params: &'a ClassifierParams,
    /// Fold of every sample.
    folds: &'a [u32],
    monitor: &'a Monitor,
}

impl HeldOut<'_> {
    /// Trains without one fold (its weights are 0) and evaluates on it.
    fn score(&self, fold: u32) -> Result<FoldScore> {
        let Self { samples, params, folds, monitor } = *self;
        let weight = |i: usize| if folds[i] == fold { 0.0 } else { samples.weight(i) as f32 };
        let weights: Vec<f32> = (0..samples.len()).map(weight).collect();
        let classifier = params.train(&Samples { weights: Some(&weights), ..*samples }, monitor)?;
        let held: Vec<usize> = (0..samples.len()).filter(|&i| folds[i] == fold && samples.weight(i) > 0.0).collect();
        let rows: Vec<f32> = held.iter().flat_map(|&i| samples.row(i)).copied().collect();
        let mut confusion = vec![0u64; samples.classes * samples.classes];
        for (&i, named) in held.iter().zip(classifier.predict(&rows)?) {
            confusion[usize::from(samples.labels[i]) * samples.classes + usize::from(named)] += 1;
        }
        let (accuracy, mean_f1) = scores(&confusion, samples.classes);
        Ok(FoldScore { fold, accuracy, mean_f1, confusion })
    }
}

fn scores(confusion: &[u64], classes: usize) -> (f64, f64) {
    let total: u64 = confusion.iter().sum();
    let right = |c: usize| confusion[c * classes + c];
    let f1 = |c: usize| {
        let truth: u64 = confusion[c * classes..(c + 1) * classes].iter().sum();
        let named: u64 = confusion.iter().skip(c).step_by(classes).sum();
        (truth + named > 0).then(|| 2.0 * right(c) as f64 / (truth + named) as f64)
    };
    let all: Vec<f64> = (0..classes).filter_map(f1).collect();
    let hits: u64 = (0..classes).map(right).sum();
    (hits as f64 / total.max(1) as f64, all.iter().sum::<f64>() / all.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::super::ForestParams;
    use super::super::testing::blobs;
    use super::*;

    #[test]
    fn stratified_folds_spread_every_class() {
        let labels: Vec<u16> = (0..103).map(|i| u16::from(i % 10 == 0)).collect();
        let folds = stratified_folds(&labels, 5, 1).unwrap();
        for class in 0..2 {
            let count = |f| (0..103).filter(|&i| folds[i] == f && labels[i] == class).count();
            let sizes: Vec<usize> = (0..5).map(count).collect();
            assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1, "{sizes:?}");
        }
        assert!(stratified_folds(&labels, 1, 0).is_err());
    }

    #[test]
    fn groups_stay_together_and_folds_are_even() {
        let groups: Vec<u32> = (0..100).map(|i| i / 7).collect();
        let folds = grouped_folds(&groups, 3).unwrap();
        assert!((1..100).all(|i| groups[i] != groups[i - 1] || folds[i] == folds[i - 1]));
        assert!((0..3).all(|f| (28..=36).contains(&folds.iter().filter(|&&g| g == f).count())));
        assert!(grouped_folds(&[1, 1, 1], 2).is_err());
    }

    #[test]
    fn scores_follow_their_definitions() {
        let (accuracy, f1) = scores(&[3, 1, 0, 2, 4, 0, 0, 0, 0], 3);
        assert!((accuracy - 0.7).abs() < 1e-12);
        assert!((f1 - 0.5 * (6.0 / 9.0 + 8.0 / 11.0)).abs() < 1e-12);
    }

    #[test]
    fn a_grid_prefers_the_deeper_forest_and_ignores_absent_samples() {
        let data = blobs(1200, 6, 4, 0.0);
        let folds = stratified_folds(&data.labels, 3, 0).unwrap();
        let with = |depth| {
            let params = ForestParams { trees: 8, max_depth: Some(depth), ..ForestParams::default() };
            ClassifierParams::Forest(params)
        };
        let scores = grid_search(&data.samples(), &[with(1), with(12)], &folds, &Monitor::default()).unwrap();
        assert!(scores[1].accuracy > scores[0].accuracy + 0.05, "{scores:?}");
        assert_eq!(scores[0].folds.iter().flat_map(|f| &f.confusion).sum::<u64>(), 1200);
        assert!(cross_validate(&data.samples(), &with(1), &vec![0; 1200], &Monitor::default()).is_err());
        assert!(cross_validate(&data.samples(), &with(1), &[0, 1], &Monitor::default()).is_err());
    }
}
