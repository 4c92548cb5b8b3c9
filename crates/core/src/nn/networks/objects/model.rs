//! A trained network with the shape of its samples: what is saved and classifies.

use super::{ObjectNet, ObjectNetParams};
use crate::error::{Error, Result};
use crate::nn::arrays::{Array, Arrays};
use crate::nn::layers::softmax;
use crate::nn::networks::connected::Mode;
use crate::nn::networks::levels::{Kept, Size, Weights};
use crate::nn::objects::{ObjectAugmentation, ObjectShape, Objects};
use crate::nn::parameters::Parameters;
use crate::parallel::Monitor;
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// Samples that are classified together, at most.
const BATCH: usize = 64;
/// Values between two layers of samples that are classified together, at most, unless it is one sample.
const VALUES: usize = 1 << 21;

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
    /// What the names of the classes stand for; absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelKind>,
    /// Name of the settings that network and training began with, of [`ObjectPreset::NAMES`](super::ObjectPreset::NAMES);
    /// absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
}

impl ObjectModelAbout {
    /// Checks that samples fit together and have the shape of the network.
    fn check_shape(&self, objects: &Objects) -> Result<()> {
        let about = |shape: &ObjectShape| format!("{} channels, {:?} cells", shape.channels, shape.extent);
        match objects.shape == self.shape {
            true => objects.validate(),
            false => {
                let (found, allowed) = (about(&objects.shape), about(&self.shape));
                Err(Error::input(format!("samples of {found} (allowed: {allowed})")))
            }
        }
    }

    /// Checks that samples can be learned from: that they also have labels.
    pub(super) fn check_samples(&self, objects: &Objects) -> Result<()> {
        self.check_shape(objects)?;
        let classes = self.classes.len();
        match objects.labels.is_empty() || objects.labels.iter().any(|&label| usize::from(label) >= classes) {
            true => Err(Error::input(format!("labels of objects (allowed: one a sample, below {classes})"))),
            false => Ok(()),
        }
    }
}

/// What the names of classes stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LabelKind {
    /// Texts.
    Text,
    /// Whole numbers.
    Whole,
    /// True and false.
    Boolean,
}

