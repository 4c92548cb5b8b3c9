//! The loss of boosting: negative log-likelihood of the softmax of the scores; for two classes of the logistic
//! function.
//!
//! J. H. Friedman, *Greedy function approximation: a gradient boosting machine*, Annals of Statistics 29, 2001,
//! doi:10.1214/aos/1013203451, sections 4.5 and 4.6. With K classes the diagonal of the second derivative is multiplied
//! by K / (K - 1), which gives Friedman's step.

/// The scores of a sample, and how they become probabilities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Loss {
    /// Number of classes that occur in the samples.
    pub(super) classes: usize,
}

impl Loss {
    /// Number of scores a sample: none for one class, one for two, else one a class.
    pub(super) fn groups(self) -> usize {
        match self.classes {
            0 | 1 => 0,
            2 => 1,
            classes => classes,
        }
    }

    /// Initial scores, from the (positive) shares of the classes alone.
    pub(super) fn start(self, shares: &[f64]) -> Vec<f64> {
        match shares {
            [] | [_] => Vec::new(),
            [first, second] => vec![(second / first).ln()],
            all => all.iter().map(|share| share.ln()).collect(),
        }
    }

    /// Log-sum-exp of the scores, from which all probabilities follow.
    pub(super) fn norm(self, scores: impl Iterator<Item = f64> + Clone) -> f64 {
        let zero = (self.classes == 2).then_some(0.0);
        let all = zero.into_iter().chain(scores);
        let top = all.clone().fold(f64::NEG_INFINITY, f64::max);
        top + all.map(|s| (s - top).exp()).sum::<f64>().ln()
    }

    /// First and second derivative with respect to the score of `group`, for a sample of class `class` and weight 1;
    /// `log_share` is that score minus the log-sum-exp of all scores.
    #[inline]
    pub(super) fn derivatives(self, log_share: f64, group: usize, class: usize) -> (f64, f64) {
        let p = log_share.exp();
        let (own, stretch) = match self.classes {
            2 => (class == 1, 1.0),
            classes => (class == group, classes as f64 / (classes as f64 - 1.0)),
        };
        (p - f64::from(u8::from(own)), stretch * p * (1.0 - p))
    }

    /// Loss of a sample of weight 1: minus the logarithm of the probability of its class.
    #[inline]
    pub(super) fn value(self, norm: f64, class: usize, score: impl Fn(usize) -> f64) -> f64 {
        match (self.classes, class) {
            (0 | 1, _) => 0.0,
            (2, 0) => norm,
            (2, _) => norm - score(0),
            (_, class) => norm - score(class),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_the_slopes_of_the_loss() {
        let scores = [0.3, -1.2, 2.0, 0.1];
        for classes in [2usize, 3, 4] {
            let loss = Loss { classes };
            let groups = loss.groups();
            let value = |s: &[f64], class| loss.value(loss.norm(s.iter().copied()), class, |g| s[g]);
            for class in 0..classes {
                for group in 0..groups {
                    let at = |step: f64| {
                        let mut moved = scores[..groups].to_vec();
                        moved[group] += step;
                        value(&moved, class)
                    };
                    let norm = loss.norm(scores[..groups].iter().copied());
                    let (g, h) = loss.derivatives(scores[group] - norm, group, class);
                    let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                    let bend = (at(1e-4) - 2.0 * at(0.0) + at(-1e-4)) / 1e-8;
                    let stretch = if classes == 2 { 1.0 } else { classes as f64 / (classes as f64 - 1.0) };
                    assert!((g - slope).abs() < 1e-8, "{g} {slope}");
                    assert!((h - stretch * bend).abs() < 1e-5, "{h} {bend}");
                }
            }
        }
    }

    #[test]
    fn the_starting_scores_give_back_the_shares() {
        for shares in [vec![0.25, 0.75], vec![0.2, 0.3, 0.5]] {
            let loss = Loss { classes: shares.len() };
            let start = loss.start(&shares);
            let norm = loss.norm(start.iter().copied());
            for (class, share) in shares.iter().enumerate() {
                let p = (-loss.value(norm, class, |g| start[g])).exp();
                assert!((p - share).abs() < 1e-12);
            }
        }
        assert_eq!(Loss { classes: 1 }.groups(), 0);
    }

    #[test]
    fn huge_scores_stay_finite() {
        let loss = Loss { classes: 3 };
        let norm = loss.norm([1e4, 0.0, -1e4].into_iter());
        assert!((norm - 1e4).abs() < 1e-9 && loss.value(norm, 2, |_| -1e4).is_finite());
        assert!(loss.derivatives(-1e4 - norm, 2, 2).0.abs() <= 1.0);
    }
}
