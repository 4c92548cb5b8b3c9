//! Parameters of the rating of lines, part by part.

use super::checks::{between, zero_or_more};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Longest window, metres.
const LONGEST: f64 = 1e3;

/// Parameters of the rating of lines, part by part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PartParams {
    /// Least rating of a part that is kept, 0 to 1; higher: fewer lines that are more often right; 0: all lines stay whole.
    pub least: f64,
    /// Share of the line's confidence in the rating, 0 to 1; the rest is the likelihood of the points beside it.
    pub confidence: f64,
    /// Length of line over which the rating is averaged, metres, 0 to 1000.
    pub window: f64,
    /// Parts of divided lines that are shorter are left out, metres, 0 or more.
    pub least_length: f64,
}

impl Default for PartParams {
    fn default() -> Self {
        Self { least: 0.5, confidence: 0.3, window: 0.4, least_length: 0.2 }
    }
}

impl PartParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        between("least", self.least, 1.0)?;
        between("confidence", self.confidence, 1.0)?;
        zero_or_more("least_length", self.least_length)?;
        match (0.0..=LONGEST).contains(&self.window) {
            true => Ok(()),
            false => Err(Error::parameter("window", self.window, "0 to 1000 m")),
        }
    }
}
