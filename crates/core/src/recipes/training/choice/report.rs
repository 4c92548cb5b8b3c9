//! What the choice reports: a table of all candidates.

use crate::recipes::regularise::Regularise;
use serde::Serialize;
use std::fmt::Write;

/// Scores of one method and strength, over all held-out patches. Means are over the classes that occur.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateScore {
    /// The method.
    pub method: Regularise,
    /// Strength of the field; `None` for methods without one.
    pub strength: Option<f64>,
    /// Mean F1, 0..1.
    pub mean_f1: f64,
    /// Mean intersection over union, 0..1.
    pub mean_iou: f64,
    /// Mean F1 minus that without regularisation.
    pub gain: f64,
    /// Standard error of the gain in mean F1.
    pub standard_error: f64,
    /// Share of right points, 0..1.
    pub accuracy: f64,
    /// The accuracy minus that without regularisation.
    pub accuracy_gain: f64,
    /// Standard error of the gain in accuracy.
    pub accuracy_error: f64,
    /// Largest loss of mean F1 in one cloud or copy, less its standard errors; 0 if there is none.
    pub largest_loss: f64,
}

/// The methods that were compared, and the one that was chosen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChoiceReport {
    /// The chosen method.
    pub method: Regularise,
    /// Its strength; `None` for methods without one.
    pub strength: Option<f64>,
    /// Number of clouds and thinned copies.
    pub clouds: usize,
    /// Number of patches.
    pub patches: usize,
    /// Number of labelled points in them.
    pub points: u64,
    /// Every candidate; empty if none could be compared, because one colour of the checkerboard has fewer than two
    /// classes.
    pub candidates: Vec<CandidateScore>,
}

impl CandidateScore {
    /// A row of the table; gains with their standard errors.
    fn line(&self) -> String {
        let strength = self.strength.map(|s| s.to_string()).unwrap_or_default();
        let [f1, accuracy, iou, loss] =
            [self.mean_f1, self.accuracy, self.mean_iou, self.largest_loss].map(|v| format!("{:.2}", 100.0 * v));
        let [gain, accuracy_gain] = [[self.gain, self.standard_error], [self.accuracy_gain, self.accuracy_error]]
            .map(|[gain, error]| format!("{:+.2} ± {:.2}", 100.0 * gain, 100.0 * error));
        let name = self.method.name();
        format!("{name:<11} {strength:>8} {f1:>8} {gain:>14} {accuracy:>8} {accuracy_gain:>14} {iou:>8} {loss:>8}\n")
    }
}

impl ChoiceReport {
    /// A table, and what was chosen; lines end with a line feed.
    pub fn text(&self) -> String {
        if self.candidates.is_empty() {
            return "regularisation: none (too few labelled squares to compare methods)\n".into();
        }
        let mut text = format!(
            "\nregularisation, compared on {} labelled points in {} held-out patches of {} clouds and thinned copies, %\n\
             {:<11} {:>8} {:>8} {:>14} {:>8} {:>14} {:>8} {:>8}\n",
            self.points,
            self.patches,
            self.clouds,
            "method",
            "strength",
            "mean F1",
            "gain",
            "accuracy",
            "gain",
            "mean IoU",
            "max loss"
        );
        self.candidates.iter().for_each(|candidate| text.push_str(&candidate.line()));
        let strength = self.strength.map(|s| format!(", strength {s}")).unwrap_or_default();
        let _ = writeln!(text, "chosen: {}{strength}\n", self.method.name());
        text
    }
}
