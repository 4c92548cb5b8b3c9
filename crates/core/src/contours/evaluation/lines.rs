//! Scores of lines, by samples.

use super::super::params::above_zero;
use super::super::polylines::{Polyline, distance};
use super::{LineScores, ScoreParams, apart, missing};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::neighbours::within;
use crate::parallel::Monitor;

/// Lines to compare.
#[derive(Clone, Copy, Debug, Default)]
pub struct ComparedLines<'a> {
    /// The lines that a method found.
    pub found: &'a [Polyline],
    /// The lines that there are.
    pub reference: &'a [Polyline],
    /// Lines that a method may find or not, such as edges that are scanned too sparsely.
    pub unsure: &'a [Polyline],
}

/// Compares lines by samples every `step` metres. A sample of a contour is correct if one of the reference is within
/// `tolerance`; if not, but one of an unsure line is, it does not count. A sample of the reference is found if a contour
/// passes within `tolerance` across its direction; of the others, those count, in their order, that are not within
/// `forgiven` of a found one or of one that already counts. O(n log n) for n samples.
///
/// # Errors
/// If a coordinate is not finite, the samples are too many, a parameter is outside its range, or the work was
/// cancelled.
pub fn score_lines(lines: &ComparedLines<'_>, params: &ScoreParams, monitor: &Monitor) -> Result<LineScores> {
    params.validate()?;
    let found = sampled(lines.found, params.step)?;
    let unsure = sampled(lines.unsure, params.step)?;
    let reference = Samples::of(lines.reference, params.step)?;
    let limit = params.tolerance * (1.0 + 1e-6);
    let known = apart(&reference.places, &found, monitor)?;
    let open = apart(&unsure, &found, monitor)?;
    let correct = known.iter().filter(|&&d| d <= limit).count();
    let unsure = known.iter().zip(open).filter(|(known, open)| **known > limit && *open <= limit).count();
    let passed = reference.passed(&found, params, monitor)?;
    let rows = |near: bool| -> Vec<u32> {
        (0..).zip(&passed).filter(|(_, passed)| **passed == near).map(|(row, _)| row).collect()
    };
    let covered = reference.places.select(&rows(true), monitor)?;
    let missed = reference.places.select(&rows(false), monitor)?;
    let missing = missing::counted(&covered, &missed, params, monitor)?;
    let false_positives = found.len() - correct - unsure;
    Ok(LineScores { correct, false_positives, covered: covered.len(), unsure, ..missing })
}

/// Positions along lines with the direction of the line there.
#[derive(Clone, Debug, Default)]
pub(super) struct Samples {
    pub(super) places: Positions,
    /// Unit vectors; zeros where a line has no length.
    pub(super) along: Vec<[f32; 3]>,
}

impl Samples {
    /// As [`sampled`].
    pub(super) fn of(lines: &[Polyline], step: f64) -> Result<Self> {
        let mut samples = Self::default();
        for line in lines {
            for (number, pair) in line.vertices.windows(2).enumerate() {
                let piece = Polyline { vertices: pair.to_vec(), ..Polyline::default() };
                let places = sampled(std::slice::from_ref(&piece), step)?;
                let length = distance(pair[0], pair[1]);
                let along = [0, 1, 2].map(|i| ((f64::from(pair[1][i]) - f64::from(pair[0][i])) / length) as f32);
                // Every piece but the first begins where the one before it ends.
                for place in places.iter().skip(usize::from(number > 0)) {
                    samples.places.push(place);
                    samples.along.push(if length > 0.0 { along } else { [0.0; 3] });
                }
            }
        }
        Ok(samples)
    }

