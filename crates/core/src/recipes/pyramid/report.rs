//! Report of the training.

use crate::error::Result;
use crate::evaluation::ClassScores;
use crate::recipes::system::report::{ClassCount, Report, SCORE_COLUMNS, json_of, score_row};
use crate::recipes::training::choice::ChoiceReport;
use serde::Serialize;
use std::fmt::Write;

/// Scores of one maximum depth, each the mean over the folds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthScore {
    /// The largest depth; `None` is unlimited.
    pub max_depth: Option<usize>,
    /// Mean accuracy, 0..1.
    pub accuracy: f64,
    /// Mean of the folds' mean F1, 0..1.
    pub mean_f1: f64,
    /// Scores of each class over the held-out samples of all folds.
    pub classes: Vec<ClassScores>,
}

/// Report of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PyramidReport {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Out-of-bag accuracy, 0..1, if bagging left samples out.
    pub out_of_bag_accuracy: Option<f64>,
    /// Edge of the finest voxel, metres.
    pub first_scale: f64,
    /// Number of features that occur in some tree.
    pub used_features: usize,
    /// Number of features available.
    pub features: usize,
    /// Folds of the cross-validation; 0 without.
    pub folds: usize,
    /// Edge of the squares that the folds consist of, metres; 0 without.
    pub block: f64,
    /// Scores of the cross-validation, one for each depth tried.
    pub depths: Vec<DepthScore>,
    /// The comparison of ways to regularise; `None` if the recipe names one.
    pub regularisation: Option<ChoiceReport>,
    /// Warnings for the user: classes that were left out or are rare.
    pub warnings: Vec<String>,
}

impl Report for PyramidReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn text(&self) -> String {
        let mut text = format!("{:>5}  {:<20} {:>12}\n\n", "", "unlabelled, skipped", self.unlabelled);
        for score in &self.depths {
            let depth = score.max_depth.map_or("unlimited".into(), |depth| depth.to_string());
            let _ = writeln!(
                text,
                "depth {depth}: {}-fold accuracy {:.2} %, mean F1 {:.2} % (folds of {} m squares)",
                self.folds,
                100.0 * score.accuracy,
                100.0 * score.mean_f1,
                self.block
            );
            for ClassScores { code, name, precision, recall, f1_score, .. } in &score.classes {
                let [precision, recall, f1] = [precision, recall, f1_score].map(|share| 100.0 * share);
                let _ = writeln!(
                    text,
                    "{code:>5}  {name:<20} precision {precision:>6.2}  recall {recall:>6.2}  F1 {f1:>6.2} %"
                );
            }
        }
        let _ = writeln!(
            text,
            "{} of {} features used, finest voxel {} m",
            self.used_features, self.features, self.first_scale
        );
        if let Some(score) = self.out_of_bag_accuracy {
            let _ = writeln!(
                text,
                "out-of-bag accuracy {:.2} % (neighbouring samples leak: expect less on a new scene)",
                100.0 * score
            );
        }
        if let Some(choice) = &self.regularisation {
            text.push_str(&choice.text());
        }
        text
    }

    fn csv(&self) -> Option<String> {
        let row = |score: &DepthScore| {
            let depth = score.max_depth.map_or(String::new(), |depth| depth.to_string());
            let of = |c: &ClassScores| score_row(&depth, c);
            score.classes.iter().map(of).collect::<String>()
        };
        let rows: String = self.depths.iter().map(row).collect();
        (!rows.is_empty()).then(|| format!("max_depth,{SCORE_COLUMNS}\n{rows}"))
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
