//! Networks that classify whole objects by direct sparse convolutions, and their dense twins.
//!
//! T. Hackel, *Large-scale machine learning for point cloud processing*, ETH Zurich 2018, chapter 6: levels of convolutions
//! with attention and max pooling, then two fully connected layers.

mod fit;
#[cfg(test)]
mod fit_tests;
mod learning;
mod model;
mod pass;
mod preset;

pub use fit::{EpochReport, ObjectTraining};
pub use learning::ObjectLearning;
pub use model::{LabelKind, ObjectModel, ObjectModelAbout};
pub use pass::Pass;
pub use preset::ObjectPreset;

use crate::error::{Error, Result};
use crate::nn::networks::build::{Builder, limited};
use crate::nn::networks::connected::{Connected, Widths};
use crate::nn::networks::levels::{Levels, ObjectLevel, Size};
use crate::nn::objects::ObjectShape;
use crate::nn::parameters::{ParameterId, Parameters};
use crate::nn::scalar::Scalar;
use crate::nn::sparse::{Attention, Shape};
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// Shape of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectNetParams {
    /// The levels; sparse ones before dense ones.
    pub levels: Vec<ObjectLevel>,
    /// Which responses of sparse levels are kept.
    pub attention: Attention,
    /// Channels of the fully connected layer before the classes, 1 to 65,536.
    pub hidden: usize,
    /// Share of these channels that is dropped in training, 0 to below 1.
    pub dropout: f64,
    /// Standard deviation of the weights at the start, cut off at twice as much; `None` (`"none"`): √(2 / inputs), after He
    /// et al. 2015.
    #[serde(with = "crate::settings::optional")]
    pub deviation: Option<f64>,
}

impl Default for ObjectNetParams {
    fn default() -> Self {
        Self::modelnet(32)
    }
}

impl ObjectNetParams {
    /// The loosest bound of density of the network for MNIST.
    pub const MNIST_DENSITY: f64 = 0.095;

    /// The network of the thesis for ModelNet in cubes of so many cells along each axis: nine sparse convolutions with the
    /// bounds of density of that resolution, and three dense ones.
    pub fn modelnet(resolution: usize) -> Self {
        let densities = match resolution {
            ..=16 => [0.33, 0.66, 1.0],
            17..=32 => [0.14, 0.33, 0.66],
            33..=64 => [0.06, 0.14, 0.33],
            65.. => [0.02, 0.06, 0.14],
        };
        let sparse = densities.into_iter().zip([8, 16, 24]);
        let mut levels: Vec<ObjectLevel> = sparse
            .map(|(density, channels)| ObjectLevel { channels: vec![channels; 3], density: Some(density) })
            .collect();
        levels.push(ObjectLevel { channels: vec![32; 3], density: None });
        Self { levels, attention: Attention::Positive, hidden: 1024, dropout: 0.5, deviation: None }
    }

    /// The network of the thesis for MNIST.
    pub fn mnist(density: f64) -> Self {
        let level = |channels: usize| ObjectLevel { channels: vec![channels; 3], density: Some(density) };
        Self { levels: vec![level(8), level(16)], hidden: 512, ..Self::modelnet(32) }
    }

    /// The same network with dense convolutions only.
    #[must_use]
    pub fn dense_twin(mut self) -> Self {
        self.levels.iter_mut().for_each(|level| level.density = None);
        self
    }

