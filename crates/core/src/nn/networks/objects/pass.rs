//! A pass of a batch through a network for objects, forward and backward.

use super::ObjectNet;
use crate::error::Result;
use crate::nn::networks::connected::{ConnectedPass, Mode};
use crate::nn::networks::levels::{LevelsPass, Weights};
use crate::nn::parameters::Gradients;
use crate::nn::scalar::Scalar;
use crate::nn::sparse::SparseTensor;
use crate::parallel::Monitor;

/// A pass of a batch.
pub struct Pass<'a, T> {
    levels: LevelsPass<'a, T>,
    connected: ConnectedPass<'a, T>,
    gradients: Gradients<T>,
}

impl ObjectNet {
    /// Passes a batch through the network; `kept` are the weights of each sparse convolution that are left, all if there are
    /// none.
    ///
    /// # Errors
    /// If the batch does not fit the network, or the work was cancelled.
    pub fn pass<'a, T: Scalar>(
        &'a self,
        weights: Weights<'a, T>,
        batch: SparseTensor<T>,
        mode: Mode<'_>,
        monitor: &Monitor,
    ) -> Result<Pass<'a, T>> {
        let mut levels = self.levels.pass(weights, batch, monitor)?;
        let flat = std::mem::take(&mut levels.flat);
        let connected = self.connected.pass(weights.parameters, flat, mode, monitor)?;
        Ok(Pass { levels, connected, gradients: weights.parameters.no_gradients() })
    }
}

