//! Parameters of boosting.

use crate::classification::params::{ClassWeight, MAX_DEPTH, within};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Parameters of [`Boosting::fit`](super::Boosting::fit). The defaults are those of LightGBM, except for
/// `lambda`, which is that of XGBoost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoostingParams {
    /// Number of rounds, 1..=10000; each grows one tree a class (a single one for two classes).
    pub rounds: usize,
    /// Factor of every leaf value, in (0, 1].
    pub learning_rate: f64,
    /// Largest number of leaves of a tree, 2..=65535.
    pub max_leaves: usize,
    /// Largest depth of a tree (splits between root and leaf), 1..=4096; `None` (`"none"` or 0 in a recipe) stands for 4096.
    #[serde(with = "crate::settings::optional_or_zero")]
    pub max_depth: Option<usize>,
    /// Least number of samples in a child, counted and also estimated from its share of the second derivatives; 1 or
    /// more.
    pub min_samples_leaf: usize,
    /// Least sum of second derivatives in a child, 0 or more.
    pub min_child_weight: f64,
    /// L2 penalty of the leaf values, 0 or more. With 0 the values of leaves of a rare class are not bounded.
    pub lambda: f64,
    /// Least gain of a split, 0 or more.
    pub min_gain: f64,
    /// Share of the samples that each tree is trained on, in (0, 1].
    pub row_fraction: f64,
    /// Number of rounds between two draws of these samples, 1 or more.
    pub row_rounds: usize,
    /// Share of the features that each tree is trained on, in (0, 1]; at least one feature.
    pub column_fraction: f64,
    /// Class weights.
    pub class_weight: ClassWeight,
    /// Stop after this many rounds without a lower loss on held-out samples, and keep the best round; 0: never.
    pub early_stopping: usize,
    /// Share of the samples of every class that is held out for this, in (0, 1), if no validation samples are given.
    pub validation_fraction: f64,
    /// Largest number of bins a feature, 2..=255.
    pub max_bins: usize,
    /// Seed of all random draws.
    pub seed: u64,
}

impl Default for BoostingParams {
    fn default() -> Self {
        Self {
            rounds: 100,
            learning_rate: 0.1,
            max_leaves: 31,
            max_depth: None,
            min_samples_leaf: 20,
            min_child_weight: 1e-3,
            lambda: 1.0,
            min_gain: 0.0,
            row_fraction: 1.0,
            row_rounds: 1,
            column_fraction: 1.0,
            class_weight: ClassWeight::None,
            early_stopping: 0,
            validation_fraction: 0.1,
            max_bins: 255,
            seed: 0,
        }
    }
}

impl BoostingParams {
    /// The depth limit as a number.
    pub fn depth_limit(&self) -> usize {
        self.max_depth.unwrap_or(MAX_DEPTH)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the field.
    pub fn validate(&self) -> Result<()> {
        within("rounds", self.rounds, 1, 10_000)?;
        within("max_leaves", self.max_leaves, 2, 65_535)?;
        within("max_depth", self.depth_limit(), 1, MAX_DEPTH)?;
        within("min_samples_leaf", self.min_samples_leaf, 1, usize::MAX)?;
        within("row_rounds", self.row_rounds, 1, usize::MAX)?;
        within("max_bins", self.max_bins, 2, 255)?;
        for (name, share) in [
            ("learning_rate", self.learning_rate),
            ("row_fraction", self.row_fraction),
            ("column_fraction", self.column_fraction),
        ] {
            if !(share > 0.0 && share <= 1.0) {
                return Err(Error::parameter(name, share, "a number above 0, at most 1"));
            }
        }
        for (name, value) in
            [("min_child_weight", self.min_child_weight), ("lambda", self.lambda), ("min_gain", self.min_gain)]
        {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::parameter(name, value, "a finite number from 0 up"));
            }
        }
        if self.early_stopping > 0 && !(self.validation_fraction > 0.0 && self.validation_fraction < 1.0) {
            return Err(Error::parameter("validation_fraction", self.validation_fraction, "a share between 0 and 1"));
        }
        self.class_weight.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toml_carries_every_setting_there_and_back() {
        let params = BoostingParams { max_depth: Some(5), seed: 9, ..BoostingParams::default() };
        let text = toml::to_string(&params).unwrap();
        assert_eq!(toml::from_str::<BoostingParams>(&text).unwrap(), params);
        assert!(toml::from_str::<BoostingParams>("round = 5").is_err());
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let default = BoostingParams::default();
        default.validate().unwrap();
        assert!(BoostingParams { rounds: 0, ..default.clone() }.validate().is_err());
        assert!(BoostingParams { learning_rate: 0.0, ..default.clone() }.validate().is_err());
        assert!(BoostingParams { max_leaves: 1, ..default.clone() }.validate().is_err());
        assert!(BoostingParams { lambda: f64::NAN, ..default.clone() }.validate().is_err());
        assert!(BoostingParams { row_fraction: 1.5, ..default.clone() }.validate().is_err());
        assert!(BoostingParams { max_bins: 256, ..default.clone() }.validate().is_err());
        let stopping = BoostingParams { early_stopping: 3, validation_fraction: 1.0, ..default };
        assert!(stopping.validate().is_err());
    }
}
