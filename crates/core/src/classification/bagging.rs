//! Bagging: the mean of unpruned trees on bootstrap samples, every feature tried at every node.
//!
//! Breiman, *Bagging predictors*, Machine Learning 24, 1996. A random forest that does not draw features.

use super::params::{Bootstrap, ClassWeight, ForestParams, MaxFeatures, zero_is_none};
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Settings of bagging: 100 trees grown until their leaves are pure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BaggingParams {
    /// Number of trees, 1..=10000.
    pub trees: usize,
    /// Splits on the longest way from root to leaf, 1..=4096; `None` (written as 0) stands for 4096.
    #[serde(with = "zero_is_none")]
    pub max_depth: Option<usize>,
    /// Nodes with fewer different samples are not split, 2 or more.
    pub min_samples_split: usize,
    /// No child gets fewer different samples, 1 or more.
    pub min_samples_leaf: usize,
    /// No child gets a smaller share of the tree's weight, 0..=0.5.
    pub min_weight_leaf: f64,
    /// Weight of the classes.
    pub class_weight: ClassWeight,
    /// Bins a feature, 2..=255.
    pub max_bins: usize,
    /// Seed of everything drawn by chance.
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
    /// The forest that is the same: all features at every node, as many samples as there are drawn with replacement.
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
