//! Report of the training.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use crate::recipes::training::choice::ChoiceReport;
use serde::Serialize;
use std::fmt::Write;

/// Report of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AutoContextReport {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Share of the samples that the forest of the other half of the checkerboard names right, 0..1.
    pub first_stage_accuracy: f64,
    /// Edge of the squares of the checkerboard, metres.
    pub square: f64,
    /// Number of features of the first stage.
    pub first_features: usize,
    /// Number of features that occur in some tree of the second stage.
    pub used_features: usize,
    /// The comparison of ways to regularise; `None` if the recipe names one.
    pub regularisation: Option<ChoiceReport>,
    /// Warnings for the user: classes that were left out or are rare.
    pub warnings: Vec<String>,
}

impl Report for AutoContextReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn text(&self) -> String {
        let mut text = format!("{:>5}  {:<20} {:>12}\n\n", "", "unlabelled, skipped", self.unlabelled);
        let _ = writeln!(
            text,
            "first stage: {} features, accuracy {:.2} % (each {} m square by the forest of the others)",
            self.first_features,
            100.0 * self.first_stage_accuracy,
            self.square
        );
        let _ = writeln!(text, "second stage: {} features used", self.used_features);
        if let Some(choice) = &self.regularisation {
            text.push_str(&choice.text());
        }
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
