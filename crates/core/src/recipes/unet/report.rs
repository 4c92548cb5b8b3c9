//! Report of the training.

use crate::error::Result;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use crate::recipes::training::networks::{curve, curve_text};
use serde::Serialize;
use std::fmt::Write;

/// Report of the training of a network.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UNetReport {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    pub classes: Vec<ClassCount>,
    /// Number of points skipped because they are unlabelled.
    pub unlabelled: u64,
    /// Edge of a cell, metres.
    pub voxel: f64,
    /// Number of values that were learned.
    pub parameters: usize,
    /// Mean number of cells of a step.
    pub cells: f64,
    /// Loss of each step: weighted cross-entropy of the labelled cells.
    pub losses: Vec<f64>,
    /// Warnings for the user: classes that were left out or are rare.
    pub warnings: Vec<String>,
}

impl UNetReport {
    /// Mean loss of each tenth of the steps.
    pub fn curve(&self) -> Vec<f64> {
        curve(&self.losses)
    }
}

impl Report for UNetReport {
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
            "cells of {:.3} m, {:.0} a step; {} parameters; {} steps",
            self.voxel,
            self.cells,
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
