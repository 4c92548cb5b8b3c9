//! Parameters of terrain models and of what is derived from them.

use crate::error::{Error, Result};
use crate::terrain::GroundParams;
use serde::{Deserialize, Serialize};

/// How ground points are found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GroundChoice {
    /// Class 2 if the cloud has points of it, else the ground filter.
    #[default]
    Auto,
    /// The points of these classes.
    Classes(Vec<u8>),
    /// The ground filter, whatever the classes are.
    Filter,
}

/// Parameters of terrain models and of what is derived from them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ProductParams {
    /// Edge of a cell, metres; above 0.
    pub cell: f64,
    /// How ground points are found.
    pub ground: GroundChoice,
    /// Parameters of the ground filter, if it is used.
    pub filter: GroundParams,
    /// Classes that are left out of all products; `None`: 7 and 18, low and high noise, if the codes are those of ASPRS.
    /// Withheld points are left out whatever their class.
    pub noise: Option<Vec<u8>>,
    /// Cells farther from the nearest ground point than this stay without data in the terrain model, metres; above 0.
    pub reach: f64,
}

impl Default for ProductParams {
    /// No paper: 1 m is the usual cell of airborne surveys; a reach of 100 m bridges buildings and rivers, but not the
    /// empty corner of a survey.
    fn default() -> Self {
        Self { cell: 1.0, ground: GroundChoice::default(), filter: GroundParams::default(), noise: None, reach: 100.0 }
    }
}

impl ProductParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.cell > 0.0 && self.cell.is_finite()) {
            return Err(Error::parameter("cell", self.cell, "metres, above 0"));
        }
        if self.reach.is_nan() || self.reach <= 0.0 {
            return Err(Error::parameter("reach", self.reach, "metres, above 0"));
        }
        match &self.ground {
            GroundChoice::Classes(codes) if codes.is_empty() => {
                Err(Error::parameter("ground", "no class", "at least one class"))
            }
            _ => self.filter.validate(),
        }
    }
}
