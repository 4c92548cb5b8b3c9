//! The classifiers behind one type: what a model file holds and a recipe selects.

use super::bagging::BaggingParams;
use super::boosting::{Boosting, BoostingParams};
use super::forest::Forest;
use super::params::ForestParams;
use super::samples::Samples;
use crate::classification::forest::predict::{PredictScratch, argmax};
use crate::error::Result;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// The kinds of classifiers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClassifierKind {
    /// Random forest.
    #[default]
    #[serde(rename = "rf")]
    Forest,
    /// Gradient-boosted trees.
    #[serde(rename = "gbt")]
    Boosting,
    /// Bagging.
    #[serde(rename = "bagging")]
    Bagging,
}

impl ClassifierKind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Forest, Self::Boosting, Self::Bagging];

    /// Short name, as in recipes and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forest => "rf",
            Self::Boosting => "gbt",
            Self::Bagging => "bagging",
        }
    }

    /// One line about it.
    pub fn title(self) -> &'static str {
        match self {
            Self::Forest => "Random forest",
            Self::Boosting => "Gradient-boosted trees",
            Self::Bagging => "Bagging of unpruned trees",
        }
    }

    /// Of the given parameters those of this kind.
    pub fn choose(self, forest: &ForestParams, boosting: &BoostingParams, bagging: &BaggingParams) -> ClassifierParams {
        match self {
            Self::Forest => ClassifierParams::Forest(forest.clone()),
            Self::Boosting => ClassifierParams::Boosting(boosting.clone()),
            Self::Bagging => ClassifierParams::Bagging(bagging.clone()),
        }
    }
}

/// Parameters of one kind of classifier.
#[derive(Clone, Debug, PartialEq)]
pub enum ClassifierParams {
    /// Random forest.
    Forest(ForestParams),
    /// Gradient-boosted trees.
    Boosting(BoostingParams),
    /// Bagging.
    Bagging(BaggingParams),
}

impl ClassifierParams {
    /// The same parameters with this added to the seed.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        let own = match &mut self {
            Self::Forest(params) => &mut params.seed,
            Self::Boosting(params) => &mut params.seed,
            Self::Bagging(params) => &mut params.seed,
        };
        *own = own.wrapping_add(seed);
        self
    }

    /// Limit of the depth of its trees.
    pub fn max_depth(&mut self) -> &mut Option<usize> {
        match self {
            Self::Forest(params) => &mut params.max_depth,
            Self::Boosting(params) => &mut params.max_depth,
            Self::Bagging(params) => &mut params.max_depth,
        }
    }

    /// The kind of classifier.
    pub fn kind(&self) -> ClassifierKind {
        match self {
            Self::Forest(_) => ClassifierKind::Forest,
            Self::Boosting(_) => ClassifierKind::Boosting,
            Self::Bagging(_) => ClassifierKind::Bagging,
        }
    }
}

/// A trained classifier: class probabilities for rows of features.
#[derive(Clone, Debug, PartialEq)]
pub enum Classifier {
    /// Random forest.
    Forest(Forest),
    /// Gradient-boosted trees.
    Boosting(Boosting),
    /// Bagging, stored as a forest.
    Bagging(Forest),
}

/// Evaluates the same expression for the forest or the boosted trees of a classifier.
macro_rules! with_trees {
    ($self:expr, $trees:ident => $value:expr) => {
        match $self {
            Self::Forest($trees) | Self::Bagging($trees) => $value,
            Self::Boosting($trees) => $value,
        }
    };
}

impl Classifier {
    /// Trains a classifier. The result is the same bytes for any number of threads.
    ///
    /// # Errors
    /// If samples are inconsistent, a parameter is out of range, or the work was cancelled.
    pub fn fit(samples: &Samples<'_>, params: &ClassifierParams, monitor: &Monitor) -> Result<Self> {
        Ok(match params {
            ClassifierParams::Forest(params) => Self::Forest(Forest::fit(samples, params, monitor)?),
            ClassifierParams::Boosting(params) => Self::Boosting(Boosting::fit(samples, params, monitor)?),
            ClassifierParams::Bagging(params) => Self::Bagging(Forest::fit(samples, &params.forest(), monitor)?),
        })
    }

    /// As [`Classifier::fit`]; also returns the out-of-bag accuracy if trees left out samples.
    ///
    /// # Errors
    /// As [`Classifier::fit`].
    pub fn fit_with_score(
        samples: &Samples<'_>,
        params: &ClassifierParams,
        monitor: &Monitor,
    ) -> Result<(Self, Option<f64>)> {
        let forest = |params: &ForestParams| {
            Forest::fit_with_report(samples, params, monitor).map(|(forest, report)| (forest, report.oob_score))
        };
        match params {
            ClassifierParams::Forest(params) => forest(params).map(|(f, score)| (Self::Forest(f), score)),
            ClassifierParams::Bagging(params) => forest(&params.forest()).map(|(f, score)| (Self::Bagging(f), score)),
            ClassifierParams::Boosting(_) => Self::fit(samples, params, monitor).map(|found| (found, None)),
        }
    }

