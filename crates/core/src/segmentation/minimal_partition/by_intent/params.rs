//! Parameters of a partition whose strength is chosen from what the user wants.

use super::super::cut_pursuit::CutPursuitSteps;
use super::super::merge::check_not_negative;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The algorithm that finds the segments.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// [`cut_pursuit`](crate::segmentation::cut_pursuit()): lower energy.
    #[default]
    CutPursuit,
    /// [`merge`](crate::segmentation::merge()): faster.
    Merge,
}

/// What the partition should look like. All variants but the first search for the strength. In a recipe: `intent = {
/// smallest-object = 0.5 }`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Intent {
    /// No search: this strength ρ. ≥ 0, may be infinite.
    Strength(#[serde(deserialize_with = "crate::settings::number")] f64),
    /// Number of segments per hectare of covered ground (2 m cells in plan that hold points). > 0.
    SegmentsPerHectare(f64),
    /// The finest partition of which at most 5 % of the points lie in segments that are shorter than this in every
    /// direction, in metres. > 0.
    SmallestObject(f64),
    /// The finest partition of which at most 5 % of the points lie in segments of fewer points than this. > 0.
    SmallestObjectPoints(f64),
    /// The coarsest partition whose oracle accuracy on the known labels is at most this much below that of a very fine
    /// partition. 0..1.
    OracleAccuracy(f64),
}

impl Default for Intent {
    fn default() -> Self {
        Self::Strength(0.1)
    }
}

impl fmt::Display for Intent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Strength(value) => write!(f, "strength = {value}"),
            Self::SegmentsPerHectare(value) => write!(f, "segments-per-hectare = {value}"),
            Self::SmallestObject(value) => write!(f, "smallest-object = {value}"),
            Self::SmallestObjectPoints(value) => write!(f, "smallest-object-points = {value}"),
            Self::OracleAccuracy(value) => write!(f, "oracle-accuracy = {value}"),
        }
    }
}

/// Parameters of [`partition_by_intent`](crate::segmentation::partition_by_intent).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct PartitionParams {
    /// The algorithm that finds the segments.
    pub method: Method,
    /// What the partition should look like.
    pub intent: Intent,
    /// Segments of less weight than this are merged into their best neighbour at the end. ≥ 0; 0 keeps all.
    #[serde(deserialize_with = "crate::settings::number")]
    pub cutoff: f64,
    /// Largest number of partitions computed in the search for the strength. At least 1.
    pub trials: usize,
    /// Seed of cut pursuit.
    pub seed: u64,
    /// The steps of cut pursuit.
    pub cut_pursuit: CutPursuitSteps,
}

impl Default for PartitionParams {
    fn default() -> Self {
        Self {
            method: Method::default(),
            intent: Intent::default(),
            cutoff: 0.0,
            trials: 14,
            seed: 0,
            cut_pursuit: CutPursuitSteps::default(),
        }
    }
}

impl PartitionParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        check_not_negative("cutoff", self.cutoff)?;
        self.cut_pursuit.validate()?;
        if self.trials == 0 {
            return Err(Error::parameter("trials", 0, "1 or more"));
        }
        let positive = |name, value: f64| {
            let valid = value > 0.0 && value.is_finite();
            if valid { Ok(()) } else { Err(Error::parameter(name, value, "a finite number above 0")) }
        };
        match self.intent {
            Intent::Strength(value) => check_not_negative("strength", value),
            Intent::SegmentsPerHectare(value) => positive("segments-per-hectare", value),
            Intent::SmallestObject(value) => positive("smallest-object", value),
            Intent::SmallestObjectPoints(value) => positive("smallest-object-points", value),
            Intent::OracleAccuracy(value) if (0.0..1.0).contains(&value) => Ok(()),
            Intent::OracleAccuracy(value) => Err(Error::parameter("oracle-accuracy", value, "0 or more, below 1")),
        }
    }
}
