//! Soft-max, cross-entropy, and the difference between the probabilities of two views of the same points.

use super::BLOCK;
use crate::nn::scalar::Scalar;
use crate::parallel::fold_ordered;
use rayon::prelude::*;

/// A loss and its gradient with respect to the scores.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss<T> {
    /// The loss.
    pub value: f64,
    /// Its gradient, one row of classes a row of scores.
    pub gradient: Vec<T>,
}

/// Probabilities of each row of scores, in place.
pub fn softmax<T: Scalar>(scores: &mut [T], classes: usize) {
    scores.par_chunks_mut((BLOCK * classes).max(1)).for_each(|block| {
        block.chunks_exact_mut(classes.max(1)).for_each(|row| {
            let highest = row.iter().copied().fold(row[0], |a, b| if b > a { b } else { a });
            row.iter_mut().for_each(|v| *v = (*v - highest).exponential());
            let sum: T = row.iter().copied().sum();
            row.iter_mut().for_each(|v| *v = *v / sum);
        });
    });
}

/// Cross-entropy of rows of scores with weighted targets: Σ t (ln Σ exp(s) − s) / Σ t. A row of targets holds the weight of
/// each class, all 0 for a row without label; a label of a weighted class is one entry with the weight of the class.
pub fn cross_entropy<T: Scalar>(scores: &[T], targets: &[T], classes: usize) -> Loss<T> {
    let mut gradient = scores.to_vec();
    softmax(&mut gradient, classes);
    let rows = scores.len() / classes.max(1);
    let row = |values: &[T], row: usize| -> Vec<f64> {
        values[row * classes..][..classes].iter().map(|v| v.wide()).collect()
    };
    let part = |range: std::ops::Range<usize>| {
        range.fold([0.0, 0.0], |[loss, weight], i| {
            let targets = row(targets, i);
            let own: f64 = targets.iter().sum();
            if own == 0.0 {
                return [loss, weight];
            }
            let scores = row(scores, i);
            let highest = scores.iter().copied().fold(f64::MIN, f64::max);
            let log_sum = highest + scores.iter().map(|s| (s - highest).exp()).sum::<f64>().ln();
            let entropy: f64 = targets.iter().zip(&scores).map(|(t, s)| t * (log_sum - s)).sum();
            [loss + entropy, weight + own]
        })
    };
    let [loss, weight] = fold_ordered(rows, BLOCK, part, |[a, b], [c, d]| [a + c, b + d]).unwrap_or_default();
    let scale = T::of(if weight > 0.0 { 1.0 / weight } else { 0.0 });
    let size = (BLOCK * classes).max(1);
    gradient.par_chunks_mut(size).zip(targets.par_chunks(size)).for_each(|(gradient, targets)| {
        for (gradient, targets) in gradient.chunks_exact_mut(classes).zip(targets.chunks_exact(classes)) {
            let own: T = targets.iter().copied().sum();
            gradient.iter_mut().zip(targets).for_each(|(p, &t)| *p = (*p * own - t) * scale);
        }
    });
    Loss { value: if weight > 0.0 { loss / weight } else { 0.0 }, gradient }
}

/// Mean over pairs of rows of Σ (p − q)², where p and q are the probabilities that the two rows of scores stand for.
///
/// It asks two views of the same thing for the same answer, whatever it is, so that rows without a label are learned from too:
/// the Π-model of S. Laine, T. Aila, *Temporal ensembling for semi-supervised learning*, ICLR 2017.
pub fn disagreement<T: Scalar>(scores: &[T], pairs: &[[u32; 2]], classes: usize) -> Loss<T> {
    let mut probabilities = scores.to_vec();
    softmax(&mut probabilities, classes);
    let mut slopes = vec![0.0; scores.len()];
    let (mut value, share) = (0.0, if pairs.is_empty() { 0.0 } else { 1.0 / pairs.len() as f64 });
    for [a, b] in pairs.iter().map(|pair| pair.map(|row| row as usize * classes)) {
        for class in 0..classes {
            let difference = (probabilities[a + class] - probabilities[b + class]).wide();
            value += share * difference * difference;
            slopes[a + class] += 2.0 * share * difference;
            slopes[b + class] -= 2.0 * share * difference;
        }
    }
    // From the probabilities back to the scores.
    let mut gradient = Vec::with_capacity(scores.len());
    for (slopes, row) in slopes.chunks_exact(classes.max(1)).zip(probabilities.chunks_exact(classes.max(1))) {
        let mean: f64 = slopes.iter().zip(row).map(|(slope, p)| slope * p.wide()).sum();
        gradient.extend(slopes.iter().zip(row).map(|(slope, p)| T::of(p.wide() * (slope - mean))));
    }
    Loss { value, gradient }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};

    #[test]
    fn the_loss_of_known_scores_and_its_gradient() {
        // Equal scores: ln(classes), whatever the weights of the rows.
        let equal = cross_entropy(&[0.5; 6], &[1.0, 0.0, 0.0, 0.0, 4.0, 0.0], 3);
        assert!((equal.value - 3f64.ln()).abs() < 1e-12);
        let scores = numbers(1, 40 * 4);
        // Rows without label count for nothing.
        let targets: Vec<f64> = (0..160).map(|i| if i / 4 % 3 == 0 { 0.0 } else { f64::from(i % 5) }).collect();
        let found = cross_entropy(&scores, &targets, 4);
        let of = |scores: &[f64]| cross_entropy(scores, &targets, 4).value;
        assert!(relative_error(&found.gradient, &differences(&scores, 160, of)) < 1e-6);
        assert_eq!(found.gradient[..4], [0.0; 4]);
        assert_eq!(cross_entropy(&scores, &[0.0; 160], 4).value, 0.0);
    }

    #[test]
    fn the_disagreement_of_known_scores_and_its_gradient() {
        // Certain of different classes: (1, 0) and (0, 1).
        let apart = disagreement(&[30.0, -30.0, -30.0, 30.0], &[[0, 1]], 2);
        assert!((apart.value - 2.0).abs() < 1e-12);
        let same = disagreement(&[1.0, 2.0, 6.0, 7.0], &[[0, 1], [1, 1]], 2);
        assert!(same.value < 1e-24 && same.gradient.iter().all(|g: &f64| g.abs() < 1e-12));
        // A row may be in several pairs.
        let (scores, pairs) = (numbers(2, 9 * 4), [[0, 1], [2, 0], [5, 5], [7, 3], [3, 0]]);
        let found = disagreement(&scores, &pairs, 4);
        let of = |scores: &[f64]| disagreement(scores, &pairs, 4).value;
        assert!(relative_error(&found.gradient, &differences(&scores, 36, of)) < 1e-6);
        assert_eq!(disagreement::<f64>(&scores, &[], 4), Loss { value: 0.0, gradient: vec![0.0; 36] });
    }

    #[test]
    fn probabilities_sum_to_one_for_scores_of_any_size() {
        let mut scores = vec![1000.0f32, 0.0, -1000.0, 3.0, 3.0, 3.0];
        softmax(&mut scores, 3);
        assert_eq!(scores[..3], [1.0, 0.0, 0.0]);
        assert!(scores[3..].iter().all(|p| (p - 1.0 / 3.0).abs() < 1e-6));
    }
}
