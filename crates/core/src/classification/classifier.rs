//! The classifiers behind one type: what a model file holds and a recipe selects, and the list of all.

use super::arrays::{Array, Reader};
use super::boosting::{Boosting, BoostingParams};
use super::forest::Forest;
use super::forest::bagging::BaggingParams;
use super::learner::{Learner, PartCount, Predictor, Stored};
use super::linear::{Linear, LinearParams};
use super::params::ForestParams;
use super::samples::Samples;
use crate::error::Result;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

macro_rules! classifiers {
    ($($(#[$attribute:meta])* $kind:ident, $name:literal, $title:literal, $params:ty => $trained:ty;)*) => {
        /// The kinds of classifiers.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub enum ClassifierKind {
            $(#[doc = $title] $(#[$attribute])* #[serde(rename = $name)] $kind,)*
        }

        /// Parameters of one kind of classifier.
        #[derive(Clone, Debug, PartialEq)]
        pub enum ClassifierParams {
            $(#[doc = $title] $kind($params),)*
        }

        /// A trained classifier of any kind: class probabilities for rows of features.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Classifier {
            $(#[doc = $title] $kind($trained),)*
        }

        /// Scratch memory of the prediction by a classifier of any kind.
        #[derive(Debug, Default)]
        pub enum ClassifierScratch {
            /// Nothing yet.
            #[default]
            Empty,
            $(#[doc = $title] $kind(<$trained as Predictor>::Scratch),)*
        }

        impl ClassifierKind {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// Short name, as in recipes and on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)* }
            }

            /// One line about it.
            pub fn title(self) -> &'static str {
                match self { $(Self::$kind => $title,)* }
            }
        }

        impl ClassifierParams {
            /// The kind of classifier.
            pub fn kind(&self) -> ClassifierKind {
                match self { $(Self::$kind(_) => ClassifierKind::$kind,)* }
            }

            /// The same parameters with this added to the seed.
            #[must_use]
            pub fn with_seed(mut self, seed: u64) -> Self {
                if let Some(own) = match &mut self { $(Self::$kind(params) => params.seed(),)* } {
                    *own = own.wrapping_add(seed);
                }
                self
            }

            /// Limit of the depth of its trees; `None` if it has no trees.
            pub fn max_depth(&mut self) -> Option<&mut Option<usize>> {
                match self { $(Self::$kind(params) => params.max_depth(),)* }
            }

            /// Trains a classifier: [`Learner::train`].
            ///
            /// # Errors
            /// As [`Learner::train`].
            pub fn train(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<Classifier> {
                match self { $(Self::$kind(params) => params.train(samples, monitor).map(Classifier::$kind),)* }
            }

            /// Trains a classifier; also returns the out-of-bag accuracy if there is one: [`Learner::train_with_score`].
            ///
            /// # Errors
            /// As [`Learner::train`].
            pub fn train_with_score(
                &self,
                samples: &Samples<'_>,
                monitor: &Monitor,
            ) -> Result<(Classifier, Option<f64>)> {
                match self {
                    $(Self::$kind(params) => {
                        let (trained, score) = params.train_with_score(samples, monitor)?;
                        Ok((Classifier::$kind(trained), score))
                    })*
                }
            }
        }

        impl Classifier {
            /// The kind of classifier.
            pub fn kind(&self) -> ClassifierKind {
                match self { $(Self::$kind(_) => ClassifierKind::$kind,)* }
            }

            /// Its arrays in a model file.
            pub(crate) fn arrays(&self) -> Vec<Array> {
                match self { $(Self::$kind(trained) => trained.arrays(),)* }
            }
        }

        impl Predictor for Classifier {
            type Scratch = ClassifierScratch;

            fn classes(&self) -> usize {
                match self { $(Self::$kind(trained) => trained.classes(),)* }
            }

            fn width(&self) -> usize {
                match self { $(Self::$kind(trained) => trained.width(),)* }
            }

            fn parts(&self) -> Vec<PartCount> {
                match self { $(Self::$kind(trained) => trained.parts(),)* }
            }

            fn importance(&self) -> &[f64] {
                match self { $(Self::$kind(trained) => trained.importance(),)* }
            }

            fn retain_used(self) -> (Self, Vec<usize>) {
                match self {
                    $(Self::$kind(trained) => {
                        let (trained, used) = trained.retain_used();
                        (Self::$kind(trained), used)
                    })*
                }
            }

            fn predict_block(&self, rows: &[f32], scratch: &mut ClassifierScratch, out: &mut [f32]) -> Result<()> {
                match (self, &mut *scratch) {
                    $((Self::$kind(trained), ClassifierScratch::$kind(own)) => trained.predict_block(rows, own, out),)*
                    $((Self::$kind(trained), other) => {
                        let mut own = Default::default();
                        let done = trained.predict_block(rows, &mut own, out);
                        *other = ClassifierScratch::$kind(own);
                        done
                    })*
                }
            }

            fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
                match self { $(Self::$kind(trained) => trained.predict_proba(rows, out),)* }
            }

            fn predict(&self, rows: &[f32]) -> Result<Vec<u16>> {
                match self { $(Self::$kind(trained) => trained.predict(rows),)* }
            }
        }

        impl Reader<'_> {
            /// The classifier of that kind, of `width` features and `classes` classes, every index checked.
            pub(crate) fn classifier(&self, kind: ClassifierKind, width: usize, classes: usize) -> Result<Classifier> {
                match kind {
                    $(ClassifierKind::$kind => {
                        <$trained>::from_arrays(self, width, classes).map(Classifier::$kind)
                    })*
                }
            }
        }
    };
}

classifiers! {
    #[default]
    Forest, "rf", "Random forest", ForestParams => Forest;
    Boosting, "gbt", "Gradient-boosted trees", BoostingParams => Boosting;
    Bagging, "bagging", "Bagging of unpruned trees", BaggingParams => Forest;
    Linear, "linear", "Multinomial logistic regression", LinearParams => Linear;
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
            ClassifierParams::Linear(LinearParams::default()),
        ];
        for (params, kind) in all.into_iter().zip(ClassifierKind::ALL.iter().copied()) {
            let (found, score) = params.train_with_score(&half, &Monitor::default()).unwrap();
            assert_eq!((found.kind(), params.kind()), (kind, kind));
            assert_eq!(found, params.with_seed(0).train(&half, &Monitor::default()).unwrap());
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