    /// Checks the ranges for samples of a shape.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self, shape: &ObjectShape) -> Result<()> {
        Shape::new(1, shape.channels, &shape.extent)?;
        let shortest = shape.extent.iter().copied().min().unwrap_or(0);
        let most = shortest.checked_ilog2().unwrap_or(0) as usize;
        if self.levels.is_empty() || self.levels.len() > most {
            let allowed = format!("1 to {most}, as each halves {:?} cells", shape.extent);
            return Err(Error::parameter("levels", self.levels.len(), allowed));
        }
        for (level, next) in self.levels.iter().zip(self.levels.iter().skip(1).map(Some).chain([None])) {
            if level.channels.is_empty() || level.channels.iter().any(|c| !(1..=512).contains(c)) {
                return Err(Error::parameter("channels", format!("{:?}", level.channels), "one or more from 1 to 512"));
            }
            if let Some(density) = level.density.filter(|density| !(*density > 0.0 && *density <= 1.0)) {
                return Err(Error::parameter("density", density, "above 0, at most 1, or none"));
            }
            if level.density.is_none() && next.is_some_and(|next| next.density.is_some()) {
                return Err(Error::parameter("density", "a sparse level after a dense one", "sparse levels first"));
            }
        }
        if !(1..=1 << 16).contains(&self.hidden) {
            return Err(Error::parameter("hidden", self.hidden, "1 to 65536"));
        }
        if let Some(deviation) = self.deviation.filter(|d| !(*d > 0.0 && *d <= 10.0)) {
            return Err(Error::parameter("deviation", deviation, "above 0, at most 10, or none"));
        }
        match (0.0..1.0).contains(&self.dropout) {
            true => Ok(()),
            false => Err(Error::parameter("dropout", self.dropout, "0 to below 1")),
        }
    }

    /// Number of parameters for samples of a shape and so many classes; nothing is allocated.
    ///
    /// # Errors
    /// If a value is out of range, there are fewer than two classes, or more than 2^31 parameters.
    pub fn parameters(&self, shape: &ObjectShape, classes: usize) -> Result<usize> {
        self.validate(shape)?;
        if classes < 2 {
            return Err(Error::input(format!("{classes} classes (allowed: 2 or more)")));
        }
        limited(Size::of(&self.levels, shape).and_then(|size| {
            let connected = Widths { inputs: size.flat, hidden: self.hidden, classes };
            connected.parameters()?.checked_add(size.parameters)
        }))
    }
}

/// A network: which parameter is used where.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectNet {
    levels: Levels,
    connected: Connected,
    classes: usize,
}