    /// The kind of classifier.
    pub fn kind(&self) -> ClassifierKind {
        match self {
            Self::Forest(_) => ClassifierKind::Forest,
            Self::Boosting(_) => ClassifierKind::Boosting,
            Self::Bagging(_) => ClassifierKind::Bagging,
        }
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        with_trees!(self, trees => trees.classes())
    }

    /// Number of features of a row.
    pub fn width(&self) -> usize {
        with_trees!(self, trees => trees.width())
    }

    /// Number of trees.
    pub fn trees(&self) -> usize {
        with_trees!(self, trees => trees.trees())
    }

    /// Number of nodes of all trees, leaves included.
    pub fn nodes(&self) -> usize {
        with_trees!(self, trees => trees.nodes())
    }

    /// Share of each feature in the improvement by all splits; sums to 1, or all 0 if no tree has a split.
    pub fn importance(&self) -> &[f64] {
        with_trees!(self, trees => trees.importance())
    }

    /// Removes the features that occur in no split; also returns the features kept. Predictions do not change.
    pub fn retain_used(self) -> (Self, Vec<usize>) {
        match self {
            Self::Forest(trees) => {
                let (trees, used) = trees.retain_used();
                (Self::Forest(trees), used)
            }
            Self::Bagging(trees) => {
                let (trees, used) = trees.retain_used();
                (Self::Bagging(trees), used)
            }
            Self::Boosting(trees) => {
                let (trees, used) = trees.retain_used();
                (Self::Boosting(trees), used)
            }
        }
    }

    /// Class probabilities of `rows` (row-major), written row-major to `out`. Runs on the calling thread.
    ///
    /// # Errors
    /// If a length does not fit.
    pub fn predict_block(&self, rows: &[f32], scratch: &mut PredictScratch, out: &mut [f32]) -> Result<()> {
        with_trees!(self, trees => trees.predict_block(rows, scratch, out))
    }

    /// As [`Classifier::predict_block`], in parallel over blocks.
    ///
    /// # Errors
    /// If a length does not fit.
    pub fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
        with_trees!(self, trees => trees.predict_proba(rows, out))
    }

    /// The most probable class of every row; the smaller class in a tie.
    ///
    /// # Errors
    /// If the length does not fit.
    pub fn predict(&self, rows: &[f32]) -> Result<Vec<u16>> {
        if let Self::Forest(trees) | Self::Bagging(trees) = self {
            return trees.predict(rows);
        }
        let mut out = vec![0.0; rows.len() / self.width().max(1) * self.classes()];
        self.predict_proba(rows, &mut out)?;
        Ok(out.chunks_exact(self.classes().max(1)).map(|row| argmax(row) as u16).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::blobs;
    use super::*;

    #[test]
    fn every_kind_names_most_samples_right_and_forgets_no_answer_with_its_features() {
        let data = blobs(3000, 7, 4, 0.0);
        let half = Samples { features: &data.features[..1500 * 7], labels: &data.labels[..1500], ..data.samples() };
        let all = [
            ClassifierParams::Forest(ForestParams { trees: 20, ..ForestParams::default() }),
            ClassifierParams::Boosting(BoostingParams { rounds: 20, ..BoostingParams::default() }),
            ClassifierParams::Bagging(BaggingParams { trees: 20, ..BaggingParams::default() }),
        ];
        for (params, kind) in all.into_iter().zip(ClassifierKind::ALL) {
            let (found, score) = Classifier::fit_with_score(&half, &params, &Monitor::default()).unwrap();
            assert_eq!((found.kind(), params.kind()), (kind, kind));
            assert_eq!(found, Classifier::fit(&half, &params.with_seed(0), &Monitor::default()).unwrap());
            let named = found.predict(&data.features[1500 * 7..]).unwrap();
            let right = named.iter().zip(&data.labels[1500..]).filter(|(a, b)| a == b).count();
            assert!(right > 900, "{kind:?} {right}");
            assert!(score.is_none_or(|s| (s - right as f64 / 1500.0).abs() < 0.06));
            assert!((found.importance().iter().sum::<f64>() - 1.0).abs() < 1e-9);
            let (small, used) = found.retain_used();
            let rows: Vec<f32> = data.features.chunks(7).flat_map(|r| used.iter().map(|&f| r[f])).collect();
            assert_eq!(small.predict(&rows).unwrap()[1500..], named);
        }
    }

    #[test]
    fn bagged_trees_differ_from_a_forest_only_in_trying_all_features() {
        let forest = BaggingParams::default().forest();
        assert_eq!(forest.max_features.resolve(18), 18);
        let breiman = ForestParams { max_features: forest.max_features, ..ForestParams::breiman() };
        assert_eq!(forest, breiman);
        assert!(BaggingParams { trees: 0, ..BaggingParams::default() }.validate().is_err());
    }
}
