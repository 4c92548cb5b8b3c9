//! Training of a network on objects, epoch after epoch.

use super::learning::MOST_EPOCHS;
use super::model::{ObjectModel, ObjectModelAbout, read_kept};
use super::{ObjectLearning, ObjectNet, ObjectNetParams};
use crate::error::{Error, Result};
use crate::nn::arrays::{Array, Arrays};
use crate::nn::layers::cross_entropy;
use crate::nn::networks::build::SIZE;
use crate::nn::networks::connected::Mode;
use crate::nn::networks::levels::{Kept, Weights};
use crate::nn::objects::Objects;
use crate::nn::parameters::{Gradients, ParameterId, Parameters};
use crate::nn::sparse::{DensityParams, DensityRegulariser, Pruning, SparseFilter};
use crate::nn::training::{OptimiserState, Schedule, checkpoint};
use crate::parallel::Monitor;
use crate::random::stream;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// What an epoch did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochReport {
    /// Mean loss, without penalties.
    pub loss: f64,
    /// For each sparse convolution the mean density of its responses before the strongest were selected.
    pub densities: Vec<f64>,
    /// Sparse weights that are left.
    pub weights: usize,
    /// Most bytes of sparse tensors that a step kept for the gradients.
    pub bytes: usize,
}

/// A batch.
struct Lesson<'a> {
    objects: &'a Objects,
    /// The numbers of its samples.
    numbers: &'a [usize],
    /// Weight of each class.
    weights: &'a [f32],
}

/// A training: between epochs it can be saved, and later resumes bit-identically.
#[derive(Clone, Debug)]
pub struct ObjectTraining {
    about: ObjectModelAbout,
    learning: ObjectLearning,
    net: ObjectNet,
    parameters: Parameters<f32>,
    kept: Vec<Kept>,
    optimiser: OptimiserState<f32>,
    pruning: Vec<Pruning>,
    regularisers: Vec<DensityRegulariser>,
    epochs: usize,
}

impl ObjectTraining {
    /// A network before its first epoch.
    ///
    /// # Errors
    /// If a parameter is out of range, or a label is not below the number of classes.
    pub fn new(
        network: &ObjectNetParams,
        learning: &ObjectLearning,
        objects: &Objects,
        classes: &[String],
    ) -> Result<Self> {
        learning.validate()?;
        learning.augment.validate(&objects.shape)?;
        let about = ObjectModelAbout {
            network: network.clone(),
            shape: objects.shape.clone(),
            classes: classes.to_vec(),
            labels: None,
            preset: None,
        };
        about.check_samples(objects)?;
        let (net, parameters) = ObjectNet::new::<f32>(network, &objects.shape, classes.len(), learning.seed)?;
        let ids = net.sparse_weights();
        let kept = ids.iter().map(|&id| (0..parameters.get(id).len() as u64).collect()).collect();
        let pruning = ids.iter().map(|_| Pruning::new(learning.pruning)).collect::<Result<_>>()?;
        let channels = parameters.iter().filter(|p| p.shape.len() > 2).map(|p| p.shape[0]);
        let regulariser = |(density, channels): (f64, usize)| {
            DensityRegulariser::new(DensityParams { density, ..learning.regulariser }, channels)
        };
        let regularisers = net.densities().into_iter().zip(channels).map(regulariser).collect::<Result<_>>()?;
        let (learning, optimiser) = (learning.clone(), OptimiserState::default());
        Ok(Self { about, learning, net, parameters, kept, optimiser, pruning, regularisers, epochs: 0 })
    }

    /// Number of epochs that were done.
    pub fn epochs(&self) -> usize {
        self.epochs
    }

    /// The network as it is now.
    pub fn model(&self) -> ObjectModel {
        ObjectModel { about: self.about.clone(), parameters: self.parameters.clone(), kept: self.kept.clone() }
    }

    /// One pass through all samples in a random order.
    ///
    /// # Errors
    /// If the samples have another shape or lack labels, a response or gradient is not finite (names the step and the layer),
    /// or the work was cancelled.
    pub fn epoch(&mut self, objects: &Objects, monitor: &Monitor) -> Result<EpochReport> {
        self.about.check_samples(objects)?;
        let count = objects.samples.len();
        monitor.stage("train", count as u64);
        let mut order: Vec<usize> = (0..count).collect();
        stream(self.learning.seed, u64::MAX - self.epochs as u64).shuffle(&mut order);
        let batches = count.div_ceil(self.learning.batch);
        let steps = batches.saturating_mul(self.learning.epochs) as u64;
        let weights = class_weights(objects, self.about.classes.len(), self.learning.balance);
        let mut report = EpochReport { loss: 0.0, densities: vec![0.0; self.kept.len()], weights: 0, bytes: 0 };
        for numbers in order.chunks(self.learning.batch) {
            monitor.check()?;
            let lesson = Lesson { objects, numbers, weights: &weights };
            let step = format!("training, step {}", self.optimiser.steps + 1);
            let gradients = self.gradients(lesson, &mut report, monitor).map_err(|error| error.within(&step))?;
            let rate = self.learning.rate * self.learning.schedule.factor(self.optimiser.steps, steps);
            self.learning.optimiser.step(&mut self.parameters, &gradients, rate, &mut self.optimiser)?;
            self.clear_removed();
            monitor.advance(numbers.len() as u64);
        }
        self.end_epoch()?;
        report.loss /= batches as f64;
        report.densities.iter_mut().for_each(|density| *density /= batches as f64);
        report.weights = self.kept.iter().map(Vec::len).sum();
        Ok(report)
    }

