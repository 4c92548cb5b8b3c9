//! Comparison of contours with reference lines.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.6.2: because
//! contours leave out points that they do not need, a missing point does not count within 3 cm of a true positive or of
//! another missing point that has been counted. Only gaps of more than 6 cm therefore count. The text counts false
//! alarms as false negatives by mistake; here they are false positives. Beyond the source, a line of the reference
//! counts as found only where a found line passes beside it: the tolerance acts across the line, so that it does not
//! shorten gaps.
//!
//! By this rule a missing stretch counts once in 3 cm or more, but a found one at every sample, so that recall depends
//! on the samples' distance. [`LineScores::recall_by_length`] weighs both alike.

mod candidates;
mod lines;
mod missing;

pub use candidates::{MatchParams, PathMatch, match_candidates};
pub use lines::{ComparedLines, sampled, score_lines};

use super::params::{above_zero, zero_or_more};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Parameters of [`score_points`] and [`score_lines`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScoreParams {
    /// Largest distance of matching lines, metres, 0 or more; of the reference across its direction. Not used for points.
    pub tolerance: f64,
    /// Distance from a true positive, and from a counted false negative, within which nothing counts as missing,
    /// metres.
    pub forgiven: f64,
    /// Distance of the samples of lines, metres, above 0. The default is the thesis's distance of points along contours
    /// (187 points on 3.7 m).
    pub step: f64,
}

impl Default for ScoreParams {
    fn default() -> Self {
        Self { tolerance: 0.06, forgiven: 0.03, step: 0.02 }
    }
}

impl ScoreParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        zero_or_more("tolerance", self.tolerance)?;
        zero_or_more("forgiven", self.forgiven)?;
        above_zero("step", self.step)
    }
}

/// Numbers of points or samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineScores {
    /// What was found and is in the reference.
    pub correct: usize,
    /// What was found and is not in the reference.
    pub false_positives: usize,
    /// What is in the reference and was found.
    pub covered: usize,
    /// What is in the reference, was not found, and counts.
    pub false_negatives: usize,
    /// What is in the reference, was not found, and does not count because it is near to what was found.
    pub forgiven: usize,
    /// What is in the reference, was not found, and does not count because it is near to what counts as missing.
    pub repeated: usize,
    /// What was found along lines that are unsure, and does not count.
    pub unsure: usize,
}

impl LineScores {
    /// Share of what was found that is in the reference; none if nothing was found.
    pub fn precision(&self) -> Option<f64> {
        share(self.correct, self.false_positives)
    }

    /// Share of the reference that was found; none if nothing in the reference counts.
    pub fn recall(&self) -> Option<f64> {
        share(self.covered, self.false_negatives)
    }

    /// Share of the reference's length that was found: recall if what is near to a missing sample counts too.
    pub fn recall_by_length(&self) -> Option<f64> {
        share(self.covered, self.false_negatives + self.repeated)
    }

    /// Harmonic mean of precision and recall; none if there is neither contour nor reference, 0 if nothing fits.
    pub fn f1(&self) -> Option<f64> {
        let sum = |[p, r]: [f64; 2]| if p + r > 0.0 { 2.0 * p * r / (p + r) } else { 0.0 };
        match [self.precision(), self.recall()] {
            [None, None] => None,
            both => Some(sum(both.map(|value| value.unwrap_or(0.0)))),
        }
    }
}

fn share(good: usize, bad: usize) -> Option<f64> {
    (good + bad > 0).then(|| good as f64 / (good + bad) as f64)
}

/// Points that a method marked as contour, and those of the reference.
#[derive(Clone, Copy, Debug)]
pub struct Marked<'a> {
    /// All points, metres.
    pub positions: &'a Positions,
    /// Whether each point was found.
    pub found: &'a [bool],
    /// Whether each point is in the reference.
    pub reference: &'a [bool],
}

/// Compares points. False negatives are counted in the order of the points, unless a true positive or a counted one is
/// within `forgiven`. O(n log n).
///
/// # Errors
/// If lengths differ, a coordinate is not finite, a parameter is outside its range, or the work was cancelled.
pub fn score_points(points: &Marked<'_>, params: &ScoreParams, monitor: &Monitor) -> Result<LineScores> {
    params.validate()?;
    let Marked { positions, found, reference } = *points;
    if found.len() != positions.len() || reference.len() != positions.len() {
        let message = format!("{} and {} marks for {} points", found.len(), reference.len(), positions.len());
        return Err(Error::input(message));
    }
    let rows = |found_too: bool, in_reference: bool| -> Vec<u32> {
        let marks = (0..).zip(found.iter().zip(reference));
        marks.filter(|(_, (f, r))| **f == found_too && **r == in_reference).map(|(row, _)| row).collect()
    };
    let true_positives = positions.select(&rows(true, true), monitor)?;
    let missed = positions.select(&rows(false, true), monitor)?;
    let missing = missing::counted(&true_positives, &missed, params, monitor)?;
    let correct = true_positives.len();
    let false_positives = rows(true, false).len();
    Ok(LineScores { correct, false_positives, covered: correct, ..missing })
}

/// Distance of each query from its nearest point, infinite without points.
fn apart(points: &Positions, queries: &Positions, monitor: &Monitor) -> Result<Vec<f64>> {
    if points.is_empty() {
        return Ok(vec![f64::INFINITY; queries.len()]);
    }
    let near = nearest_of(points, queries, 1, monitor)?;
    let of = |i| near.squared_distances(i).first().map_or(f64::INFINITY, |&squared| f64::from(squared).sqrt());
    Ok((0..queries.len()).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_near_true_positives_and_near_counted_ones_are_forgiven() {
        // Points every centimetre; the first five are found, and one beside the line.
        let mut positions: Positions = (0..20).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
        positions.push([0.0, 1.0, 0.0]);
        let found: Vec<bool> = (0..21).map(|i| i < 5 || i == 20).collect();
        let reference: Vec<bool> = (0..21).map(|i| i < 20).collect();
        let params = ScoreParams { forgiven: 0.0301, ..ScoreParams::default() };
        let marked = Marked { positions: &positions, found: &found, reference: &reference };
        let scores = score_points(&marked, &params, &Monitor::default()).unwrap();
        // Points 5 to 7 are near point 4; 8, 12 and 16 count, and the three after each do not.
        let expected = LineScores {
            correct: 5,
            false_positives: 1,
            covered: 5,
            false_negatives: 3,
            forgiven: 3,
            repeated: 9,
            unsure: 0,
        };
        assert_eq!(scores, expected);
        assert_eq!((scores.precision(), scores.recall()), (Some(5.0 / 6.0), Some(5.0 / 8.0)));
        assert_eq!(scores.recall_by_length(), Some(5.0 / 17.0));
        let strict = ScoreParams { forgiven: 0.0, ..params };
        assert_eq!(score_points(&marked, &strict, &Monitor::default()).unwrap().false_negatives, 15);
        assert!(score_points(&Marked { found: &[], ..marked }, &strict, &Monitor::default()).is_err());
    }
}
