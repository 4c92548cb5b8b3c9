//! Bagging: the mean of unpruned trees on bootstrap samples, with all features tried at every node.
//!
//! L. Breiman, *Bagging predictors*, Machine Learning 24, 1996, doi:10.1007/BF00058655. Equal to a random forest
//! without random choice of features.

use super::Forest;
use crate::classification::learner::Learner;
use crate::classification::params::{Bootstrap, ClassWeight, ForestParams, MaxFeatures};
use crate::classification::samples::Samples;
use crate::error::Result;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Parameters of bagging: 100 trees grown until their leaves are pure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BaggingParams {
    /// Number of trees, 1..=10000.
    pub trees: usize,
    /// Largest depth of a tree (splits between root and leaf), 1..=4096; `None` (`"none"` or 0 in a recipe) stands for 4096.
    #[serde(with = "crate::settings::optional_or_zero")]
    pub max_depth: Option<usize>,
    /// Nodes with fewer distinct samples are not split, 2 or more.
    pub min_samples_split: usize,
    /// Least number of distinct samples in a child, 1 or more.
    pub min_samples_leaf: usize,
    /// Least share of the tree's weight in a child, 0..=0.5.
    pub min_weight_leaf: f64,
    /// Class weights.
    pub class_weight: ClassWeight,
    /// Largest number of bins a feature, 2..=255.
    pub max_bins: usize,
    /// Seed of all random draws.
    pub seed: u64,
}

impl Default for BaggingParams {
    fn default() -> Self {
        Self {
            trees: 100,
            max_depth: None,
            min_samples_split: 2,
            min_samples_leaf: 1,
            min_weight_leaf: 0.0,
            class_weight: ClassWeight::None,
            max_bins: 255,
            seed: 0,
        }
    }
}

impl BaggingParams {
    /// The equivalent forest: all features at every node, and a bootstrap sample as large as the training set.
    pub fn forest(&self) -> ForestParams {
        ForestParams {
            trees: self.trees,
            max_depth: self.max_depth,
            min_samples_split: self.min_samples_split,
            min_samples_leaf: self.min_samples_leaf,
            min_weight_leaf: self.min_weight_leaf,
            class_weight: self.class_weight.clone(),
            max_bins: self.max_bins,
            seed: self.seed,
            max_features: MaxFeatures::All,
            bootstrap: Bootstrap::WithReplacement,
            ..ForestParams::breiman()
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`](crate::Error::InvalidParameter) naming the field.
    pub fn validate(&self) -> Result<()> {
        self.forest().validate()
    }
}

impl Learner for BaggingParams {
    type Trained = Forest;

    fn seed(&mut self) -> Option<&mut u64> {
        Some(&mut self.seed)
    }

    fn max_depth(&mut self) -> Option<&mut Option<usize>> {
        Some(&mut self.max_depth)
    }

    fn train(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<Forest> {
        self.forest().train(samples, monitor)
    }

    fn train_with_score(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<(Forest, Option<f64>)> {
        self.forest().train_with_score(samples, monitor)
    }
}
