//! Parameters of the soft-max classifier.

use super::Linear;
use crate::classification::learner::Learner;
use crate::classification::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Parameters of the soft-max classifier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinearParams {
    /// Inverse strength of the L2 penalty on the weights of the standardised features, above 0: the objective is
    /// c · Σ weight · cross-entropy + ½ Σ w², as in scikit-learn.
    pub c: f64,
    /// Most iterations of L-BFGS.
    pub iterations: usize,
    /// Training ends when no entry of the gradient of the mean loss is larger.
    pub tolerance: f64,
}

impl Default for LinearParams {
    fn default() -> Self {
        Self { c: 1.0, iterations: 300, tolerance: 1e-5 }
    }
}

impl LinearParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is out of range.
    pub fn validate(&self) -> Result<()> {
        let above = |name: &'static str, value: f64| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter(name, value, "above 0")),
        };
        above("linear.c", self.c)?;
        above("linear.tolerance", self.tolerance)?;
        match self.iterations {
            0 => Err(Error::parameter("linear.iterations", 0, "1 or more")),
            _ => Ok(()),
        }
    }
}

impl Learner for LinearParams {
    type Trained = Linear;

    fn seed(&mut self) -> Option<&mut u64> {
        None
    }

    fn max_depth(&mut self) -> Option<&mut Option<usize>> {
        None
    }

    fn train(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<Linear> {
        Linear::fit(samples, self, monitor)
    }
}
