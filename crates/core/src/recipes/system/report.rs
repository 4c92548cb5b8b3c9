//! Reports of training.

use crate::error::{Error, Result};
use crate::evaluation::ClassScores;
use crate::evaluation::report::csv_field;
use serde::Serialize;

/// What training of any recipe reports.
pub trait Report: Send {
    /// Each labelled class, ascending by code; those that were left out have no samples.
    fn classes(&self) -> &[ClassCount];

    /// Warnings for the user.
    fn warnings(&self) -> &[String];

    /// What the classifier has learned from: `samples` or `segments`.
    fn unit(&self) -> &'static str {
        "samples"
    }

    /// The rest of the report as text, below a table of the classes; lines end with a line feed.
    fn text(&self) -> String;

    /// The trials of the training as a CSV table; `None` if there were none.
    fn csv(&self) -> Option<String> {
        None
    }

    /// The whole report as JSON.
    ///
    /// # Errors
    /// Never for a report of training.
    fn json(&self) -> Result<String>;
}

/// The columns of [`score_row`] after the first one.
pub(in crate::recipes) const SCORE_COLUMNS: &str = "code,precision,recall,f1_score,class";

/// A row of a CSV table of scores of classes in a trial; shares are 0..1.
pub(in crate::recipes) fn score_row(trial: &str, scores: &ClassScores) -> String {
    let ClassScores { code, name, precision, recall, f1_score, .. } = scores;
    format!("{},{code},{precision:.6},{recall:.6},{f1_score:.6},{}\n", csv_field(trial), csv_field(name))
}

/// A report as JSON.
pub(in crate::recipes) fn json_of(report: &impl Serialize) -> Result<String> {
    serde_json::to_string_pretty(report).map_err(|e| Error::input(format!("report cannot be written: {e}")))
}

/// Number of points of a class, and of samples used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassCount {
    /// Class code.
    pub code: u8,
    /// Its name in the model.
    pub name: String,
    /// Number of labelled points in all clouds.
    pub points: u64,
    /// Number of samples used; 0: the class is not in the model, or was not learned.
    pub samples: u64,
    /// Weight of each sample: above 1 if the class has fewer than `training.max_ratio` asks for.
    pub weight: f64,
}

impl ClassCount {
    /// In messages: `class 2 ground`, or `class 66` if it has no other name.
    pub(in crate::recipes) fn title(&self) -> String {
        let plain = format!("class {}", self.code);
        if self.name == plain { plain } else { format!("{plain} {}", self.name) }
    }
}
