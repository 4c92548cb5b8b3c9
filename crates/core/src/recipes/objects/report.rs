//! Report of the training.

use crate::error::Result;
use crate::evaluation::Scores;
use crate::recipes::system::report::{ClassCount, Report, json_of};
use serde::Serialize;
use std::fmt::Write;

/// Report of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObjectsReport {
    /// Per class, ascending by code: number of labelled points, and of segments used for training.
    pub classes: Vec<ClassCount>,
    /// Points without a label.
    pub unlabelled: u64,
    /// Number of segments in all clouds.
    pub segments: usize,
    /// Number of segments with a majority label.
    pub labelled: usize,
    /// Number of segments used for training.
    pub learned: usize,
    /// Oracle accuracy, 0..1: the best accuracy that classifying whole segments can reach.
    pub oracle_accuracy: f64,
    /// Scores of the other segments, counted by segment; absent if all were used for training.
    pub by_segment: Option<Scores>,
    /// Scores of the points of these segments.
    pub by_point: Option<Scores>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

impl Report for ObjectsReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn unit(&self) -> &'static str {
        "segments"
    }

    fn text(&self) -> String {
        let mut text = format!(
            "\n{} segments, {} labelled, {} used for training; oracle accuracy {:.2} % (the best that classifying \
             whole segments can reach)\n",
            self.segments,
            self.labelled,
            self.learned,
            100.0 * self.oracle_accuracy
        );
        for (scores, what) in [(&self.by_segment, "segments"), (&self.by_point, "points")] {
            scores.iter().for_each(|scores| text += &self.held_out(scores, what));
        }
        text
    }

    fn json(&self) -> Result<String> {
        json_of(self)
    }
}

impl ObjectsReport {
    /// Scores of the segments (or points) that were not used for training.
    fn held_out(&self, scores: &Scores, what: &str) -> String {
        let mut text = format!(
            "\nthe other {} {what}: accuracy {:.2} %, mean F1 {:.2} %\n{:>5}  {:<20} {:>10} {:>10} {:>10} {:>10}\n",
            scores.points,
            100.0 * scores.overall_accuracy,
            100.0 * scores.mean_f1_score,
            "code",
            "class",
            "precision",
            "recall",
            "F1",
            what
        );
        for class in &scores.labels {
            let name = self.classes.iter().find(|c| c.code == class.code).map_or(&class.name, |c| &c.name);
            let [precision, recall, f1] =
                [class.precision, class.recall, class.f1_score].map(|v| format!("{:.2} %", 100.0 * v));
            let _ = writeln!(
                text,
                "{:>5}  {name:<20} {precision:>10} {recall:>10} {f1:>10} {:>10}",
                class.code, class.support
            );
        }
        text
    }
}
