//! The adaptive density regulariser: weights are pushed down while a channel has more responses than allowed, and up while
//! it has fewer (Hackel 2018, section 6.3.5).

use super::filter::SparseFilter;
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Parameters of the regulariser λ/2 Σ (w + b)² of each output channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DensityParams {
    /// Strength λ, 0 or more.
    pub strength: f64,
    /// Upper bound ρ_up of the density, above 0, at most 1.
    pub density: f64,
    /// Penalty o for exceeding the bound, 0 or more.
    pub offset: f64,
    /// Factor b1 of the density above the bound, 0 or more.
    pub above: f64,
    /// Factor b2 of the density below the bound, 0 or more.
    pub below: f64,
    /// Share of the last b that is kept, 0 to below 1; 0: the formula of the paper, which has no smoothing.
    pub smoothing: f64,
    /// Whether the biases of the outputs are pushed, too.
    pub biases: bool,
}

impl Default for DensityParams {
    fn default() -> Self {
        Self { strength: 0.1, density: 1.0, offset: 0.1, above: 0.1, below: 0.1, smoothing: 0.95, biases: true }
    }
}

impl DensityParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        let numbers =
            [("strength", self.strength), ("offset", self.offset), ("above", self.above), ("below", self.below)];
        if let Some((name, value)) = numbers.into_iter().find(|(_, value)| !(0.0..f64::INFINITY).contains(value)) {
            return Err(Error::parameter(name, value, "0 or more"));
        }
        if !(self.density > 0.0 && self.density <= 1.0) {
            return Err(Error::parameter("density", self.density, "above 0, at most 1"));
        }
        match (0.0..1.0).contains(&self.smoothing) {
            true => Ok(()),
            false => Err(Error::parameter("smoothing", self.smoothing, "0 to below 1")),
        }
    }

    /// b of a channel of this density (eq. 6.6).
    pub fn bias(&self, density: f64) -> f64 {
        match density > self.density {
            true => self.offset + self.above * (density - self.density),
            false => -self.below * (self.density - density),
        }
    }
}

/// The regulariser of a layer: b of each output channel, which follows the densities of the responses.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityRegulariser {
    params: DensityParams,
    bias: Vec<f64>,
}

impl DensityRegulariser {
    /// For so many output channels.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(params: DensityParams, channels: usize) -> Result<Self> {
        params.validate()?;
        Ok(Self { params, bias: vec![0.0; channels] })
    }

    /// Follows the densities of the channels ([`Responses::densities`](super::Responses)).
    pub fn follow(&mut self, densities: &[f64]) {
        let DensityParams { smoothing, .. } = self.params;
        for (bias, &density) in self.bias.iter_mut().zip(densities) {
            *bias = smoothing * *bias + (1.0 - smoothing) * self.params.bias(density);
        }
    }

    /// b of each output channel.
    pub fn bias(&self) -> &[f64] {
        &self.bias
    }

    /// b of each output channel, to go on from a checkpoint.
    pub fn bias_mut(&mut self) -> &mut [f64] {
        &mut self.bias
    }

    /// The penalty of the stored weights.
    pub fn penalty<T: Scalar>(&self, filter: &SparseFilter<T>) -> f64 {
        let square = |(i, weight): (usize, &T)| (weight.wide() + self.bias[filter.output(i)]).powi(2);
        0.5 * self.params.strength * filter.values().iter().enumerate().map(square).sum::<f64>()
    }

    /// Adds the gradient of the penalty, λ (w + b), to that of the stored weights; b counts as constant.
    pub fn add_gradient<T: Scalar>(&self, filter: &SparseFilter<T>, gradient: &mut [T]) {
        for (i, (sum, &weight)) in gradient.iter_mut().zip(filter.values()).enumerate() {
            *sum += T::of(self.params.strength) * (weight + T::of(self.bias[filter.output(i)]));
        }
    }

    /// Adds the gradient of the same penalty of the biases of the outputs, if they are pushed.
    pub fn add_bias_gradient<T: Scalar>(&self, biases: &[T], gradient: &mut [T]) {
        if !self.params.biases {
            return;
        }
        for ((sum, &bias), &b) in gradient.iter_mut().zip(biases).zip(&self.bias) {
            *sum += T::of(self.params.strength) * (bias + T::of(b));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Shape, SparseTensor};
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};

    #[test]
    fn b_is_that_of_the_equation() {
        let params = DensityParams { density: 0.5, offset: 0.3, above: 2.0, below: 4.0, ..DensityParams::default() };
        assert!((params.bias(0.75) - 0.8).abs() < 1e-12);
        assert!((params.bias(0.25) + 1.0).abs() < 1e-12);
        assert_eq!(params.bias(0.5), 0.0);
        assert!(DensityParams { density: 0.0, ..params }.validate().unwrap_err().to_string().contains("density"));
        assert!(DensityParams { smoothing: 1.0, ..params }.validate().is_err());
        assert!(DensityParams { below: -1.0, ..params }.validate().unwrap_err().to_string().contains("below"));
    }

    #[test]
    fn weights_of_dense_channels_are_pushed_down_and_those_of_empty_ones_up() {
        let shape = Shape::new(2, 2, &[4]).unwrap();
        // Channel 0 is full in both samples, channel 1 empty.
        let responses = SparseTensor::new(shape, (0..4).chain(8..12).collect(), vec![1.0; 8]).unwrap();
        assert_eq!(responses.channel_densities(), [1.0, 0.0]);
        let params = DensityParams { density: 0.5, smoothing: 0.0, ..DensityParams::default() };
        let mut regulariser = DensityRegulariser::new(params, 2).unwrap();
        regulariser.follow(&responses.channel_densities());
        assert!((regulariser.bias()[0] - 0.15).abs() < 1e-12 && (regulariser.bias()[1] + 0.05).abs() < 1e-12);
        let filter = SparseFilter::of_dense([1, 2], 3, 1, numbers(1, 6)).unwrap().pruned(|i, _| i != 2);
        let mut gradient = vec![0.0; 5];
        regulariser.add_gradient(&filter, &mut gradient);
        let slopes = differences(filter.values(), 5, |values| {
            let mut moved = filter.clone();
            moved.values_mut().copy_from_slice(values);
            regulariser.penalty(&moved)
        });
        assert!(relative_error(&gradient, &slopes) < 1e-6);
        let mut of_biases = [1.0, 1.0];
        regulariser.add_bias_gradient(&[0.5, 0.25], &mut of_biases);
        let expected = [0, 1].map(|c| 1.0 + params.strength * ([0.5, 0.25][c] + regulariser.bias()[c]));
        assert_eq!(of_biases, expected);
        // A weight of 0 moves against b.
        let none = SparseFilter::of_dense([1, 2], 1, 1, vec![0.0; 2]).unwrap();
        let mut gradient = vec![0.0; 2];
        regulariser.add_gradient(&none, &mut gradient);
        assert!(gradient[0] > 0.0 && gradient[1] < 0.0);
        // Smoothed, b follows slowly.
        let mut slow = DensityRegulariser::new(DensityParams { smoothing: 0.95, ..params }, 2).unwrap();
        slow.follow(&responses.channel_densities());
        assert!((slow.bias()[0] - 0.05 * 0.15).abs() < 1e-12);
    }
}
