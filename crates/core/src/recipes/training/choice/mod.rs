//! The choice of a method of regularisation by cross-validation on spatial blocks.
//!
//! Training squares are coloured like a checkerboard, and one classifier learns from each colour. Patches of every cloud
//! and of its thinned copies are classified by the classifier of the other colour, then regularised by every candidate.
//! `docs/regularisation.md` has the rule by which one of them is chosen.

mod cross_training;
mod patches;
mod report;
mod trial;
mod verdict;

pub(in crate::recipes) use cross_training::CrossTraining;
pub(in crate::recipes) use patches::Labelled;
pub use report::{CandidateScore, ChoiceReport};
pub(in crate::recipes) use trial::{NeededPoints, Trial};

use crate::classification::{Classifier, Samples};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::regularise::{Probabilities, Regularise, RegulariseParams};
use verdict::Outcomes;

/// A method and its strength.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    method: Regularise,
    /// `None` for methods without one.
    strength: Option<f64>,
}

/// Everything to compare; none comes first.
fn candidates(params: &RegulariseParams) -> Vec<Candidate> {
    let field = |method| params.choice.strengths.iter().map(move |&s| Candidate { method, strength: Some(s) });
    let plain = [Regularise::None, Regularise::Local].map(|method| Candidate { method, strength: None });
    plain.into_iter().chain(field(Regularise::PointCrf)).chain(field(Regularise::SegmentCrf)).collect()
}

/// Compares all candidates on the trials, and chooses one.
///
/// # Errors
/// Those of the training, or if the work was cancelled.
pub(in crate::recipes) fn choose<L>(
    trials: &[Trial],
    training: &CrossTraining<'_, L>,
    params: &RegulariseParams,
    monitor: &Monitor,
) -> Result<ChoiceReport>
where
    L: Fn(&Samples<'_>, &Monitor) -> Result<Classifier>,
{
    let candidates = candidates(params);
    let mut outcomes = Outcomes::new(&candidates);
    if let Some(halves) = training.halves(params.choice.samples, monitor)? {
        monitor.stage("regularisations", trials.len() as u64);
        for trial in trials.iter().filter(|trial| !trial.points.is_empty()) {
            let values = trial.probabilities(&halves)?;
            let given = Probabilities { values: &values, classes: training.classes.len() };
            let mut found = Vec::with_capacity(candidates.len());
            trial.each(given, &candidates, params, |labels| {
                found.push(trial.confusions(&labels, training.classes)?);
                monitor.check()
            })?;
            outcomes.push(found);
            monitor.advance(1);
        }
    }
    Ok(outcomes.report(&params.choice))
}

impl ChoiceReport {
    /// Parameters with the method and the strength that were chosen.
    pub(in crate::recipes) fn applied_to(&self, params: &RegulariseParams) -> RegulariseParams {
        let strength = self.strength.unwrap_or(params.strength);
        RegulariseParams { method: self.method, strength, ..params.clone() }
    }
}
