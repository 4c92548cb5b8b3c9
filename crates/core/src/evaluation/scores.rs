//! Scores derived from a confusion matrix. An undefined score of a class is 0; an undefined mean, share or κ is NaN.

use super::Confusion;
use crate::error::{Error, Result};
use serde::Serialize;

/// Scores of one class.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassScores {
    /// Class code.
    pub code: u8,
    /// Class name.
    pub name: String,
    /// Share of the points predicted as this class that are correct.
    pub precision: f64,
    /// Share of the points of this class that are predicted correctly.
    pub recall: f64,
    /// Harmonic mean of precision and recall.
    pub f1_score: f64,
    /// Correct points / points that belong to the class or are predicted as it.
    pub intersection_over_union: f64,
    /// Number of points of this true class.
    pub support: u64,
    /// Number of points predicted as this class.
    pub predicted: u64,
}

/// Scores of a classification.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scores {
    /// Number of points compared.
    pub points: u64,
    /// Number of points without a true label.
    pub skipped: u64,
    /// Share of all points that are correct; NaN without a point, as all that follow.
    pub overall_accuracy: f64,
    /// Mean recall of the classes that occur in the truth.
    pub balanced_accuracy: f64,
    /// Unweighted mean over the classes of `mean_over`; NaN if there are none.
    pub mean_intersection_over_union: f64,
    /// Unweighted mean over the classes of `mean_over`; NaN if there are none.
    pub mean_f1_score: f64,
    /// Codes of the classes that the means run over: those that occur in the truth, unless others were asked for.
    pub mean_over: Vec<u8>,
    /// Mean F1 weighted by support.
    pub weighted_f1_score: f64,
    /// Cohen's κ: agreement beyond chance; NaN if all points have and get one class, where chance is 1 too.
    pub kappa: f64,
    /// One entry a class.
    pub labels: Vec<ClassScores>,
    /// Counts; row = truth, column = prediction, both in the order of `labels`.
    pub confusion_matrix: Vec<Vec<u64>>,
}

