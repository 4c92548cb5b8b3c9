//! The parameters of a network at the start.

use crate::nn::parameters::{ParameterId, Parameters, Role};
use crate::nn::scalar::Scalar;
use crate::nn::tape::LinearIds;
use crate::random::Stream;

/// Weights along an axis of all convolutions.
pub(super) const SIZE: usize = 3;

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
