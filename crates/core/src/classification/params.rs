//! Parameters of the forest.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Position of the threshold between two neighbouring values of the samples in a node. With [`Splitter::Histogram`] it is one of
/// the borders of bins between the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Trainer {
    /// In the middle (CART; Breiman 2001); the middle border.
    Breiman,
    /// Uniformly random in between (template library of ETH Zurich, used by Hackel 2018); a random border, which is the only one
    /// if the bins are neighbours.
    Ethz,
}

/// Impurity measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Criterion {
    /// Gini: sum of p (1 - p).
    Gini,
    /// Entropy: -sum of p ln p (Hackel 2018, eq. 3.6 with its sign corrected).
    Entropy,
}

/// Number of features tried at a node. More are drawn until one of them is not constant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MaxFeatures {
    /// Square root of the number of features, rounded down.
    Sqrt,
    /// Logarithm to base 2, rounded down.
    Log2,
    /// Every feature.
    All,
    /// This many, 1 or more, but at most all.
    Count(usize),
    /// This share of them, in (0, 1], rounded down, at least 1.
    Fraction(f64),
}

impl MaxFeatures {
    /// The number for `width` features, `1..=width`.
    pub fn resolve(self, width: usize) -> usize {
        let count = match self {
            Self::Sqrt => width.isqrt(),
            Self::Log2 => width.max(1).ilog2() as usize,
            Self::All => width,
            Self::Count(count) => count,
            Self::Fraction(share) => (share * width as f64) as usize,
        };
        count.clamp(1, width.max(1))
    }
}

/// The samples that each tree is trained on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bootstrap {
    /// As many as there are, drawn with replacement (Breiman 2001).
    WithReplacement,
    /// This share of them, in (0, 1], each at most once.
    WithoutReplacement(f64),
    /// All of them.
    None,
}

/// Class weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassWeight {
    /// All samples have the same weight.
    None,
    /// Inversely proportional to the class's number of samples: n / (number of classes present x n of the class).
    Balanced,
    /// One weight a class, 1e-44 to 3e38.
    PerClass(Vec<f64>),
}

impl ClassWeight {
    /// Checks the weights given.
    pub(super) fn validate(&self) -> Result<()> {
        match self {
            Self::PerClass(weights) => weights.iter().try_for_each(|&w| single(w).map(|_| ())),
            _ => Ok(()),
        }
    }
}

/// A weight as 32 bits hold it.
///
/// # Errors
/// If it is not a number above 0 there, or infinite.
pub(super) fn single(weight: f64) -> Result<f32> {
    match weight as f32 {
        rounded if rounded.is_finite() && rounded > 0.0 => Ok(rounded),
        _ => Err(Error::parameter("class_weight", weight, "numbers (times the weights of samples) of 1e-44 to 3e38")),
    }
}

/// Search for thresholds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Splitter {
    /// On values quantised to at most `max_bins` bins: the fast variant. All thresholds are borders of these bins.
    Histogram,
    /// On the sorted raw values: the slow reference, whose thresholds may lie anywhere between two values. At most 65535
    /// different thresholds a feature in a forest.
    Exact,
}

/// Parameters of [`Forest::fit`](super::Forest::fit). The default is [`ForestParams::ethz`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ForestParams {
    /// Number of trees, 1..=10000.
    pub trees: usize,
    /// Largest depth of a tree (splits between root and leaf), 1..=4096; `None` (`"none"` or 0 in a recipe) stands for 4096.
    #[serde(with = "crate::settings::optional_or_zero")]
    pub max_depth: Option<usize>,
    /// Position of thresholds between values.
    pub trainer: Trainer,
    /// Impurity measure.
    pub criterion: Criterion,
    /// Number of features tried at a node.
    pub max_features: MaxFeatures,
    /// Nodes with fewer distinct samples are not split, 2 or more.
    pub min_samples_split: usize,
    /// Least number of distinct samples in a child, 1 or more.
    pub min_samples_leaf: usize,
    /// Least share of the tree's weight in a child, 0..=0.5.
    pub min_weight_leaf: f64,
    /// The samples that each tree is trained on.
    pub bootstrap: Bootstrap,
    /// Class weights.
    pub class_weight: ClassWeight,
    /// Search for thresholds.
    pub splitter: Splitter,
    /// Largest number of bins a feature with [`Splitter::Histogram`], 2..=255.
    pub max_bins: usize,
    /// Seed of all random draws.
    pub seed: u64,
}

impl Default for ForestParams {
    fn default() -> Self {
        Self::ethz()
    }
}

