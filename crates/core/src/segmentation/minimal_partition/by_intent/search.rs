//! Search for the strength: each trial shows whether its strength was too small or too large.

use crate::error::Result;
use crate::segmentation::Partition;

/// Factor from one strength to the next until one is too small and another too large.
const STEP: f64 = 4.0;
/// The search ends when these two strengths differ by less than this factor.
const NEAR: f64 = 1.1;
/// Factor by which the typical strength is divided for the very fine partition that the others are compared with.
const VERY_FINE: f64 = 16.0;

/// Condition that the strength must fulfil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// None: this strength is wanted.
    Strength(f64),
    /// A number of segments, accepted within the factor `close`.
    Segments {
        /// Number of segments wanted.
        count: f64,
        /// Tolerance as a factor, above 1.
        close: f64,
    },
    /// The smallest strength with at most this share of nodes in segments that are too small, 0..=1.
    SmallShare(f64),
    /// The largest strength whose oracle accuracy is at most this much below that of the finest trial.
    OracleLoss(f64),
}

/// The partition at one strength, with the measures that the search compares.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The segments.
    pub partition: Partition,
    /// Q at this strength.
    pub energy: f64,
    /// Share of the nodes that lie in segments that are too small, 0..=1; only where the search needs it.
    pub small_share: Option<f64>,
    /// Oracle accuracy, 0..=1, if labels are known.
    pub oracle_accuracy: Option<f64>,
}

/// A tested strength and its result.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Trial {
    /// ρ.
    pub strength: f64,
    /// Number of segments.
    pub segments: usize,
    /// Q at this strength.
    pub energy: f64,
    /// Share of the nodes that lie in segments that are too small; only where the search needs it.
    pub small_share: Option<f64>,
    /// Oracle accuracy, if labels are known.
    pub oracle_accuracy: Option<f64>,
}

/// The best trial, and all others.
#[derive(Clone, Debug, PartialEq)]
pub struct StrengthSearch {
    /// The strength that fulfils the aim best.
    pub strength: f64,
    /// Its segments.
    pub partition: Partition,
    /// All trials, by rising strength.
    pub trials: Vec<Trial>,
}

#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    TooFine,
    TooCoarse,
    Right,
}

/// Searches the strength that fulfils the aim, beginning at `typical` > 0, with at most `trials` (at least 1)
/// partitions: factors of 4 until one strength is too small and another too large, then bisection on the logarithm.
///
/// # Errors
/// Those of `solve`.
pub fn search_strength(
    aim: &Aim,
    trials: usize,
    typical: f64,
    mut solve: impl FnMut(f64) -> Result<Candidate>,
) -> Result<StrengthSearch> {
    let mut strength = match *aim {
        Aim::Strength(strength) => strength,
        Aim::OracleLoss(_) => typical / VERY_FINE,
        _ => typical,
    };
    let (mut fine, mut coarse) = (None, None);
    let (mut found, first) = {
        let candidate = solve(strength)?;
        let trial = trial(strength, &candidate);
        (StrengthSearch { strength, partition: candidate.partition, trials: vec![trial] }, trial)
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
                // For object sizes the finest acceptable partition is the best, for labels the coarsest.
                let go_coarser = acceptable == matches!(self, Self::OracleLoss(_));
                if go_coarser { Verdict::TooFine } else { Verdict::TooCoarse }
            }
        }
    }

    /// By how much a trial violates the condition; 0 or less is acceptable.
    fn shortfall(&self, trial: &Trial, finest: &Trial) -> f64 {
        let accuracy = |trial: &Trial| trial.oracle_accuracy.unwrap_or(0.0);
        match *self {
            Self::SmallShare(most) => trial.small_share.unwrap_or(0.0) - most,
            Self::OracleLoss(most) => accuracy(finest) - accuracy(trial) - most - 1e-12,
            _ => 0.0,
        }
    }

    /// The best trial minimises this: first the violation, then the distance from the ideal strength.
    fn loss(&self, trial: &Trial, finest: &Trial) -> (f64, f64) {
        match *self {
            Self::Segments { count, .. } => ((trial.segments.max(1) as f64 / count).ln().abs(), 0.0),
            Self::Strength(_) => (0.0, 0.0),
            Self::SmallShare(_) => (self.shortfall(trial, finest).max(0.0), trial.strength),
            Self::OracleLoss(_) => (self.shortfall(trial, finest).max(0.0), trial.segments as f64),
        }
    }
}
