//! The report of the training of a network.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use serde::Serialize;
use std::fmt::Write;

/// The report of the training of a network of cells.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkReport {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Edge of a finest cell, metres.
    pub voxel: f64,
    /// Weight of the loss that compares two views of each part; 0: one view.
    pub consistency: f64,
    /// Number of values that were learned.
    pub parameters: usize,
    /// Mean number of occupied cells of what the network looks at in one go: a step's scenes, or a window.
    pub cells: f64,
    /// Loss of each step: cross-entropy of its points or cells.
    pub losses: Vec<f64>,
    /// Warnings for the user: classes that were left out or are rare.
    pub warnings: Vec<String>,
}

impl NetworkReport {
    /// Mean loss of each tenth of the steps.
    pub fn curve(&self) -> Vec<f64> {
        let part = self.losses.len().div_ceil(10).max(1);
        self.losses.chunks(part).map(|part| part.iter().sum::<f64>() / part.len() as f64).collect()
    }
}

impl Report for NetworkReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn text(&self) -> String {
        let Self { voxel, cells, parameters, losses, .. } = self;
        let mut text = format!("{:>5}  {:<20} {:>12}\n\n", "", "unlabelled, skipped", self.unlabelled);
        let steps = losses.len();
        let _ = writeln!(text, "cells of {voxel:.3} m, {cells:.0} at a time; {parameters} parameters; {steps} steps");
        if self.consistency > 0.0 {
            let _ = writeln!(
                text,
                "two views of each part are compared, with weight {} (learning.consistency)",
                self.consistency
            );
        }
        let curve: Vec<String> = self.curve().iter().map(|loss| format!("{loss:.3}")).collect();
        let _ = writeln!(text, "loss in each tenth of the steps: {}", curve.join(" "));
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}