impl<T: Scalar> Pass<'_, T> {
    /// The scores of the classes, a row a sample.
    pub fn scores(&self) -> &[T] {
        &self.connected.scores
    }

    /// For each sparse convolution the densities of its channels before the strongest were selected.
    pub fn densities(&self) -> &[Vec<f64>] {
        &self.levels.densities
    }

    /// Bytes of the sparse tensors that are kept for the gradients.
    pub fn sparse_bytes(&self) -> usize {
        self.levels.sparse_bytes()
    }

    /// The gradients of all parameters, given that with respect to the scores; those of removed weights are 0.
    ///
    /// # Errors
    /// If the lengths differ, or the work was cancelled.
    pub fn backward(self, gradient: &[T], monitor: &Monitor) -> Result<Gradients<T>> {
        let Self { levels, connected, mut gradients } = self;
        let towards = connected.backward(gradient, &mut gradients, monitor)?;
        levels.backward(towards, &mut gradients, monitor)?;
        Ok(gradients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::layers::cross_entropy;
    use crate::nn::networks::Kept;
    use crate::nn::networks::{ObjectLevel, ObjectNetParams};
    use crate::nn::objects::ObjectShape;
    use crate::nn::parameters::Parameters;
    use crate::nn::sparse::{Attention, Shape};
    use crate::nn::testing::{differences, numbers, relative_error};

    /// A small network of two sparse levels and a dense one, on a batch of 2.
    fn small(attention: Attention) -> (ObjectNetParams, SparseTensor<f64>) {
        let level = |channels: &[usize], density| ObjectLevel { channels: channels.to_vec(), density };
        let params = ObjectNetParams {
            levels: vec![level(&[3, 2], Some(0.5)), level(&[3], Some(0.8)), level(&[2], None)],
            attention,
            hidden: 5,
            dropout: 0.0,
            deviation: None,
        };
        let shape = Shape::new(2, 1, &[8, 9]).unwrap();
        let values = numbers(5, 144);
        let keys = (0..144).filter(|key| key % 3 != 1).collect::<Vec<u64>>();
        let values = keys.iter().map(|&key| values[key as usize] + 1.5).collect();
        (params, SparseTensor::new(shape, keys, values).unwrap())
    }

    #[test]
    fn gradients_of_all_parameters_are_those_of_finite_differences() {
        let monitor = Monitor::default();
        for attention in [Attention::Positive, Attention::Magnitude] {
            for twin in [false, true] {
                let (params, batch) = small(attention);
                let params = if twin { params.dense_twin() } else { params };
                let shape = ObjectShape { channels: 1, extent: vec![8, 9] };
                let (net, parameters) = ObjectNet::new::<f64>(&params, &shape, 3, 11).unwrap();
                let targets = [0.0, 1.0, 0.0, 0.5, 0.0, 0.0];
                let loss = |parameters: &Parameters<f64>| {
                    let weights = Weights { parameters, kept: &[] };
                    let pass = net.pass(weights, batch.clone(), Mode::Prediction, &monitor).unwrap();
                    cross_entropy(pass.scores(), &targets, 3).value
                };
                let weights = Weights { parameters: &parameters, kept: &[] };
                let pass = net.pass(weights, batch.clone(), Mode::Prediction, &monitor).unwrap();
                let towards = cross_entropy(pass.scores(), &targets, 3).gradient;
                let gradients = pass.backward(&towards, &monitor).unwrap();
                for (number, (parameter, gradient)) in parameters.iter().zip(&gradients).enumerate() {
                    let slopes = differences(&parameter.values, 25, |values| {
                        let mut moved = parameters.clone();
                        moved.iter_mut().nth(number).unwrap().values.copy_from_slice(values);
                        loss(&moved)
                    });
                    assert!(relative_error(gradient, &slopes) < 1e-6, "{} {attention:?} {twin}", parameter.name);
                }
            }
        }
    }

    #[test]
    fn without_bias_and_bound_the_sparse_network_is_its_dense_twin() {
        for attention in [Attention::Positive, Attention::Magnitude] {
            let (mut params, batch) = small(attention);
            params.levels.iter_mut().take(2).for_each(|level| level.density = Some(1.0));
            let shape = ObjectShape { channels: 1, extent: vec![8, 9] };
            let (net, parameters) = ObjectNet::new::<f64>(&params, &shape, 3, 11).unwrap();
            let (twin, _) = ObjectNet::new::<f64>(&params.dense_twin(), &shape, 3, 11).unwrap();
            let weights = Weights { parameters: &parameters, kept: &[] };
            let scores = |net: &ObjectNet| {
                net.pass(weights, batch.clone(), Mode::Prediction, &Monitor::default()).unwrap().scores().to_vec()
            };
            assert!(scores(&net).iter().zip(scores(&twin)).all(|(a, b)| (a - b).abs() < 1e-12), "{attention:?}");
        }
    }

    #[test]
    fn removed_weights_respond_to_nothing_and_have_no_gradient() {
        let (params, batch) = small(Attention::Positive);
        let shape = ObjectShape { channels: 1, extent: vec![8, 9] };
        let (net, parameters) = ObjectNet::new::<f64>(&params, &shape, 3, 11).unwrap();
        let ids = net.sparse_weights();
        let kept: Vec<Kept> =
            ids.iter().map(|&id| (0..parameters.get(id).len() as u64).filter(|key| key % 2 == 0).collect()).collect();
        let weights = Weights { parameters: &parameters, kept: &kept };
        let monitor = Monitor::default();
        let pass = net.pass(weights, batch.clone(), Mode::Prediction, &monitor).unwrap();
        // The same as with these weights at 0.
        let mut zeroed = parameters.clone();
        for &id in &ids {
            zeroed.get_mut(id).iter_mut().skip(1).step_by(2).for_each(|w| *w = 0.0);
        }
        let all = Weights { parameters: &zeroed, kept: &[] };
        let same = net.pass(all, batch, Mode::Prediction, &monitor).unwrap();
        assert!(pass.scores().iter().zip(same.scores()).all(|(a, b)| (a - b).abs() < 1e-12));
        let gradients = pass.backward(&[1.0; 6], &monitor).unwrap();
        let first = &gradients[0];
        assert!(first.iter().skip(1).step_by(2).all(|g| *g == 0.0) && first.iter().any(|g| *g != 0.0));
    }
}
