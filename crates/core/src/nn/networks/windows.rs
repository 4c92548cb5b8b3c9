//! The network of five branches that classifies a point by the occupied cells around it, at five scales.
//!
//! T. Hackel, *Large-scale machine learning for point cloud processing*, ETH Zurich 2018, section 5.4.3: each branch sees a
//! window of 16³ cells through three dense convolutions with max pooling; two fully connected layers join them.

use super::build::{Builder, limited};
use super::connected::{Connected, ConnectedPass, Mode, Widths};
use super::levels::{Levels, LevelsPass, ObjectLevel, Size, Weights};
use crate::error::{Error, Result};
use crate::nn::objects::ObjectShape;
use crate::nn::parameters::{Gradients, ParameterId, Parameters};
use crate::nn::scalar::Scalar;
use crate::nn::sparse::SparseTensor;
use crate::parallel::Monitor;
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// Shape of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowNetParams {
    /// Number of scales, 1 to 10; the cells of each are twice as long as those of the one before.
    pub scales: usize,
    /// Cells along each side of a window, 4 to 64.
    pub window: usize,
    /// Channels of the convolutions of a branch, 1 to 512 each; max pooling halves the window after each.
    pub channels: Vec<usize>,
    /// Channels of the fully connected layer before the classes, 1 to 65,536.
    pub hidden: usize,
    /// Share of these channels that is dropped in training, 0 to below 1.
    pub dropout: f64,
}

impl Default for WindowNetParams {
    fn default() -> Self {
        Self { scales: 5, window: 16, channels: vec![16, 32, 64], hidden: 2048, dropout: 0.5 }
    }
}

impl WindowNetParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        let whole = |name: &'static str, value: usize, range: std::ops::RangeInclusive<usize>| {
            let allowed = format!("{} to {}", range.start(), range.end());
            if range.contains(&value) { Ok(()) } else { Err(Error::parameter(name, value, allowed)) }
        };
        whole("network.scales", self.scales, 1..=10)?;
        whole("network.window", self.window, 4..=64)?;
        whole("number of network.channels", self.channels.len(), 1..=self.window.ilog2() as usize)?;
        self.channels.iter().try_for_each(|&channels| whole("network.channels", channels, 1..=512))?;
        whole("network.hidden", self.hidden, 1..=1 << 16)?;
        match (0.0..1.0).contains(&self.dropout) {
            true => Ok(()),
            false => Err(Error::parameter("network.dropout", self.dropout, "0 to below 1")),
        }
    }

    /// Number of parameters for so many classes; nothing is allocated.
    ///
    /// # Errors
    /// If a value is out of range, there are fewer than two classes, or more than 2^31 parameters.
    pub fn parameters(&self, classes: usize) -> Result<usize> {
        self.validate()?;
        if classes < 2 {
            return Err(Error::input(format!("{classes} classes (allowed: 2 or more)")));
        }
        limited(Size::of(&self.levels(), &self.shape()).and_then(|size| {
            let inputs = size.flat.checked_mul(self.scales)?;
            let connected = Widths { inputs, hidden: self.hidden, classes }.parameters()?;
            size.parameters.checked_mul(self.scales)?.checked_add(connected)
        }))
    }

    /// The levels of a branch.
    fn levels(&self) -> Vec<ObjectLevel> {
        self.channels.iter().map(|&channels| ObjectLevel { channels: vec![channels], density: None }).collect()
    }

    /// The shape of a window.
    fn shape(&self) -> ObjectShape {
        ObjectShape { channels: 1, extent: vec![self.window; 3] }
    }
}

/// A network: which parameter is used where.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowNet {
    branches: Vec<Levels>,
    connected: Connected,
    hidden: usize,
}

impl WindowNet {
    /// A network and its parameters at the start.
    ///
    /// # Errors
    /// As [`WindowNetParams::parameters`].
    pub fn new<T: Scalar>(params: &WindowNetParams, classes: usize, seed: u64) -> Result<(Self, Parameters<T>)> {
        params.parameters(classes)?;
        let mut parameters = Parameters::default();
        let mut build = Builder { parameters: &mut parameters, draws: stream(seed, 0), deviation: None };
        let (levels, shape) = (params.levels(), params.shape());
        let branch = |number| Levels::new(&mut build, &format!("branch{number}."), &levels, &shape);
        let branches: Vec<Levels> = (0..params.scales).map(branch).collect();
        let inputs = branches.iter().map(|branch| branch.flat).sum();
        let widths = Widths { inputs, hidden: params.hidden, classes };
        let connected = Connected::new(&mut build, widths, params.dropout);
        Ok((Self { branches, connected, hidden: params.hidden }, parameters))
    }

    /// Number of channels before the scores.
    pub fn width(&self) -> usize {
        self.hidden
    }

    /// The matrix and the biases of the scores.
    pub fn head(&self) -> [ParameterId; 2] {
        [self.connected.head.weights, self.connected.head.bias]
    }

