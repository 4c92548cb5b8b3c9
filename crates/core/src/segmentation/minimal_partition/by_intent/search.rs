//! The search for the strength: every trial tells whether it was too fine or too coarse.

use crate::error::Result;
use crate::segmentation::Partition;

/// A step before both sides are known.
const STEP: f64 = 4.0;
/// The search ends when too fine and too coarse are closer than this.
const NEAR: f64 = 1.1;
/// The very fine partition that others are compared with has the typical strength divided by this.
const VERY_FINE: f64 = 16.0;

/// What a strength must bring about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// Nothing: this strength is wanted.
    Strength(f64),
    /// A number of segments, right within the factor `close`.
    Segments {
        /// Segments wanted.
        count: f64,
        /// Above 1.
        close: f64,
    },
    /// The smallest strength whose small share is at most this, 0..=1.
    SmallShare(f64),
    /// The largest strength whose oracle accuracy is at most so much below that of the finest trial.
    OracleLoss(f64),
}

/// The partition at one strength, with what the aim looks at.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The segments.
    pub partition: Partition,
    /// Q at this strength.
    pub energy: f64,
    /// Share of the nodes that lie in segments which are too small, 0..=1, if asked for.
    pub small_share: Option<f64>,
    /// Best accuracy of labels by segment, 0..=1, if labels are known.
    pub oracle_accuracy: Option<f64>,
}

/// One line of the table of what was tried.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Trial {
    /// ρ.
    pub strength: f64,
    /// Number of segments.
    pub segments: usize,
    /// Q at this strength.
    pub energy: f64,
    /// Share of the nodes that lie in segments which are too small, if asked for.
    pub small_share: Option<f64>,
    /// Best accuracy of labels by segment, if labels are known.
    pub oracle_accuracy: Option<f64>,
}

/// The best of the trials.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// The strength that serves the aim best.
    pub strength: f64,
    /// Its segments.
    pub partition: Partition,
    /// Everything that was tried, by rising strength.
    pub trials: Vec<Trial>,
}

#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    TooFine,
    TooCoarse,
    Right,
}

/// Tries strengths, beginning at `typical` > 0, until one serves the aim or `trials` (at least 1) are used up:
/// steps of 4 until one strength is too fine and another too coarse, then halves in logarithm.
///
/// # Errors
/// Those of `solve`.
pub fn search_strength(
    aim: &Aim,
    trials: usize,
    typical: f64,
    mut solve: impl FnMut(f64) -> Result<Candidate>,
) -> Result<Search> {
    let mut strength = match *aim {
        Aim::Strength(strength) => strength,
        Aim::OracleLoss(_) => typical / VERY_FINE,
        _ => typical,
    };
    let (mut fine, mut coarse) = (None, None);
    let (mut found, first) = {
        let candidate = solve(strength)?;
        let trial = trial(strength, &candidate);
        (Search { strength, partition: candidate.partition, trials: vec![trial] }, trial)
    };
    let mut least = aim.loss(&first, &first);
    let mut last = first;
    while found.trials.len() < trials {
        match aim.judge(&last, &first) {
            Verdict::Right => break,
            Verdict::TooFine => fine = Some(strength),
            Verdict::TooCoarse => coarse = Some(strength),
        }
        strength = match (fine, coarse) {
            (Some(low), Some(high)) if high / low < NEAR => break,
            (Some(low), Some(high)) => f64::sqrt(low * high),
            (Some(low), None) => low * STEP,
            (None, Some(high)) => high / STEP,
            (None, None) => break,
        };
        let candidate = solve(strength)?;
        last = trial(strength, &candidate);
        found.trials.push(last);
        let loss = aim.loss(&last, &first);
        if loss < least {
            (least, found.strength, found.partition) = (loss, strength, candidate.partition);
        }
    }
    found.trials.sort_by(|a, b| a.strength.total_cmp(&b.strength));
    Ok(found)
}

fn trial(strength: f64, candidate: &Candidate) -> Trial {
    let Candidate { ref partition, energy, small_share, oracle_accuracy } = *candidate;
    Trial { strength, segments: partition.len(), energy, small_share, oracle_accuracy }
}

impl Aim {
    fn judge(&self, trial: &Trial, finest: &Trial) -> Verdict {
        match *self {
            Self::Strength(_) => Verdict::Right,
            Self::Segments { count, close } => {
                let factor = trial.segments as f64 / count;
                if factor > close {
                    Verdict::TooFine
                } else if factor < 1.0 / close {
                    Verdict::TooCoarse
                } else {
                    Verdict::Right
                }
            }
            Self::SmallShare(_) | Self::OracleLoss(_) => {
                let acceptable = self.shortfall(trial, finest) <= 0.0;
                // The best acceptable partition is the finest one for objects, the coarsest one for labels.
                let go_coarser = acceptable == matches!(self, Self::OracleLoss(_));
                if go_coarser { Verdict::TooFine } else { Verdict::TooCoarse }
            }
        }
    }

    /// By how much a trial misses what it must keep; 0 or less is acceptable.
    fn shortfall(&self, trial: &Trial, finest: &Trial) -> f64 {
        let accuracy = |trial: &Trial| trial.oracle_accuracy.unwrap_or(0.0);
        match *self {
            Self::SmallShare(most) => trial.small_share.unwrap_or(0.0) - most,
            Self::OracleLoss(most) => accuracy(finest) - accuracy(trial) - most - 1e-12,
            _ => 0.0,
        }
    }

    /// What the best trial has least of: first the shortfall, then the distance from the best strength.
    fn loss(&self, trial: &Trial, finest: &Trial) -> (f64, f64) {
        match *self {
            Self::Segments { count, .. } => ((trial.segments.max(1) as f64 / count).ln().abs(), 0.0),
            Self::Strength(_) => (0.0, 0.0),
            Self::SmallShare(_) => (self.shortfall(trial, finest).max(0.0), trial.strength),
            Self::OracleLoss(_) => (self.shortfall(trial, finest).max(0.0), trial.segments as f64),
        }
    }
}