impl ObjectModel {
    /// The probabilities of the classes, a row a sample.
    ///
    /// # Errors
    /// If the samples have another shape, or the work was cancelled.
    pub fn predict_proba(&self, objects: &Objects, monitor: &Monitor) -> Result<Vec<f32>> {
        self.about.check_shape(objects)?;
        let ObjectModelAbout { network, shape, classes, .. } = &self.about;
        let classes = classes.len();
        let (net, _) = ObjectNet::new::<f32>(network, shape, classes, 0)?;
        let weights = Weights { parameters: &self.parameters, kept: &self.kept };
        let numbers: Vec<usize> = (0..objects.samples.len()).collect();
        monitor.stage("classify", numbers.len() as u64);
        let mut found = Vec::with_capacity(numbers.len() * classes);
        for numbers in numbers.chunks(together(network, shape)) {
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
    /// If an array is missing or does not fit, or the arrays have not as many values as the network.
    pub fn from_arrays(arrays: &Arrays) -> Result<Self> {
        let about: ObjectModelAbout = serde_json::from_str(&arrays.text)
            .map_err(|e| Error::ModelMismatch(format!("it is no network for objects: {e}")))?;
        let count = about.network.parameters(&about.shape, about.classes.len())?;
        let found: usize = arrays.iter().map(|(_, array)| array.singles()).sum();
        if found != count {
            let allowed = format!("{count}, by the shape of the network");
            return Err(Error::ModelMismatch(format!("{found} values of 32 bits (allowed: {allowed})")));
        }
        let (net, mut parameters) = ObjectNet::new::<f32>(&about.network, &about.shape, about.classes.len(), 0)?;
        for parameter in parameters.iter_mut() {
            let values = arrays.single(&parameter.name, parameter.values.len())?;
            parameter.values.copy_from_slice(values);
        }
        let kept = read_kept(arrays, &net, &parameters)?;
        Ok(Self { about, parameters, kept })
    }
}

/// How many samples are classified together.
fn together(network: &ObjectNetParams, shape: &ObjectShape) -> usize {
    let widest = Size::of(&network.levels, shape).map_or(usize::MAX, |size| size.widest);
    (VALUES / widest.max(1)).clamp(1, BATCH)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::networks::ObjectLevel;
    use crate::nn::objects::Sample;

    /// A small network of 2 classes for images of 8 x 8 cells.
    fn small() -> ObjectModel {
        let level = ObjectLevel { channels: vec![2], density: Some(0.5) };
        let network = ObjectNetParams { levels: vec![level], hidden: 3, ..ObjectNetParams::default() };
        let shape = ObjectShape { channels: 1, extent: vec![8, 8] };
        let (net, parameters) = ObjectNet::new(&network, &shape, 2, 1).unwrap();
        let kept = vec![(0..parameters.get(net.sparse_weights()[0]).len() as u64).collect()];
        let classes = vec!["1".into(), "2".into()];
        let about =
            ObjectModelAbout { network, shape, classes, labels: Some(LabelKind::Text), preset: Some("mnist".into()) };
        ObjectModel { about, parameters, kept }
    }

    #[test]
    fn the_header_of_a_file_allocates_no_more_than_its_arrays_hold() {
        let model = small();
        let arrays = model.to_arrays().unwrap();
        assert_eq!(ObjectModel::from_arrays(&arrays).unwrap(), model);
        let refused = |from: &str, to: &str| {
            let mut arrays = arrays.clone();
            assert!(arrays.text.contains(from), "{}", arrays.text);
            arrays.text = arrays.text.replace(from, to);
            ObjectModel::from_arrays(&arrays).unwrap_err().to_string()
        };
        let largest = usize::MAX.to_string();
        assert!(refused("[8,8]", "[65536,65536]").contains("parameters"));
        assert!(refused("[8,8]", &format!("[{largest},8]")).contains("do not fit"));
        assert!(refused("[8,8]", "[8,8,8,8,8]").contains("axes"));
        assert!(refused("[8,8]", "[1024,1024]").contains("by the shape of the network"));
        assert!(refused(r#""hidden":3"#, r#""hidden":65536"#).contains("by the shape of the network"));
        assert!(refused(r#""channels":[2]"#, r#""channels":[512]"#).contains("by the shape of the network"));
        assert!(refused(r#""channels":1"#, r#""channels":72057594037927936"#).contains("parameters (allowed"));
    }

    #[test]
    fn files_without_the_kind_of_their_labels_and_a_name_are_read() {
        let arrays = small().to_arrays().unwrap();
        let mut old = arrays.clone();
        old.text = old.text.replace(r#","labels":"text","preset":"mnist""#, "");
        assert_ne!(old.text, arrays.text);
        let about = |arrays: &Arrays| ObjectModel::from_arrays(arrays).unwrap().about;
        assert_eq!([about(&old).labels, about(&arrays).labels], [None, Some(LabelKind::Text)]);
        assert_eq!([about(&old).preset, about(&arrays).preset], [None, Some("mnist".into())]);
    }

    #[test]
    fn fine_samples_are_classified_in_smaller_batches_with_the_same_result() {
        let of = |extent: usize| {
            together(&ObjectNetParams::modelnet(extent), &ObjectShape { channels: 1, extent: vec![extent; 3] })
        };
        assert_eq!([16, 32, 64, 128].map(of), [64, 8, 1, 1]);
        let mut model = small();
        model.about.shape.extent = vec![512, 512];
        model.about.network.levels = vec![ObjectLevel { channels: vec![2], density: Some(0.5) }; 8];
        model.about.network.levels[7].density = None;
        let (net, parameters) = ObjectNet::new(&model.about.network, &model.about.shape, 2, 1).unwrap();
        model.kept = net.sparse_weights().iter().map(|&id| (0..parameters.get(id).len() as u64).collect()).collect();
        model.parameters = parameters;
        assert_eq!(together(&model.about.network, &model.about.shape), 4);
        let sample = |i: u64| Sample::Entries((0..90).map(|k| k * 2903 + i).collect(), vec![1.0; 90]);
        let objects = |range: std::ops::Range<u64>| Objects {
            shape: model.about.shape.clone(),
            samples: range.map(sample).collect(),
            labels: Vec::new(),
        };
        let rate = |range| model.predict_proba(&objects(range), &Monitor::default()).unwrap();
        assert_eq!(rate(0..6), (0..6).flat_map(|i| rate(i..i + 1)).collect::<Vec<f32>>());
    }
}
