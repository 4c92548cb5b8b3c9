//! Report of the training.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use serde::Serialize;
use std::fmt::Write;

/// Report of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContoursReport {
    /// Points off and on contours.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Candidates on contours that were learned from.
    pub candidates_on: usize,
    /// Candidates off contours that were learned from.
    pub candidates_off: usize,
    /// Numbers of features that the classifiers of points use, in their order.
    pub used_features: Vec<usize>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

impl Report for ContoursReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn text(&self) -> String {
        let mut text = format!("{:>5}  {:<20} {:>12}\n\n", "", "unlabelled, skipped", self.unlabelled);
        let used: Vec<String> = self.used_features.iter().map(ToString::to_string).collect();
        let _ = writeln!(text, "{} features used", used.join(" and "));
        let _ = writeln!(text, "candidates: {} on contours, {} off them", self.candidates_on, self.candidates_off);
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
