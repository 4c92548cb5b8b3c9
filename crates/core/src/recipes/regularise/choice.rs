//! Settings of the choice that training makes if the method is `auto`.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// How training chooses a method of regularisation (recipes `pyramid` and `airborne`). Methods are compared on patches of
/// the training clouds, whose points are classified by classifiers that have not learned from their squares.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChoiceParams {
    /// Edge of the squares of a checkerboard, metres: what is learned in the squares of one colour classifies those of
    /// the other. `None` (`"none"` in a recipe) is a quarter of the longer side of each cloud. The recipe `airborne` takes
    /// `folds.square` instead.
    #[serde(with = "crate::settings::optional")]
    pub square: Option<f64>,
    /// Patches of each cloud and each of its thinned copies, at least 1: each in a square of its own.
    pub patches: usize,
    /// Points in the patches of each cloud and copy, about; fewer if the squares hold fewer.
    pub points: usize,
    /// Each of the two classifiers learns from at most this many samples.
    pub samples: usize,
    /// Strengths of the fields to try.
    pub strengths: Vec<f64>,
    /// A method must gain more than this many standard errors of its gain in mean F1, by the jackknife over patches.
    pub errors: f64,
    /// In no cloud and no copy may a method lose more mean F1 than this and as many standard errors, 0..1.
    pub tolerance: f64,
}

impl Default for ChoiceParams {
    fn default() -> Self {
        Self {
            square: None,
            patches: 8,
            points: 10_000,
            samples: 20_000,
            strengths: vec![0.5, 1.0, 2.0],
            errors: 1.0,
            tolerance: 0.005,
        }
    }
}

impl ChoiceParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if let Some(square) = self.square.filter(|edge| !(*edge > 0.0 && edge.is_finite())) {
            return Err(Error::parameter("regularise.choice.square", square, "metres, above 0"));
        }
        let counts = [
            ("regularise.choice.patches", self.patches),
            ("regularise.choice.points", self.points),
            ("regularise.choice.samples", self.samples),
        ];
        if let Some((name, _)) = counts.iter().find(|(_, count)| *count == 0) {
            return Err(Error::parameter(name, 0, "1 or more"));
        }
        if let Some(strength) = self.strengths.iter().find(|s| !(**s >= 0.0 && s.is_finite())) {
            return Err(Error::parameter("regularise.choice.strengths", strength, "0 or more, finite"));
        }
        for (name, value) in
            [("regularise.choice.errors", self.errors), ("regularise.choice.tolerance", self.tolerance)]
        {
            if value.is_nan() || value < 0.0 {
                return Err(Error::parameter(name, value, "0 or more"));
            }
        }
        Ok(())
    }
}
