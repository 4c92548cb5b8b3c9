//! Report of the training.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use serde::Serialize;
use std::fmt::Write;

/// Report of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WeakReport {
    /// Per class, ascending by code: number of labelled points, and of those used for training.
    pub classes: Vec<ClassCount>,
    /// Points without a label.
    pub unlabelled: u64,
    /// Number of labelled road points (0: the lowest points were used instead).
    pub road_examples: usize,
    /// Partition strengths that were tried, with the oracle accuracy on the labels; the last one is used.
    pub partitions: Vec<StrengthScore>,
    /// Strengths of the random field that were tried, with their scores; empty if no search was requested.
    pub strengths: Vec<StrengthScore>,
    /// Strength that the model uses.
    pub strength: f64,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Score of a strength on labelled points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StrengthScore {
    /// σ or ρ.
    pub strength: f64,
    /// Share of the labels that were predicted correctly, 0..1.
    pub accuracy: f64,
}

impl Report for WeakReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn text(&self) -> String {
        let mut text = format!("{:>5}  {:<20} {:>12}\n", "", "unlabelled", self.unlabelled);
        for score in &self.partitions {
            let _ = writeln!(
                text,
                "segments of strength {:<8.4} could have {:.1} % of the labels right",
                score.strength,
                100.0 * score.accuracy
            );
        }
        for score in &self.strengths {
            let _ = writeln!(
                text,
                "strength {:<8} {:.2} % of the labels that were held out",
                score.strength,
                100.0 * score.accuracy
            );
        }
        let _ = writeln!(text, "strength of the field: {}", self.strength);
        text
    }

    fn csv(&self) -> Option<String> {
        let row = |score: &StrengthScore| format!("{},{:.6}\n", score.strength, score.accuracy);
        let rows: String = self.strengths.iter().map(row).collect();
        (!rows.is_empty()).then(|| format!("strength,accuracy\n{rows}"))
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