    /// Passes windows through the network: for each scale a tensor of shape (samples, 1, window, window, window).
    ///
    /// # Errors
    /// If the windows do not fit the network, or the work was cancelled.
    pub fn pass<'a, T: Scalar>(
        &'a self,
        parameters: &'a Parameters<T>,
        windows: Vec<SparseTensor<T>>,
        mode: Mode<'_>,
        monitor: &Monitor,
    ) -> Result<WindowPass<'a, T>> {
        if windows.len() != self.branches.len() {
            let found = format!("windows of {} scales (allowed: {})", windows.len(), self.branches.len());
            return Err(Error::input(found));
        }
        let weights = Weights { parameters, kept: &[] };
        let pass = |(branch, window): (&'a Levels, _)| branch.pass(weights, window, monitor);
        let branches = self.branches.iter().zip(windows).map(pass).collect::<Result<Vec<_>>>()?;
        let widths: Vec<usize> = self.branches.iter().map(|branch| branch.flat).collect();
        let samples = branches[0].flat.len() / widths[0];
        let mut flat = Vec::with_capacity(samples * widths.iter().sum::<usize>());
        for sample in 0..samples {
            for (branch, &width) in branches.iter().zip(&widths) {
                flat.extend_from_slice(&branch.flat[sample * width..][..width]);
            }
        }
        let connected = self.connected.pass(parameters, flat, mode, monitor)?;
        Ok(WindowPass { branches, widths, connected, gradients: parameters.no_gradients() })
    }
}

/// A pass of windows.
pub struct WindowPass<'a, T> {
    branches: Vec<LevelsPass<'a, T>>,
    /// Values of a sample from each branch.
    widths: Vec<usize>,
    connected: ConnectedPass<'a, T>,
    gradients: Gradients<T>,
}

impl<T: Scalar> WindowPass<'_, T> {
    /// The scores of the classes, a row a sample.
    pub fn scores(&self) -> &[T] {
        &self.connected.scores
    }

    /// The channels before the scores, a row a sample.
    pub fn into_hidden(self) -> Vec<T> {
        self.connected.hidden
    }

    /// The gradients of all parameters, given that with respect to the scores.
    ///
    /// # Errors
    /// If the lengths differ, or the work was cancelled.
    pub fn backward(self, gradient: &[T], monitor: &Monitor) -> Result<Gradients<T>> {
        let Self { branches, widths, connected, mut gradients } = self;
        let towards = connected.backward(gradient, &mut gradients, monitor)?;
        let row: usize = widths.iter().sum();
        let mut first = 0;
        for (branch, width) in branches.into_iter().zip(widths) {
            let own = towards.chunks_exact(row).flat_map(|sample| &sample[first..first + width]).copied().collect();
            branch.backward(own, &mut gradients, monitor)?;
            first += width;
        }
        Ok(gradients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::layers::cross_entropy;
    use crate::nn::sparse::Shape;
    use crate::nn::testing::{differences, numbers, relative_error};

    #[test]
    fn the_network_of_the_thesis_has_its_number_of_parameters() {
        let (net, parameters) = WindowNet::new::<f32>(&WindowNetParams::default(), 8, 1).unwrap();
        let branch =
            parameters.iter().filter(|p| p.name.starts_with("branch3.")).map(|p| p.values.len()).sum::<usize>();
        assert_eq!((branch, parameters.trained(), net.width()), (69_664, 5_609_640, 2048));
        assert_eq!(WindowNetParams::default().parameters(8).unwrap(), 5_609_640);
        let large = WindowNetParams { window: 64, channels: vec![512], hidden: 1 << 16, ..WindowNetParams::default() };
        assert!(WindowNet::new::<f32>(&large, 8, 1).unwrap_err().to_string().contains("allowed: up to 2147483648"));
        let wrong = WindowNetParams { channels: vec![4; 5], ..WindowNetParams::default() };
        assert!(wrong.validate().unwrap_err().to_string().contains("1 to 4"));
        assert!(WindowNet::new::<f32>(&WindowNetParams::default(), 1, 1).is_err());
    }

    #[test]
    fn gradients_of_all_parameters_are_those_of_finite_differences() {
        let monitor = Monitor::default();
        let params = WindowNetParams { scales: 2, window: 4, channels: vec![3, 2], hidden: 5, dropout: 0.0 };
        let (net, parameters) = WindowNet::new::<f64>(&params, 3, 4).unwrap();
        let window = |seed: u64| {
            let keys: Vec<u64> = (0..128).filter(|key| !(key + seed).is_multiple_of(3)).collect();
            let values = numbers(seed, keys.len()).iter().map(|v| v + 1.5).collect();
            SparseTensor::new(Shape::new(2, 1, &[4, 4, 4]).unwrap(), keys, values).unwrap()
        };
        let windows = vec![window(1), window(2)];
        let targets = [0.0, 1.0, 0.0, 0.5, 0.0, 0.0];
        let pass = |parameters: &Parameters<f64>| {
            let pass = net.pass(parameters, windows.clone(), Mode::Prediction, &monitor).unwrap();
            let loss = cross_entropy(pass.scores(), &targets, 3);
            (loss.value, pass.backward(&loss.gradient, &monitor).unwrap())
        };
        let (_, gradients) = pass(&parameters);
        for (number, (parameter, gradient)) in parameters.iter().zip(&gradients).enumerate() {
            let slopes = differences(&parameter.values, 25, |values| {
                let mut moved = parameters.clone();
                moved.iter_mut().nth(number).unwrap().values.copy_from_slice(values);
                pass(&moved).0
            });
            assert!(relative_error(gradient, &slopes) < 1e-6, "{}", parameter.name);
        }
        assert!(net.pass(&parameters, windows[..1].to_vec(), Mode::Prediction, &monitor).is_err());
    }
}
