//! A trained network with the shape of its samples: what is saved and classifies.

use super::{ObjectNet, ObjectNetParams};
use crate::error::{Error, Result};
use crate::nn::arrays::{Array, Arrays};
use crate::nn::layers::softmax;
use crate::nn::networks::connected::Mode;
use crate::nn::networks::levels::{Kept, Weights};
use crate::nn::objects::{ObjectAugmentation, ObjectShape, Objects};
use crate::nn::parameters::Parameters;
use crate::parallel::Monitor;
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// Samples that are classified together.
const BATCH: usize = 64;

/// A network that classifies objects.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectModel {
    /// What it is made of.
    pub about: ObjectModelAbout,
    /// The parameters.
    pub parameters: Parameters<f32>,
    /// The weights of each sparse convolution that are left; empty: all.
    pub kept: Vec<Kept>,
}

/// Shape of a network and of its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectModelAbout {
    /// The network.
    pub network: ObjectNetParams,
    /// The samples.
    pub shape: ObjectShape,
    /// Names of the classes.
    pub classes: Vec<String>,
}

impl ObjectModel {
    /// The probabilities of the classes, a row a sample.
    ///
    /// # Errors
    /// If the samples have another shape, or the work was cancelled.
    pub fn predict_proba(&self, objects: &Objects, monitor: &Monitor) -> Result<Vec<f32>> {
        objects.validate()?;
        let ObjectModelAbout { network, shape, classes } = &self.about;
        if objects.shape != *shape {
            let allowed = format!("{} channels, {:?} cells", shape.channels, shape.extent);
            let found = format!("{} channels, {:?} cells", objects.shape.channels, objects.shape.extent);
            return Err(Error::input(format!("samples of {found} (allowed: {allowed})")));
        }
        let classes = classes.len();
        let (net, _) = ObjectNet::new::<f32>(network, shape, classes, 0)?;
        let weights = Weights { parameters: &self.parameters, kept: &self.kept };
        let numbers: Vec<usize> = (0..objects.samples.len()).collect();
        monitor.stage("classify", numbers.len() as u64);
        let mut found = Vec::with_capacity(numbers.len() * classes);
        for numbers in numbers.chunks(BATCH) {
            let batch = objects.batch(numbers, &ObjectAugmentation::NONE, &mut stream(0, 0))?;
            let mut scores = net.pass(weights, batch, Mode::Prediction, monitor)?.scores().to_vec();
            softmax(&mut scores, classes);
            found.extend_from_slice(&scores);
            monitor.advance(numbers.len() as u64);
        }
        Ok(found)
    }

    /// The arrays of a file; parameters have their names, `kept.N` are the numbers of the weights that pruning left in
    /// sparse convolution N.
    ///
    /// # Errors
    /// If the shape cannot be written as JSON, which none is known to cause.
    pub fn to_arrays(&self) -> Result<Arrays> {
        let text = serde_json::to_string(&self.about).map_err(|e| Error::input(e.to_string()))?;
        let mut arrays = Arrays::new(text);
        for parameter in self.parameters.iter() {
            arrays.put(&parameter.name, Array::Single(parameter.shape.clone(), parameter.values.clone()));
        }
        self.kept.iter().enumerate().for_each(|(n, kept)| arrays.put(format!("kept.{n}"), Array::Whole(kept.clone())));
        Ok(arrays)
    }

    /// The network of a file.
    ///
    /// # Errors
    /// If an array is missing or does not fit.
    pub fn from_arrays(arrays: &Arrays) -> Result<Self> {
        let about: ObjectModelAbout = serde_json::from_str(&arrays.text)
            .map_err(|e| Error::ModelMismatch(format!("it is no network for objects: {e}")))?;
        let (net, mut parameters) = ObjectNet::new::<f32>(&about.network, &about.shape, about.classes.len(), 0)?;
        for parameter in parameters.iter_mut() {
            let values = arrays.single(&parameter.name, parameter.values.len())?;
            parameter.values.copy_from_slice(values);
        }
        let kept = read_kept(arrays, &net, &parameters)?;
        Ok(Self { about, parameters, kept })
    }
}

/// The weights that are left of each sparse convolution, checked.
pub(super) fn read_kept(arrays: &Arrays, net: &ObjectNet, parameters: &Parameters<f32>) -> Result<Vec<Kept>> {
    let ids = net.sparse_weights();
    let one = |(number, &id)| {
        let name = format!("kept.{number}");
        let kept = arrays.whole(&name)?;
        let most = parameters.get(id).len() as u64;
        match kept.is_sorted_by(|a, b| a < b) && kept.last().is_none_or(|&last| last < most) {
            true => Ok(kept.to_vec()),
            false => Err(Error::ModelMismatch(format!("array {name} (allowed: ascending numbers below {most})"))),
        }
    };
    ids.iter().enumerate().map(one).collect()
}