impl ForestParams {
    /// L. Breiman, *Random forests*, 2001, with the common 100 trees grown until their leaves are pure.
    pub fn breiman() -> Self {
        Self {
            trees: 100,
            max_depth: None,
            trainer: Trainer::Breiman,
            min_samples_split: 2,
            bootstrap: Bootstrap::WithReplacement,
            ..Self::ethz()
        }
    }

    /// The forest of Hackel 2018, chapter 4.4.3: 50 trees of depth 30, otherwise the defaults of ETH's template
    /// library.
    pub fn ethz() -> Self {
        Self {
            trees: 50,
            max_depth: Some(30),
            trainer: Trainer::Ethz,
            criterion: Criterion::Gini,
            max_features: MaxFeatures::Sqrt,
            min_samples_split: 5,
            min_samples_leaf: 1,
            min_weight_leaf: 0.0,
            bootstrap: Bootstrap::WithoutReplacement(0.632),
            class_weight: ClassWeight::None,
            splitter: Splitter::Histogram,
            max_bins: 255,
            seed: 0,
        }
    }

    /// The depth limit as a number.
    pub fn depth_limit(&self) -> usize {
        self.max_depth.unwrap_or(MAX_DEPTH)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the field.
    pub fn validate(&self) -> Result<()> {
        within("trees", self.trees, 1, 10_000)?;
        within("max_depth", self.depth_limit(), 1, MAX_DEPTH)?;
        within("min_samples_split", self.min_samples_split, 2, usize::MAX)?;
        within("min_samples_leaf", self.min_samples_leaf, 1, usize::MAX)?;
        within("max_bins", self.max_bins, 2, 255)?;
        if !(0.0..=0.5).contains(&self.min_weight_leaf) {
            return Err(Error::parameter("min_weight_leaf", self.min_weight_leaf, "a share, 0 to 0.5"));
        }
        if let MaxFeatures::Count(count) = self.max_features {
            within("max_features", count, 1, usize::MAX)?;
        }
        if let MaxFeatures::Fraction(share) = self.max_features {
            share_in_range("max_features", share)?;
        }
        if let Bootstrap::WithoutReplacement(share) = self.bootstrap {
            share_in_range("bootstrap", share)?;
        }
        self.class_weight.validate()
    }
}

/// Largest depth of a tree that is trained or read.
pub(super) const MAX_DEPTH: usize = 4096;

pub(super) fn within(name: &'static str, value: usize, low: usize, high: usize) -> Result<()> {
    let expected = || if high == usize::MAX { format!("{low} or more") } else { format!("{low} to {high}") };
    if (low..=high).contains(&value) { Ok(()) } else { Err(Error::parameter(name, value, expected())) }
}

fn share_in_range(name: &'static str, share: f64) -> Result<()> {
    if share > 0.0 && share <= 1.0 { Ok(()) } else { Err(Error::parameter(name, share, "a share above 0, at most 1")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toml_carries_every_setting_there_and_back() {
        let mut params = ForestParams::breiman();
        params.max_features = MaxFeatures::Fraction(0.25);
        params.class_weight = ClassWeight::PerClass(vec![1.0, 2.5]);
        for params in [params, ForestParams::ethz()] {
            let text = toml::to_string(&params).unwrap();
            assert_eq!(toml::from_str::<ForestParams>(&text).unwrap(), params, "{text}");
        }
        assert!(toml::from_str::<ForestParams>("tree = 5").is_err());
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let default = ForestParams::default();
        default.validate().unwrap();
        assert!(ForestParams { trees: 0, ..default.clone() }.validate().is_err());
        assert!(ForestParams { max_depth: Some(0), ..default.clone() }.validate().is_err());
        assert!(ForestParams { min_weight_leaf: 0.6, ..default.clone() }.validate().is_err());
        assert!(ForestParams { max_bins: 256, ..default.clone() }.validate().is_err());
        assert!(ForestParams { min_samples_split: 1, ..default.clone() }.validate().is_err());
        assert!(
            ForestParams { bootstrap: Bootstrap::WithoutReplacement(f64::NAN), ..default.clone() }.validate().is_err()
        );
        assert!(ForestParams { max_features: MaxFeatures::Fraction(0.0), ..default.clone() }.validate().is_err());
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-60, 1e60] {
            let class_weight = ClassWeight::PerClass(vec![1.0, wrong]);
            assert!(ForestParams { class_weight, ..default.clone() }.validate().is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_of_features_follow_their_rules() {
        assert_eq!(MaxFeatures::Sqrt.resolve(144), 12);
        assert_eq!(MaxFeatures::Log2.resolve(144), 7);
        assert_eq!(MaxFeatures::Log2.resolve(1), 1);
        assert_eq!(MaxFeatures::Count(500).resolve(144), 144);
        assert_eq!(MaxFeatures::Fraction(0.5).resolve(9), 4);
    }
}
