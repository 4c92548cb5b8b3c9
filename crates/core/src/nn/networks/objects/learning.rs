//! Settings of the training of a network on objects.

use crate::error::{Error, Result};
use crate::nn::objects::ObjectAugmentation;
use crate::nn::sparse::{DensityParams, Pruning};
use crate::nn::training::{Optimiser, Schedule};
use serde::{Deserialize, Serialize};

/// Epochs, at most.
pub(super) const MOST_EPOCHS: usize = 1_000_000_000;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectLearning {
    /// Passes through all samples, 1 to 1,000,000,000.
    pub epochs: usize,
    /// Samples in a step, 1 to 65,536.
    pub batch: usize,
    /// Highest learning rate, above 0.
    pub rate: f64,
    /// How the rate changes: `constant`, `cosine` or `linear`.
    pub schedule: Schedule,
    /// The optimiser.
    pub optimiser: Optimiser,
    /// The density regulariser of sparse convolutions; each has the bound of its level. Strength 0: none.
    pub regulariser: DensityParams,
    /// Sparse weights below this magnitude at two ends of epochs in a row are removed, 0 or more; 0: none is.
    pub pruning: f64,
    /// Weight of a class: its share of the samples to the power of minus this, 0 to 1.
    pub balance: f64,
    /// How samples are changed.
    pub augment: ObjectAugmentation,
    /// Seed of all random draws.
    pub seed: u64,
}

impl Default for ObjectLearning {
    fn default() -> Self {
        Self {
            epochs: 30,
            batch: 32,
            rate: 0.01,
            schedule: Schedule::Constant,
            optimiser: Optimiser::Adagrad { epsilon: 1e-10 },
            regulariser: DensityParams { strength: 0.0, ..DensityParams::default() },
            pruning: 0.0,
            balance: 0.0,
            augment: ObjectAugmentation::default(),
            seed: 0,
        }
    }
}

impl ObjectLearning {
    /// The defaults for the network for MNIST: AdamW at a rate that falls, and digits that are shifted by up to a cell, but not
    /// turned, as a 6 would become a 9.
    pub fn mnist() -> Self {
        let augment = ObjectAugmentation { turn: false, shift: 1, ..ObjectAugmentation::default() };
        let optimiser = Optimiser::default();
        Self { rate: 0.002, schedule: Schedule::Cosine, optimiser, augment, ..Self::default() }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        let check = |name: &'static str, value: f64, fine: bool, expected: &str| match fine {
            true => Ok(()),
            false => Err(Error::parameter(name, value, expected)),
        };
        check("epochs", self.epochs as f64, (1..=MOST_EPOCHS).contains(&self.epochs), "1 to 1000000000")?;
        check("batch", self.batch as f64, (1..=1 << 16).contains(&self.batch), "1 to 65536")?;
        check("rate", self.rate, self.rate > 0.0 && self.rate.is_finite(), "above 0")?;
        check("balance", self.balance, (0.0..=1.0).contains(&self.balance), "0 to 1")?;
        Pruning::new(self.pruning)?;
        self.regulariser.validate()?;
        self.optimiser.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_not_turned() {
        assert!(!ObjectLearning::mnist().augment.turn && ObjectLearning::default().augment.turn);
        assert!(ObjectLearning { epochs: usize::MAX, ..ObjectLearning::default() }.validate().is_err());
    }
}
