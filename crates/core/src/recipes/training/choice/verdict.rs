//! The rule of the choice: the largest gain that exceeds its standard error and harms no cloud.

use super::Candidate;
use super::report::{CandidateScore, ChoiceReport};
use crate::classes::ClassTable;
use crate::evaluation::Confusion;
use crate::recipes::regularise::{ChoiceParams, Regularise};

/// The confusions of all patches, by cloud and candidate.
pub(super) struct Outcomes<'a> {
    candidates: &'a [Candidate],
    /// Of each cloud or copy, of each candidate, of each patch.
    clouds: Vec<Vec<Vec<Confusion>>>,
}

/// Mean scores of the classes that occur in the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    f1: f64,
    iou: f64,
    /// Share of right points.
    accuracy: f64,
}

/// What a candidate gains in one score, and the standard error of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Gain {
    value: f64,
    error: f64,
}

impl<'a> Outcomes<'a> {
    pub(super) fn new(candidates: &'a [Candidate]) -> Self {
        Self { candidates, clouds: Vec::new() }
    }

    /// Adds the patches of a cloud: of each candidate, of each patch.
    pub(super) fn push(&mut self, confusions: Vec<Vec<Confusion>>) {
        self.clouds.push(confusions);
    }

    /// The scores of all candidates, and the best of those that gain more than the standard errors and harm no cloud.
    pub(super) fn report(&self, params: &ChoiceParams) -> ChoiceReport {
        let none = self.patches(0);
        let scores: Vec<CandidateScore> = match none.is_empty() {
            true => Vec::new(),
            false => (0..self.candidates.len()).map(|c| self.score(c, params)).collect(),
        };
        let allowed = |s: &&CandidateScore| {
            // Rare classes make the mean F1 uncertain, but not the accuracy.
            let certain =
                s.gain > params.errors * s.standard_error || s.accuracy_gain > params.errors * s.accuracy_error;
            none.len() > 2 && certain && s.gain > 0.0 && s.accuracy_gain > 0.0 && s.largest_loss <= params.tolerance
        };
        // Of equal ones the first.
        let best = scores.iter().rev().filter(allowed).max_by(|a, b| a.gain.total_cmp(&b.gain));
        ChoiceReport {
            method: best.map_or(Regularise::None, |best| best.method),
            strength: best.and_then(|best| best.strength),
            clouds: self.clouds.len(),
            patches: none.len(),
            points: none.iter().map(|patch| patch.points()).sum(),
            candidates: scores,
        }
    }

    /// The patches of all clouds by a candidate.
    fn patches(&self, candidate: usize) -> Vec<&Confusion> {
        self.clouds.iter().flat_map(|cloud| &cloud[candidate]).collect()
    }

    fn score(&self, candidate: usize, params: &ChoiceParams) -> CandidateScore {
        let own = self.patches(candidate);
        let mean = Mean::of(&sum(&own));
        let none = self.patches(0);
        let gain = Gain::of(&own, &none, |mean| mean.f1);
        let accuracy = Gain::of(&own, &none, |mean| mean.accuracy);
        let loss = |cloud: &Vec<Vec<Confusion>>| {
            let [own, none] = [candidate, 0].map(|c| cloud[c].iter().collect::<Vec<_>>());
            let gain = Gain::of(&own, &none, |mean| mean.f1);
            -gain.value - params.errors * gain.error
        };
        let Candidate { method, strength } = self.candidates[candidate];
        CandidateScore {
            method,
            strength,
            mean_f1: mean.f1,
            mean_iou: mean.iou,
            gain: gain.value,
            standard_error: gain.error,
            accuracy: mean.accuracy,
            accuracy_gain: accuracy.value,
            accuracy_error: accuracy.error,
            largest_loss: self.clouds.iter().map(loss).fold(0.0, f64::max),
        }
    }
}

impl Gain {
    /// The gain over all patches. Its standard error is that of the jackknife: the gain is computed again without each
    /// patch.
    fn of(own: &[&Confusion], none: &[&Confusion], score: fn(&Mean) -> f64) -> Self {
        let all = [sum(own), sum(none)];
        let of = |counts: &Confusion| score(&Mean::of(counts));
        let without = |(a, b): (&&Confusion, &&Confusion)| of(&all[0].without(a)) - of(&all[1].without(b));
        let again: Vec<f64> = own.iter().zip(none).map(without).collect();
        let count = again.len().max(1) as f64;
        let mean = again.iter().sum::<f64>() / count;
        let squares: f64 = again.iter().map(|gain| (gain - mean).powi(2)).sum();
        Self { value: of(&all[0]) - of(&all[1]), error: ((count - 1.0) / count * squares).sqrt() }
    }
}