    /// Whether one of the found samples lies across each of these, within the tolerance.
    fn passed(&self, found: &Positions, params: &ScoreParams, monitor: &Monitor) -> Result<Vec<bool>> {
        let near = apart(found, &self.places, monitor)?;
        let limit = params.tolerance * (1.0 + 1e-6);
        let rows: Vec<u32> = (0..).zip(near).filter(|(_, d)| *d <= limit).map(|(row, _)| row).collect();
        let around = within(found, &self.places.select(&rows, monitor)?, limit.hypot(params.step), monitor)?;
        let mut passed = vec![false; self.places.len()];
        for (at, &row) in rows.iter().enumerate() {
            let (place, along) = (self.places.xyz(row as usize), self.along[row as usize]);
            let beside = |&other: &u32| {
                let way = found.xyz(other as usize);
                let way: [f64; 3] = std::array::from_fn(|i| f64::from(way[i]) - f64::from(place[i]));
                let ahead: f64 = way.iter().zip(along).map(|(w, a)| w * f64::from(a)).sum();
                let across = (way.iter().map(|w| w * w).sum::<f64>() - ahead * ahead).max(0.0).sqrt();
                ahead.abs() <= params.step * (1.0 + 1e-3) && across <= limit
            };
            passed[row as usize] = around.of(at).iter().any(beside);
        }
        Ok(passed)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contours::{Marked, score_points};

    fn line(vertices: &[[f32; 3]]) -> Polyline {
        Polyline { vertices: vertices.to_vec(), ..Polyline::default() }
    }

    #[test]
    fn lines_match_within_the_tolerance_and_only_wide_gaps_count() {
        let whole = [line(&[[0.0; 3], [1.0, 0.0, 0.0]])];
        let gap = |width: f32| {
            let half = width / 2.0;
            [line(&[[0.0, 0.0, 0.0], [0.5 - half, 0.0, 0.0]]), line(&[[0.5 + half, 0.0, 0.0], [1.0, 0.0, 0.0]])]
        };
        let params = ScoreParams { tolerance: 0.005, step: 0.01, ..ScoreParams::default() };
        let score = |found: &[Polyline], reference: &[Polyline], params: &ScoreParams| {
            let lines = ComparedLines { found, reference, unsure: &[] };
            score_lines(&lines, params, &Monitor::default()).unwrap()
        };
        assert_eq!(score(&gap(0.06), &whole, &params).recall(), Some(1.0));
        let wide = score(&gap(0.3), &whole, &params);
        // Of a gap of 30 cm, 24 cm are farther than 3 cm from what is found: one sample in 3 to 4 cm of these counts.
        assert!((6..=8).contains(&wide.false_negatives) && wide.precision() == Some(1.0), "{wide:?}");
        let missing = wide.false_negatives + wide.repeated;
        assert!((21..=25).contains(&missing), "{wide:?}");
        assert_eq!(wide.recall_by_length(), Some(wide.covered as f64 / (wide.covered + missing) as f64));
        // The tolerance does not shorten gaps: one of 12 cm counts, whatever the tolerance.
        let across = score(&gap(0.12), &whole, &ScoreParams { step: 0.01, ..ScoreParams::default() });
        assert!((1..=2).contains(&across.false_negatives), "{across:?}");
        let aside = [line(&[[0.0, 0.05, 0.0], [1.0, 0.05, 0.0]])];
        assert_eq!(score(&aside, &whole, &ScoreParams::default()).f1(), Some(1.0));
        assert_eq!(score(&aside, &whole, &params).f1(), Some(0.0));
    }

    /// Half of a line of 2 m is found: in points as in lines, every sample of the found half counts, and one in 4 cm of
    /// the others: with 51 found samples, the missing ones at 1.04, 1.08, ... 2.0 m.
    #[test]
    fn lines_count_missing_samples_as_points_do() {
        let half = [line(&[[0.0; 3], [1.0, 0.0, 0.0]])];
        let whole = [line(&[[0.0; 3], [2.0, 0.0, 0.0]])];
        let params = ScoreParams { tolerance: 0.001, ..ScoreParams::default() };
        let lines = ComparedLines { found: &half, reference: &whole, unsure: &[] };
        let by_lines = score_lines(&lines, &params, &Monitor::default()).unwrap();
        let positions = sampled(&whole, params.step).unwrap();
        let found: Vec<bool> = (0..positions.len()).map(|i| i <= 50).collect();
        let marked = Marked { positions: &positions, found: &found, reference: &vec![true; positions.len()] };
        let by_points = score_points(&marked, &params, &Monitor::default()).unwrap();
        assert_eq!(by_points.false_negatives, 25);
        // A line passes beside a sample up to one step beyond its end.
        assert!((51..=52).contains(&by_lines.covered) && (24..=25).contains(&by_lines.false_negatives), "{by_lines:?}");
        assert!((by_points.recall().unwrap() - 51.0 / 76.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_found_along_unsure_lines_does_not_count() {
        let beside = |y: f32| line(&[[0.0, y, 0.0], [1.0, y, 0.0]]);
        let lines = ComparedLines {
            found: &[beside(0.0), beside(1.0), beside(2.0)],
            reference: &[beside(0.01)],
            unsure: &[beside(1.01)],
        };
        let found = score_lines(&lines, &ScoreParams::default(), &Monitor::default()).unwrap();
        assert_eq!([found.correct, found.unsure, found.false_positives, found.false_negatives], [51, 51, 51, 0]);
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
        let score = |reference: &[Polyline]| {
            let lines = ComparedLines { reference, ..ComparedLines::default() };
            score_lines(&lines, &ScoreParams::default(), &Monitor::default()).unwrap()
        };
        let empty = score(&[]);
        assert_eq!((empty, empty.precision(), empty.recall(), empty.f1()), (LineScores::default(), None, None, None));
        let one = [line(&[[0.0; 3], [1.0, 0.0, 0.0]])];
        let missing = score(&one);
        assert_eq!((missing.recall(), missing.precision(), missing.f1()), (Some(0.0), None, Some(0.0)));
    }
}
