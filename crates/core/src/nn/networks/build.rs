//! The initial parameters of a network.

use crate::error::{Error, Result};
use crate::nn::parameters::{ParameterId, Parameters, Role};
use crate::nn::scalar::Scalar;
use crate::nn::tape::LinearIds;
use crate::random::Stream;

/// Weights along an axis of all convolutions.
pub(super) const SIZE: usize = 3;

/// Parameters of a network, at most: 8 GiB of single precision.
const MOST: usize = 1 << 31;

/// A number of parameters; `None` if it overflows.
///
/// # Errors
/// If there are more than any network may have.
pub(super) fn limited(count: Option<usize>) -> Result<usize> {
    count.filter(|&count| count <= MOST).ok_or_else(|| {
        let found = count.map_or("more than 2^64".into(), |count| count.to_string());
        Error::input(format!("a network of {found} parameters (allowed: up to {MOST})"))
    })
}

/// Weights and biases of a layer from so many values to so many; `None` if their number overflows.
pub(super) fn affine(inputs: usize, outputs: usize) -> Option<usize> {
    inputs.checked_add(1)?.checked_mul(outputs)
}

/// Adds the parameters of a network.
pub(super) struct Builder<'a, T> {
    pub(super) parameters: &'a mut Parameters<T>,
    pub(super) draws: Stream,
    /// Standard deviation of the weights; `None`: √(2 / inputs).
    pub(super) deviation: Option<f64>,
}

impl<T: Scalar> Builder<'_, T> {
    pub(super) fn weights(&mut self, name: String, shape: &[usize], fan_in: usize) -> ParameterId {
        match self.deviation {
            None => self.parameters.drawn(name, shape, fan_in, &mut self.draws),
            Some(deviation) => self.parameters.drawn_within(name, shape, deviation, &mut self.draws),
        }
    }

    pub(super) fn linear(&mut self, name: &str, inputs: usize, outputs: usize) -> LinearIds {
        let weights = self.weights(format!("{name}.weights"), &[inputs, outputs], inputs);
        LinearIds { weights, bias: self.parameters.constant(format!("{name}.bias"), outputs, 0.0, Role::Bias) }
    }
}