impl ObjectNet {
    /// A network and its parameters at the start.
    ///
    /// # Errors
    /// As [`ObjectNetParams::parameters`].
    pub fn new<T: Scalar>(
        params: &ObjectNetParams,
        shape: &ObjectShape,
        classes: usize,
        seed: u64,
    ) -> Result<(Self, Parameters<T>)> {
        params.parameters(shape, classes)?;
        let mut parameters = Parameters::default();
        let draws = stream(seed, 0);
        let mut build = Builder { parameters: &mut parameters, draws, deviation: params.deviation };
        let levels = Levels::new(&mut build, "", &params.levels, shape).with_attention(params.attention);
        let widths = Widths { inputs: levels.flat, hidden: params.hidden, classes };
        let connected = Connected::new(&mut build, widths, params.dropout);
        Ok((Self { levels, connected, classes }, parameters))
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// The weights of each sparse convolution, in their order.
    pub fn sparse_weights(&self) -> Vec<ParameterId> {
        self.levels.sparse_weights()
    }

    /// Biases of the sparse convolutions.
    pub fn sparse_biases(&self) -> Vec<ParameterId> {
        self.levels.sparse_biases()
    }

    /// Upper bound of the density of each sparse convolution.
    pub fn densities(&self) -> Vec<f64> {
        self.levels.densities()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::parameters::Role;

    fn cube(edge: usize) -> ObjectShape {
        ObjectShape { channels: 1, extent: vec![edge; 3] }
    }

    #[test]
    fn the_networks_of_the_thesis_have_their_numbers_of_parameters() {
        let (net, parameters) = ObjectNet::new::<f32>(&ObjectNetParams::modelnet(64), &cube(64), 40, 1).unwrap();
        let convolutions = |pairs: [[usize; 2]; 3]| pairs.iter().map(|[i, o]| 27 * i * o + o).sum::<usize>();
        let expected = convolutions([[1, 8], [8, 8], [8, 8]])
            + convolutions([[8, 16], [16, 16], [16, 16]])
            + convolutions([[16, 24], [24, 24], [24, 24]])
            + convolutions([[24, 32], [32, 32], [32, 32]])
            + (4 * 4 * 4 * 32 + 1) * 1024
            + 1025 * 40;
        assert_eq!((parameters.trained(), net.sparse_weights().len()), (expected, 9));
        assert_eq!(ObjectNetParams::modelnet(64).parameters(&cube(64), 40).unwrap(), expected);
        let image = ObjectShape { channels: 1, extent: vec![28, 28] };
        let (net, parameters) = ObjectNet::new::<f32>(&ObjectNetParams::mnist(0.05), &image, 10, 1).unwrap();
        let planes = [[1, 8], [8, 8], [8, 8], [8, 16], [16, 16], [16, 16]];
        let expected = planes.iter().map(|[i, o]| 9 * i * o + o).sum::<usize>() + (7 * 7 * 16 + 1) * 512 + 513 * 10;
        assert_eq!((parameters.trained(), net.densities()), (expected, vec![0.05; 6]));
    }

    #[test]
    fn weights_at_the_start_stay_within_two_deviations() {
        let params = ObjectNetParams { deviation: Some(0.1), ..ObjectNetParams::modelnet(16) };
        let (_, parameters) = ObjectNet::new::<f64>(&params, &cube(16), 3, 1).unwrap();
        let weights: Vec<f64> =
            parameters.iter().filter(|p| p.role == Role::Weight).flat_map(|p| p.values.clone()).collect();
        let variance = weights.iter().map(|w| w * w).sum::<f64>() / weights.len() as f64;
        // The standard deviation of a normal distribution that is cut off at 2 is 0.8796.
        assert!(weights.iter().all(|w| w.abs() <= 0.2) && (variance.sqrt() - 0.08796).abs() < 1e-3);
    }

    #[test]
    fn values_out_of_range_are_named() {
        let message = |params: ObjectNetParams| params.validate(&cube(8)).unwrap_err().to_string();
        assert!(message(ObjectNetParams::modelnet(8)).contains("levels"));
        let fine = ObjectNetParams { levels: ObjectNetParams::modelnet(8).levels[..3].to_vec(), ..Default::default() };
        assert!(fine.validate(&cube(8)).is_ok());
        let mut wrong = fine.clone();
        wrong.levels[0].density = None;
        assert!(message(wrong).contains("sparse levels first"));
        let mut wrong = fine.clone();
        wrong.levels[1].density = Some(1.5);
        assert!(message(wrong).contains("density"));
        assert!(message(ObjectNetParams { dropout: 1.0, ..fine.clone() }).contains("dropout"));
        assert!(message(ObjectNetParams { hidden: 0, ..fine }).contains("hidden"));
    }

    #[test]
    fn networks_too_large_for_any_memory_are_refused_before_they_are_built() {
        let refused = |channels: usize, extent: Vec<usize>| {
            let shape = ObjectShape { channels, extent };
            ObjectNet::new::<f32>(&ObjectNetParams::modelnet(64), &shape, 40, 1).unwrap_err().to_string()
        };
        assert!(refused(1, vec![1 << 12; 3]).contains("parameters (allowed: up to 2147483648)"));
        assert!(refused(1, vec![usize::MAX; 3]).contains("do not fit"));
        assert!(refused(usize::MAX / 8, vec![16]).contains("do not fit"));
        assert!(refused(1 << 62, vec![1]).contains("levels"));
        assert!(refused(1, vec![16; 5]).contains("1 to 4 axes") && refused(0, vec![16]).contains("no length 0"));
        // Its cells can be numbered, but the weights can not.
        assert!(refused((1 << 59) - 1, vec![16]).contains("parameters (allowed: up to 2147483648)"));
        assert!(refused(1, vec![1 << 58]).contains("more than 2^64 parameters"));
    }
}
