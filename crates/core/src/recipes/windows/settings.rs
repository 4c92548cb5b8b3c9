//! Settings of the recipe: where windows lie, and how the network is trained.

use crate::error::{Error, Result};
use crate::nn::training::{Optimiser, Schedule};
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WindowsKind {
    /// The only one.
    #[default]
    Windows,
}

/// How the windows lie around a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// Windows of the cells of one grid a scale: with 16 cells, from 8 below the cell of the point to 7 above it. The points
    /// of a finest cell share their windows.
    #[default]
    Grid,
    /// Windows whose centre is the point itself, as the thesis prints.
    Centred,
    /// As `grid`, but symmetric: with 16 cells, from 7 below the cell of the point to 7 above it, and its own cell twice
    /// along each axis, as the program of the thesis has them.
    Doubled,
}

/// How the network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowsLearning {
    /// Number of steps, 1 or more.
    pub steps: usize,
    /// Points in a step, 1 to 4096.
    pub batch: usize,
    /// Highest learning rate, above 0.
    pub rate: f64,
    /// How the rate changes: `cosine`, `linear` or `constant`.
    pub schedule: Schedule,
    /// The optimiser.
    pub optimiser: Optimiser,
    /// After this many steps the clouds are turned about the vertical by random angles and put into cells again; 0: never.
    pub turn_every: usize,
}

impl Default for WindowsLearning {
    fn default() -> Self {
        Self {
            steps: 150,
            batch: 100,
            rate: 1e-3,
            schedule: Schedule::default(),
            optimiser: Optimiser::default(),
            turn_every: 100,
        }
    }
}

impl WindowsLearning {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        if self.steps == 0 {
            return Err(Error::parameter("learning.steps", 0, "1 or more"));
        }
        if !(1..=4096).contains(&self.batch) {
            return Err(Error::parameter("learning.batch", self.batch, "1 to 4096 points"));
        }
        if !(self.rate > 0.0 && self.rate.is_finite()) {
            return Err(Error::parameter("learning.rate", self.rate, "above 0"));
        }
        self.optimiser.validate()
    }
}