    /// The gradients of a batch, penalties included.
    fn gradients(
        &mut self,
        Lesson { objects, numbers, weights }: Lesson<'_>,
        report: &mut EpochReport,
        monitor: &Monitor,
    ) -> Result<Gradients<f32>> {
        let classes = self.about.classes.len();
        let mut draws = stream(self.learning.seed, 1 + self.optimiser.steps);
        let batch = objects.batch(numbers, &self.learning.augment, &mut draws)?;
        let own = Weights { parameters: &self.parameters, kept: &self.kept };
        let pass = self.net.pass(own, batch, Mode::Training(&mut draws), monitor)?;
        let mut targets = vec![0.0; numbers.len() * classes];
        for (row, &number) in numbers.iter().enumerate() {
            let label = usize::from(objects.labels[number]);
            targets[row * classes + label] = weights[label];
        }
        let loss = cross_entropy(pass.scores(), &targets, classes);
        report.loss += loss.value;
        report.bytes = report.bytes.max(pass.sparse_bytes());
        for ((sum, own), regulariser) in report.densities.iter_mut().zip(pass.densities()).zip(&mut self.regularisers) {
            *sum += own.iter().sum::<f64>() / own.len() as f64;
            regulariser.follow(own);
        }
        let mut gradients = pass.backward(&loss.gradient, monitor)?;
        self.add_penalties(&mut gradients)?;
        Ok(gradients)
    }

    /// The sparse weights of a convolution that are left.
    fn filter(&self, number: usize, id: ParameterId) -> Result<SparseFilter<f32>> {
        let values = self.parameters.get(id);
        let outputs = self.regularisers[number].bias().len();
        let axes = self.about.shape.extent.len();
        let inputs = values.len() / (outputs * SIZE.pow(axes as u32)).max(1);
        let filter = SparseFilter::of_dense([inputs, outputs], SIZE, axes, values.to_vec())?;
        Ok(filter.pruned(|i, _| self.kept[number].binary_search(&(i as u64)).is_ok()))
    }

    fn add_penalties(&self, gradients: &mut Gradients<f32>) -> Result<()> {
        if self.learning.regulariser.strength == 0.0 {
            return Ok(());
        }
        for (number, id) in self.net.sparse_weights().into_iter().enumerate() {
            let filter = self.filter(number, id)?;
            let own = id.of_mut(gradients);
            let mut stored: Vec<f32> = filter.keys().iter().map(|&key| own[key as usize]).collect();
            self.regularisers[number].add_gradient(&filter, &mut stored);
            filter.keys().iter().zip(stored).for_each(|(&key, value)| own[key as usize] = value);
        }
        for (number, id) in self.net.sparse_biases().into_iter().enumerate() {
            self.regularisers[number].add_bias_gradient(self.parameters.get(id), id.of_mut(gradients));
        }
        Ok(())
    }

    /// Removed weights stay 0, whatever the optimiser remembers of them.
    fn clear_removed(&mut self) {
        for (id, kept) in self.net.sparse_weights().into_iter().zip(&self.kept) {
            let values = self.parameters.get_mut(id);
            if kept.len() < values.len() {
                let mut left = vec![0.0; values.len()];
                kept.iter().for_each(|&key| left[key as usize] = values[key as usize]);
                values.copy_from_slice(&left);
            }
        }
    }

    fn end_epoch(&mut self) -> Result<()> {
        self.epochs += 1;
        if self.learning.pruning > 0.0 {
            for (number, id) in self.net.sparse_weights().into_iter().enumerate() {
                let filter = self.filter(number, id)?;
                let left = self.pruning[number].end_epoch(&filter);
                self.kept[number] = left.keys().to_vec();
            }
            self.clear_removed();
        }
        Ok(())
    }