impl Mean {
    /// 0 if there is no point.
    fn of(counts: &Confusion) -> Self {
        let scores = counts.scores();
        let there: Vec<_> = scores.labels.iter().filter(|class| class.support > 0).collect();
        let mean = |values: f64| values / there.len().max(1) as f64;
        Self {
            f1: mean(there.iter().map(|class| class.f1_score).sum()),
            iou: mean(there.iter().map(|class| class.intersection_over_union).sum()),
            accuracy: if scores.points > 0 { scores.overall_accuracy } else { 0.0 },
        }
    }
}

fn sum(patches: &[&Confusion]) -> Confusion {
    let empty = || Confusion::new(ClassTable::from_codes(&[]));
    patches.iter().copied().cloned().reduce(|sum, patch| sum.merge(&patch)).unwrap_or_else(empty)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A patch of 100 points of each of two classes with so many wrong ones.
    fn patch(wrong: usize) -> Confusion {
        let mut counts = Confusion::new(ClassTable::from_codes(&[2, 6]));
        for i in 0..100 {
            counts.add(2, if i < wrong { 6 } else { 2 }).unwrap();
            counts.add(6, if i < wrong { 2 } else { 6 }).unwrap();
        }
        counts
    }

    /// Wrong points of each patch of each cloud: without regularisation, and with a field.
    fn judged(clouds: &[[&[usize]; 2]]) -> ChoiceReport {
        let of = |method, strength| Candidate { method, strength };
        let candidates = [of(Regularise::None, None), of(Regularise::PointCrf, Some(2.0))];
        let mut outcomes = Outcomes::new(&candidates);
        for cloud in clouds {
            outcomes.push(cloud.iter().map(|patches| patches.iter().map(|&wrong| patch(wrong)).collect()).collect());
        }
        outcomes.report(&ChoiceParams::default())
    }

    #[test]
    fn a_clear_gain_is_taken_with_its_strength() {
        let found = judged(&[[&[20, 22, 24], &[10, 11, 12]], [&[10, 10], &[8, 9]]]);
        assert_eq!((found.method, found.strength), (Regularise::PointCrf, Some(2.0)));
        let field = &found.candidates[1];
        // F1 is the share of right points here: 450 of 500, without the field 414.
        assert!((field.mean_f1 - 0.9).abs() < 1e-12, "{field:?}");
        assert!((field.gain - 0.072).abs() < 1e-12 && field.largest_loss == 0.0, "{field:?}");
        assert_eq!((found.clouds, found.patches, found.points), (2, 5, 1000));
        assert!(found.text().contains("chosen: point-crf, strength 2"), "{}", found.text());
    }

    #[test]
    fn no_gain_an_uncertain_one_and_one_that_harms_a_cloud_are_not() {
        for clouds in [
            [[&[20, 22, 24][..], &[20, 22, 24][..]], [&[10, 10], &[10, 10]]],
            // The gain comes from one patch of five.
            [[&[20, 20, 20], &[5, 22, 22]], [&[20, 20], &[20, 20]]],
            // Ten points better in one cloud, one point worse in the other.
            [[&[20, 22, 24], &[10, 12, 14]], [&[10, 10], &[11, 11]]],
        ] {
            assert_eq!(judged(&clouds).method, Regularise::None, "{clouds:?}");
        }
        let few = judged(&[[&[20], &[10]]]);
        assert_eq!((few.method, few.strength), (Regularise::None, None));
        assert!(judged(&[]).text().contains("too few"));
    }

    #[test]
    fn the_standard_error_of_patches_of_equal_size_is_that_of_a_mean() {
        let found = judged(&[[&[20, 20, 20, 20], &[10, 12, 14, 16]]]);
        let gains = [0.10, 0.08, 0.06, 0.04f64];
        let variance = gains.iter().map(|g| (g - 0.07).powi(2)).sum::<f64>() / 3.0;
        assert!((found.candidates[1].standard_error - (variance / 4.0).sqrt()).abs() < 1e-12, "{found:?}");
    }
}