fn quotient(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// A quotient that has no value if there is nothing to divide by.
fn share(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { f64::NAN }
}

/// The error about an evaluation without a point that has a true label, with the number of points that have none.
pub fn no_point_to_score(unlabelled: u64) -> Error {
    Error::input(match unlabelled {
        0 => "no point to score: there is none in the truth".to_string(),
        1 => "no point to score: the only point of the truth is unlabelled, or its class is left out".to_string(),
        many => format!("no point to score: all {many} points of the truth are unlabelled, or their classes left out"),
    })
}

impl Confusion {
    /// Fails if there is no point to score.
    ///
    /// # Errors
    /// Names the cause.
    pub fn check_some(&self) -> Result<()> {
        if self.points() == 0 { Err(no_point_to_score(self.skipped())) } else { Ok(()) }
    }

    /// All scores. O(classes²).
    pub fn scores(&self) -> Scores {
        let n = self.classes().len();
        let labels: Vec<ClassScores> = (0..n).map(|i| self.class_scores(i)).collect();
        let points = self.points() as f64;
        let over: Vec<&ClassScores> =
            labels.iter().enumerate().filter(|(i, _)| self.is_in_means(*i)).map(|(_, l)| l).collect();
        let mean = |value: fn(&ClassScores) -> f64| share(over.iter().map(|l| value(l)).sum(), over.len() as f64);
        let weighted: f64 = labels.iter().map(|l| l.f1_score * l.support as f64).sum();
        let true_classes: Vec<f64> = labels.iter().filter(|l| l.support > 0).map(|l| l.recall).collect();
        let agreement = share((0..n).map(|i| self.count(i, i)).sum::<u64>() as f64, points);
        let chance: f64 =
            labels.iter().map(|l| quotient(l.support as f64, points) * quotient(l.predicted as f64, points)).sum();
        Scores {
            points: self.points(),
            skipped: self.skipped(),
            overall_accuracy: agreement,
            balanced_accuracy: share(true_classes.iter().sum(), true_classes.len() as f64),
            mean_intersection_over_union: mean(|l| l.intersection_over_union),
            mean_f1_score: mean(|l| l.f1_score),
            mean_over: over.iter().map(|l| l.code).collect(),
            weighted_f1_score: share(weighted, points),
            kappa: share(agreement - chance, 1.0 - chance),
            confusion_matrix: (0..n).map(|t| (0..n).map(|p| self.count(t, p)).collect()).collect(),
            labels,
        }
    }

    fn class_scores(&self, i: usize) -> ClassScores {
        let class = &self.classes().classes()[i];
        let (correct, support, predicted) = (self.count(i, i) as f64, self.support(i), self.predicted(i));
        ClassScores {
            code: class.code,
            name: class.name.clone(),
            precision: quotient(correct, predicted as f64),
            recall: quotient(correct, support as f64),
            f1_score: quotient(2.0 * correct, (support + predicted) as f64),
            intersection_over_union: quotient(correct, (support + predicted) as f64 - correct),
            support,
            predicted,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// scikit-learn 1.9 on the same labels: precision_recall_fscore_support, jaccard_score, cohen_kappa_score,
    /// balanced_accuracy_score.
    #[test]
    fn scores_of_a_worked_example() {
        let truth = [0, 0, 0, 0, 1, 1, 1, 2, 2, 2];
        let predicted = [0, 0, 1, 2, 1, 1, 0, 2, 2, 1];
        let s = Confusion::from_labels(&truth, &predicted, &[]).unwrap().scores();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(s.overall_accuracy, 0.6);
        near(s.labels[0].precision, 2.0 / 3.0);
        near(s.labels[0].recall, 0.5);
        near(s.labels[0].f1_score, 4.0 / 7.0);
        near(s.labels[1].intersection_over_union, 0.4);
        near(s.balanced_accuracy, (0.5 + 2.0 / 3.0 + 2.0 / 3.0) / 3.0);
        near(s.kappa, (0.6 - 0.33) / (1.0 - 0.33));
    }

    #[test]
    fn identities_hold_on_random_labels() {
        for seed in 0..50 {
            let mut random = stream(seed, 0);
            let truth: Vec<u8> = (0..300).map(|_| random.below(5) as u8).collect();
            let predicted: Vec<u8> =
                truth.iter().map(|&t| if random.below(3) == 0 { random.below(7) as u8 } else { t }).collect();
            let s = Confusion::from_labels(&truth, &predicted, &[]).unwrap().scores();
            let recall: f64 = s.labels.iter().map(|l| l.recall * l.support as f64).sum::<f64>() / s.points as f64;
            assert!((recall - s.overall_accuracy).abs() < 1e-12);
            for l in &s.labels {
                let iou = l.intersection_over_union;
                assert!((l.f1_score - 2.0 * iou / (1.0 + iou)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_class_that_only_the_prediction_has_is_shown_but_not_in_the_means() {
        let confusion = Confusion::from_labels(&[2, 2, 2, 6, 6], &[2, 2, 18, 6, 6], &[]).unwrap();
        let s = confusion.scores();
        assert_eq!((s.labels.len(), &s.mean_over[..]), (3, &[2, 6][..]));
        assert!((s.mean_intersection_over_union - (2.0 / 3.0 + 1.0) / 2.0).abs() < 1e-12);
        let fixed = confusion.with_means_over(&[2, 5, 6, 18]).scores();
        assert_eq!(fixed.mean_over, [2, 6, 18]);
        assert!((fixed.mean_intersection_over_union - (2.0 / 3.0 + 1.0) / 3.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_to_compare_has_no_scores() {
        let nothing = Confusion::from_labels(&[0, 0], &[2, 3], &[0]).unwrap();
        let s = nothing.scores();
        assert_eq!((s.points, s.skipped), (0, 2));
        let means = [s.mean_f1_score, s.mean_intersection_over_union, s.balanced_accuracy, s.weighted_f1_score];
        assert!([s.overall_accuracy, s.kappa].iter().chain(&means).all(|v| v.is_nan()), "{s:?}");
        let said = nothing.check_some().unwrap_err().to_string();
        assert!(said.contains("no point to score: all 2 points"), "{said}");
        let said = Confusion::from_labels(&[], &[], &[]).unwrap().check_some().unwrap_err().to_string();
        assert!(said.contains("there is none"), "{said}");
        assert!(Confusion::from_labels(&[2], &[6], &[]).unwrap().check_some().is_ok());
    }

    #[test]
    fn kappa_of_one_class_and_means_of_no_class_are_not_numbers() {
        // scikit-learn: cohen_kappa_score([2, 2], [2, 2]) is nan, of [2, 2], [2, 6] it is 0.
        let one = Confusion::from_labels(&[2, 2], &[2, 2], &[]).unwrap();
        assert!(one.scores().kappa.is_nan() && (one.scores().overall_accuracy - 1.0).abs() < 1e-12);
        assert_eq!(Confusion::from_labels(&[2, 2], &[2, 6], &[]).unwrap().scores().kappa, 0.0);
        let absent = one.with_means_over(&[9]).scores();
        assert!(absent.mean_intersection_over_union.is_nan() && absent.mean_f1_score.is_nan());
    }
}