    /// All that a later run needs to go on.
    ///
    /// # Errors
    /// If the samples have another shape or lack labels.
    pub fn to_arrays(&self, objects: &Objects) -> Result<Arrays> {
        self.about.check_samples(objects)?;
        let mut arrays = Arrays::new(self.settings(objects)?);
        checkpoint::store(&mut arrays, &self.parameters, &self.optimiser);
        arrays.put("epochs", Array::Whole(vec![self.epochs as u64]));
        let layers = self.kept.iter().zip(&self.pruning).zip(&self.regularisers).enumerate();
        for (number, ((kept, pruning), regulariser)) in layers {
            arrays.put(format!("kept.{number}"), Array::Whole(kept.clone()));
            arrays.put(format!("warned.{number}"), Array::Whole(pruning.warned().to_vec()));
            arrays.put(format!("density.{number}"), Array::Double(regulariser.bias().to_vec()));
        }
        Ok(arrays)
    }

    /// Goes on from what [`ObjectTraining::to_arrays`] gave: settings and samples must be the same.
    ///
    /// # Errors
    /// If they are not, or an array is missing or does not fit.
    pub fn resume(&mut self, arrays: &Arrays, objects: &Objects) -> Result<()> {
        if arrays.text != self.settings(objects)? {
            let found = "the checkpoint was made with other settings or samples";
            return Err(Error::ModelMismatch(format!("{found} (allowed: the same; otherwise remove it)")));
        }
        let epochs = self.epochs_of(arrays, objects)?;
        self.optimiser = checkpoint::restore(arrays, &mut self.parameters)?;
        self.epochs = epochs;
        self.kept = read_kept(arrays, &self.net, &self.parameters)?;
        for number in 0..self.kept.len() {
            let warned = numbers(arrays, &format!("warned.{number}"), &self.kept[number])?;
            self.pruning[number] = Pruning::new(self.learning.pruning)?.with_warned(warned);
            let (name, bias) = (format!("density.{number}"), self.regularisers[number].bias_mut());
            let stored = arrays.double(&name)?;
            if stored.len() != bias.len() {
                let found = format!("array {name}: {} values", stored.len());
                return Err(Error::ModelMismatch(format!("{found} (allowed: {})", bias.len())));
            }
            bias.copy_from_slice(stored);
        }
        Ok(())
    }

    /// The epochs of a checkpoint, which must have as many steps as they take.
    fn epochs_of(&self, arrays: &Arrays, objects: &Objects) -> Result<usize> {
        let (epochs, steps) = (arrays.whole("epochs")?, arrays.whole("steps")?);
        let batches = objects.samples.len().div_ceil(self.learning.batch) as u64;
        match (epochs, steps) {
            (&[epochs], &[steps]) if epochs <= MOST_EPOCHS as u64 && epochs.checked_mul(batches) == Some(steps) => {
                Ok(epochs as usize)
            }
            _ => {
                let found = format!("a checkpoint after epochs {epochs:?} and steps {steps:?}");
                let allowed = format!("up to {MOST_EPOCHS} epochs of {batches} steps");
                Err(Error::ModelMismatch(format!("{found} (allowed: {allowed})")))
            }
        }
    }

    /// Settings and a checksum of the samples; the number of epochs may differ if the rate does not depend on it.
    fn settings(&self, objects: &Objects) -> Result<String> {
        let mut learning = self.learning.clone();
        if learning.schedule == Schedule::Constant {
            learning.epochs = 1;
        }
        let mut sum = Sha256::new();
        objects.feed(&mut sum);
        let sum: String = sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        serde_json::to_string(&(&self.about, &learning, sum)).map_err(|e| Error::input(e.to_string()))
    }
}

/// The numbers of weights in an array: ascending, and all of them among those that are left.
fn numbers(arrays: &Arrays, name: &str, left: &Kept) -> Result<Vec<u64>> {
    let found = arrays.whole(name)?;
    match found.is_sorted_by(|a, b| a < b) && found.iter().all(|key| left.binary_search(key).is_ok()) {
        true => Ok(found.to_vec()),
        false => {
            let allowed = "ascending numbers of weights that are left";
            Err(Error::ModelMismatch(format!("array {name} (allowed: {allowed})")))
        }
    }
}

/// The share of each class in the samples to the power of minus `balance`, with mean 1 over the samples.
fn class_weights(objects: &Objects, classes: usize, balance: f64) -> Vec<f32> {
    let mut counts = vec![0.0f64; classes];
    objects.labels.iter().for_each(|&label| counts[usize::from(label)] += 1.0);
    let weights: Vec<f64> = counts.iter().map(|count| count.max(1.0).powf(-balance)).collect();
    let mean = weights.iter().zip(&counts).map(|(w, c)| w * c).sum::<f64>() / objects.labels.len() as f64;
    weights.iter().map(|weight| (weight / mean) as f32).collect()
}
