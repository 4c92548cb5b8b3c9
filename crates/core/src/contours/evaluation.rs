//! Comparison of contours with reference lines.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.6.2: because
//! contours leave out points that they do not need, what is missing within 3 cm of a true positive, or of what is
//! already counted as missing, does not count, so that gaps of more than 6 cm do. The text counts false alarms as false
//! negatives by mistake; here they are false positives.

use super::params::{above_zero, zero_or_more};
use super::polylines::{Polyline, distance};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::neighbours::nearest_of;
use crate::parallel::{Monitor, watched};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Parameters of [`score_points`] and [`score_lines`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScoreParams {
    /// Largest distance of matching lines, metres, 0 or more; not used for points.
    pub tolerance: f64,
    /// Distance from a true positive, and from a counted false negative, within which nothing counts as missing,
    /// metres.
    pub forgiven: f64,
    /// Distance of the samples of lines, metres, above 0.
    pub step: f64,
}

impl Default for ScoreParams {
    fn default() -> Self {
        Self { tolerance: 0.06, forgiven: 0.03, step: 0.01 }
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
    /// What is in the reference, was not found, and does not count.
    pub forgiven: usize,
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
    let apart = apart(&true_positives, &missed, monitor)?;
    let mut counted = Counted { size: params.forgiven, cells: HashMap::new() };
    let mut false_negatives = 0;
    for piece in watched(missed.len(), monitor) {
        for i in piece?.filter(|&i| apart[i] > params.forgiven) {
            false_negatives += usize::from(counted.add(missed.xyz(i)));
        }
    }
    let correct = true_positives.len();
    let false_positives = rows(true, false).len();
    let forgiven = missed.len() - false_negatives;
    Ok(LineScores { correct, false_positives, covered: correct, false_negatives, forgiven })
}

/// Compares lines by samples every `step` metres. A sample of a contour is correct if one of the reference is within
/// `tolerance`, and the other way round; of those of the reference that are not, the ones within `forgiven` of one that
/// is do not count. The samples are as dense everywhere, so that counted ones forgive no others. O(n log n) for n
/// samples.
///
/// # Errors
/// If a coordinate is not finite, the samples are too many, a parameter is outside its range, or the work was
/// cancelled.
pub fn score_lines(
    found: &[Polyline],
    reference: &[Polyline],
    params: &ScoreParams,
    monitor: &Monitor,
) -> Result<LineScores> {
    params.validate()?;
    let [found, reference] = [sampled(found, params.step)?, sampled(reference, params.step)?];
    let limit = params.tolerance * (1.0 + 1e-6);
    let correct = apart(&reference, &found, monitor)?.iter().filter(|&&d| d <= limit).count();
    let away = apart(&found, &reference, monitor)?;
    let rows = |near: bool| -> Vec<u32> {
        (0..).zip(&away).filter(|(_, d)| (**d <= limit) == near).map(|(row, _)| row).collect()
    };
    let covered = reference.select(&rows(true), monitor)?;
    let missed = reference.select(&rows(false), monitor)?;
    let counts = apart(&covered, &missed, monitor)?;
    let false_negatives = counts.iter().filter(|&&d| d > params.forgiven * (1.0 + 1e-6)).count();
    Ok(LineScores {
        correct,
        false_positives: found.len() - correct,
        covered: covered.len(),
        false_negatives,
        forgiven: missed.len() - false_negatives,
    })
}

/// Positions along lines, at most `step` metres apart: each segment is divided evenly, and every line begins with its
/// first vertex. O(length / step).
///
/// # Errors
/// If a coordinate is not finite, the step is not above 0, or there are 2^31 positions or more.
pub fn sampled(lines: &[Polyline], step: f64) -> Result<Positions> {
    above_zero("step", step)?;
    let mut samples = Positions::default();
    for line in lines {
        if let Some(vertex) = line.vertices.iter().find(|v| v.iter().any(|c| !c.is_finite())) {
            return Err(Error::input(format!("a vertex at {vertex:?} (allowed: finite numbers)")));
        }
        samples_of(&line.vertices, step, &mut samples)?;
    }
    Ok(samples)
}

fn samples_of(vertices: &[[f32; 3]], step: f64, samples: &mut Positions) -> Result<()> {
    let Some(&first) = vertices.first() else { return Ok(()) };
    samples.push(first);
    for w in vertices.windows(2) {
        let parts = (distance(w[0], w[1]) / step).ceil();
        if parts + samples.len() as f64 >= f64::from(i32::MAX) {
            return Err(Error::parameter("step", step, format!("a step with fewer than {} samples", i32::MAX)));
        }
        for part in 1..=parts as usize {
            let share = part as f64 / parts;
            samples.push([0, 1, 2].map(|i| (f64::from(w[0][i]) * (1.0 - share) + f64::from(w[1][i]) * share) as f32));
        }
    }
    Ok(())
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

/// Counted positions by cells of the size of the least distance.
struct Counted {
    size: f64,
    cells: HashMap<[i64; 3], Vec<[f32; 3]>>,
}

impl Counted {
    /// Counts a position unless one that is counted is within the least distance.
    fn add(&mut self, at: [f32; 3]) -> bool {
        if self.size <= 0.0 {
            return true;
        }
        let cell = at.map(|v| (f64::from(v) / self.size).floor() as i64);
        let near = |other: &[f32; 3]| distance(*other, at) <= self.size;
        for step in 0..27i64 {
            let [x, y, z] = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
            let place = [cell[0].saturating_add(x), cell[1].saturating_add(y), cell[2].saturating_add(z)];
            if self.cells.get(&place).is_some_and(|others| others.iter().any(near)) {
                return false;
            }
        }
        self.cells.entry(cell).or_default().push(at);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(vertices: &[[f32; 3]]) -> Polyline {
        Polyline { vertices: vertices.to_vec(), ..Polyline::default() }
    }

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
        // Points 5 to 7 are near point 4; 8, 12 and 16 count.
        let expected = LineScores { correct: 5, false_positives: 1, covered: 5, false_negatives: 3, forgiven: 12 };
        assert_eq!(scores, expected);
        assert_eq!((scores.precision(), scores.recall()), (Some(5.0 / 6.0), Some(5.0 / 8.0)));
        let strict = ScoreParams { forgiven: 0.0, ..params };
        assert_eq!(score_points(&marked, &strict, &Monitor::default()).unwrap().false_negatives, 15);
        assert!(score_points(&Marked { found: &[], ..marked }, &strict, &Monitor::default()).is_err());
    }

    #[test]
    fn lines_match_within_the_tolerance_and_only_wide_gaps_count() {
        let whole = [line(&[[0.0; 3], [1.0, 0.0, 0.0]])];
        let gap = |width: f32| {
            let half = width / 2.0;
            [line(&[[0.0, 0.0, 0.0], [0.5 - half, 0.0, 0.0]]), line(&[[0.5 + half, 0.0, 0.0], [1.0, 0.0, 0.0]])]
        };
        let params = ScoreParams { tolerance: 0.005, ..ScoreParams::default() };
        let score = |found: &[Polyline], reference: &[Polyline], params: &ScoreParams| {
            score_lines(found, reference, params, &Monitor::default()).unwrap()
        };
        assert_eq!(score(&gap(0.06), &whole, &params).recall(), Some(1.0));
        let wide = score(&gap(0.3), &whole, &params);
        assert!(wide.false_negatives > 20 && wide.false_negatives < 26 && wide.precision() == Some(1.0), "{wide:?}");
        let aside = [line(&[[0.0, 0.05, 0.0], [1.0, 0.05, 0.0]])];
        assert_eq!(score(&aside, &whole, &ScoreParams::default()).f1(), Some(1.0));
        assert_eq!(score(&aside, &whole, &params).f1(), Some(0.0));
    }

    #[test]
    fn samples_are_evenly_spaced() {
        let samples = sampled(&[line(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.25, 0.0]])], 0.3).unwrap();
        assert_eq!(samples.x, [0.0, 0.25, 0.5, 0.75, 1.0, 1.0]);
        assert!(sampled(&[line(&[[0.0; 3], [1e9, 0.0, 0.0]])], 1e-3).is_err());
        assert!(sampled(&[line(&[[f32::NAN; 3]])], 1e-3).is_err() && sampled(&[], 0.0).is_err());
    }

    #[test]
    fn nothing_has_no_scores() {
        let empty = score_lines(&[], &[], &ScoreParams::default(), &Monitor::default()).unwrap();
        assert_eq!((empty, empty.precision(), empty.recall(), empty.f1()), (LineScores::default(), None, None, None));
        let one = [line(&[[0.0; 3], [1.0, 0.0, 0.0]])];
        let missing = score_lines(&[], &one, &ScoreParams::default(), &Monitor::default()).unwrap();
        assert_eq!((missing.recall(), missing.precision(), missing.f1()), (Some(0.0), None, Some(0.0)));
    }
}
