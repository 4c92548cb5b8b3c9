//! Report of the training.

use crate::error::Result;
use crate::recipes::pyramid::PyramidReport;
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
    /// Number of features that the forest of points uses.
    pub used_features: usize,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

impl ContoursReport {
    /// `examples`: numbers of candidates off and on contours.
    pub(super) fn new(points: PyramidReport, [off, on]: [usize; 2], unlabelled: u64) -> Self {
        let PyramidReport { classes, used_features, warnings, .. } = points;
        Self { classes, unlabelled, candidates_on: on, candidates_off: off, used_features, warnings }
    }
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
        let _ = writeln!(text, "{} features used", self.used_features);
        let _ = writeln!(text, "candidates: {} on contours, {} off them", self.candidates_on, self.candidates_off);
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
