//! Scores of each class against all others (Hasanpour Zaryabi et al. 2022).

use super::Confusion;
use serde::Serialize;

/// Scores of one class against all others; a quotient with denominator 0 is 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OneVsRest {
    /// The class.
    pub code: u8,
    /// TP/(TP + FP) (Eq. 15).
    pub precision: f64,
    /// TP/(TP + FN). Eq. 12 prints TP/(TP + FP), which is the precision.
    pub sensitivity: f64,
    /// TN/(TN + FP) (Eq. 13).
    pub specificity: f64,
    /// (TP + TN)/all (Eq. 14).
    pub accuracy: f64,
}

impl Confusion {
    /// The scores of Hasanpour Zaryabi et al. 2022, section 4.2, one entry a class. O(classes).
    pub fn one_vs_rest(&self) -> Vec<OneVsRest> {
        let share = |part: u64, whole: u64| if whole > 0 { part as f64 / whole as f64 } else { 0.0 };
        let all = self.points();
        let row = |(i, class): (usize, &crate::classes::Class)| {
            let (right, support, predicted) = (self.count(i, i), self.support(i), self.predicted(i));
            let outside = all - (support + predicted - right);
            OneVsRest {
                code: class.code,
                precision: share(right, predicted),
                sensitivity: share(right, support),
                specificity: share(outside, all - support),
                accuracy: share(right + outside, all),
            }
        };
        self.classes().classes().iter().enumerate().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_of_a_worked_example() {
        let truth = [0, 0, 0, 0, 1, 1, 1, 2, 2, 2];
        let predicted = [0, 0, 1, 2, 1, 1, 0, 2, 2, 1];
        let rows = Confusion::from_labels(&truth, &predicted, &[]).unwrap().one_vs_rest();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        // Class 1: two correct, two false positives, one false negative, five true negatives.
        near(rows[1].precision, 0.5);
        near(rows[1].sensitivity, 2.0 / 3.0);
        near(rows[1].specificity, 5.0 / 7.0);
        near(rows[1].accuracy, 0.7);
        assert_eq!(rows.len(), 3);
    }

    #[test]
    fn they_agree_with_the_scores() {
        let truth = [0, 1, 1, 3, 3, 3, 0];
        let confusion = Confusion::from_labels(&truth, &[0, 1, 3, 3, 3, 2, 1], &[]).unwrap();
        for (row, scores) in confusion.one_vs_rest().iter().zip(confusion.scores().labels) {
            assert_eq!((row.code, row.precision, row.sensitivity), (scores.code, scores.precision, scores.recall));
        }
    }
}
