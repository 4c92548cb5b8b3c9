//! The report of a training.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use crate::recipes::training::networks::{curve, curve_text};
use serde::Serialize;
use std::fmt::Write;

/// Report of the training of a network of windows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WindowsReport {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Edge of a finest cell, metres.
    pub voxel: f64,
    /// Number of values that were learned.
    pub parameters: usize,
    /// Mean number of occupied places of a window.
    pub occupied: f64,
    /// Loss of each step: mean cross-entropy of its points.
    pub losses: Vec<f64>,
    /// Warnings for the user: classes that were left out or are rare.
    pub warnings: Vec<String>,
}

impl WindowsReport {
    /// Mean loss of each tenth of the steps.
    pub fn curve(&self) -> Vec<f64> {
        curve(&self.losses)
    }
}

impl Report for WindowsReport {
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
            "finest cells of {:.3} m, {:.0} occupied in a window; {} parameters; {} steps",
            self.voxel,
            self.occupied,
            self.parameters,
            self.losses.len()
        );
        let _ = writeln!(text, "{}", curve_text(&self.losses));
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
