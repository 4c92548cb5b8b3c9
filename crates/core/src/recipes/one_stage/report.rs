//! Report of the training.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use serde::Serialize;
use std::fmt::Write;

/// Report of the training of a method with one classifier.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OneStageReport {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Out-of-bag accuracy, 0..1, if bagging left samples out.
    pub out_of_bag_accuracy: Option<f64>,
    /// Number of features available.
    pub features: usize,
    /// Number of features that occur in some tree.
    pub used_features: usize,
    /// What was found in each cloud and thinned copy: parameters that are taken from it.
    pub found: Vec<String>,
    /// Warnings for the user: classes that were left out or are rare.
    pub warnings: Vec<String>,
}

impl Report for OneStageReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn text(&self) -> String {
        let mut text = format!("{:>5}  {:<20} {:>12}\n\n", "", "unlabelled, skipped", self.unlabelled);
        for (number, found) in (1..).zip(&self.found).filter(|(_, found)| !found.is_empty()) {
            let _ = writeln!(text, "cloud {number}: {found}");
        }
        let _ = writeln!(text, "{} of {} features used", self.used_features, self.features);
        if let Some(score) = self.out_of_bag_accuracy {
            let score = 100.0 * score;
            let _ = writeln!(
                text,
                "out-of-bag accuracy {score:.2} % (neighbouring samples leak: expect less on a new scene)"
            );
        }
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
