//! Training of a network on objects, epoch after epoch.

use super::model::{ObjectModel, ObjectModelAbout, read_kept};
use super::{ObjectNet, ObjectNetParams};
use crate::error::{Error, Result};
use crate::nn::arrays::{Array, Arrays};
use crate::nn::layers::cross_entropy;
use crate::nn::networks::build::SIZE;
use crate::nn::networks::connected::Mode;
use crate::nn::networks::levels::{Kept, Weights};
use crate::nn::objects::{ObjectAugmentation, Objects};
use crate::nn::parameters::{Gradients, ParameterId, Parameters};
use crate::nn::sparse::{DensityParams, DensityRegulariser, Pruning, SparseFilter};
use crate::nn::training::{Optimiser, OptimiserState, Schedule, checkpoint};
use crate::parallel::Monitor;
use crate::random::stream;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectLearning {
    /// Passes through all samples, 1 or more.
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
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        let check = |name: &'static str, value: f64, fine: bool, expected: &str| match fine {
            true => Ok(()),
            false => Err(Error::parameter(name, value, expected)),
        };
        check("epochs", self.epochs as f64, self.epochs > 0, "1 or more")?;
        check("batch", self.batch as f64, (1..=1 << 16).contains(&self.batch), "1 to 65536")?;
        check("rate", self.rate, self.rate > 0.0 && self.rate.is_finite(), "above 0")?;
        check("balance", self.balance, (0.0..=1.0).contains(&self.balance), "0 to 1")?;
        Pruning::new(self.pruning)?;
        self.regulariser.validate()?;
        self.optimiser.validate()
    }
}

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

/// A training: between epochs it can be saved and go on later to the same bytes.
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
        objects.validate()?;
        if objects.labels.is_empty() || objects.labels.iter().any(|&label| usize::from(label) >= classes.len()) {
            let most = classes.len();
            return Err(Error::input(format!("labels of objects (allowed: one a sample, below {most})")));
        }
        let (net, parameters) = ObjectNet::new::<f32>(network, &objects.shape, classes.len(), learning.seed)?;
        let ids = net.sparse_weights();
        let kept = ids.iter().map(|&id| (0..parameters.get(id).len() as u64).collect()).collect();
        let pruning = ids.iter().map(|_| Pruning::new(learning.pruning)).collect::<Result<_>>()?;
        let channels = parameters.iter().filter(|p| p.shape.len() > 2).map(|p| p.shape[0]);
        let regulariser = |(density, channels): (f64, usize)| {
            DensityRegulariser::new(DensityParams { density, ..learning.regulariser }, channels)
        };
        let regularisers = net.densities().into_iter().zip(channels).map(regulariser).collect::<Result<_>>()?;
        let about =
            ObjectModelAbout { network: network.clone(), shape: objects.shape.clone(), classes: classes.to_vec() };
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
    /// If a gradient is not finite (names the step and the parameter), or the work was cancelled.
    pub fn epoch(&mut self, objects: &Objects, monitor: &Monitor) -> Result<EpochReport> {
        let count = objects.samples.len();
        monitor.stage("train", count as u64);
        let mut order: Vec<usize> = (0..count).collect();
        stream(self.learning.seed, u64::MAX - self.epochs as u64).shuffle(&mut order);
        let batches = count.div_ceil(self.learning.batch);
        let steps = (batches * self.learning.epochs) as u64;
        let weights = class_weights(objects, self.about.classes.len(), self.learning.balance);
        let mut report = EpochReport { loss: 0.0, densities: vec![0.0; self.kept.len()], weights: 0, bytes: 0 };
        for numbers in order.chunks(self.learning.batch) {
            monitor.check()?;
            let lesson = Lesson { objects, numbers, weights: &weights };
            let gradients = self.gradients(lesson, &mut report, monitor)?;
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
    /// If the settings cannot be written as JSON, which none are known to cause.
    pub fn to_arrays(&self, objects: &Objects) -> Result<Arrays> {
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
        self.optimiser = checkpoint::restore(arrays, &mut self.parameters)?;
        self.epochs = arrays.whole("epochs")?.first().copied().unwrap_or(0) as usize;
        self.kept = read_kept(arrays, &self.net, &self.parameters)?;
        for number in 0..self.kept.len() {
            let warned = arrays.whole(&format!("warned.{number}"))?.to_vec();
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

/// The share of each class in the samples to the power of minus `balance`, with mean 1 over the samples.
fn class_weights(objects: &Objects, classes: usize, balance: f64) -> Vec<f32> {
    let mut counts = vec![0.0f64; classes];
    objects.labels.iter().for_each(|&label| counts[usize::from(label)] += 1.0);
    let weights: Vec<f64> = counts.iter().map(|count| count.max(1.0).powf(-balance)).collect();
    let mean = weights.iter().zip(&counts).map(|(w, c)| w * c).sum::<f64>() / objects.labels.len() as f64;
    weights.iter().map(|weight| (weight / mean) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::networks::ObjectLevel;
    use crate::nn::objects::{ObjectShape, Sample};

    /// Horizontal and vertical bars at random places in noise.
    fn bars(count: usize, seed: u64) -> Objects {
        let mut draws = stream(seed, 0);
        let (mut samples, mut labels) = (Vec::new(), Vec::new());
        for number in 0..count {
            let (upright, at) = (number % 2 == 1, draws.below(12) as u64);
            let mut keys: Vec<u64> = (2..10).map(|i| if upright { i * 12 + at } else { at * 12 + i }).collect();
            keys.extend((0..6).map(|_| draws.below(144) as u64));
            keys.sort_unstable();
            keys.dedup();
            let values = vec![1.0; keys.len()];
            samples.push(Sample::Entries(keys, values));
            labels.push(u16::from(upright));
        }
        Objects { shape: ObjectShape { channels: 1, extent: vec![12, 12] }, samples, labels }
    }

    fn names(count: usize) -> Vec<String> {
        (0..count).map(|i| i.to_string()).collect()
    }

    fn settings() -> (ObjectNetParams, ObjectLearning) {
        let level = |channels: usize| ObjectLevel { channels: vec![channels; 2], density: Some(0.4) };
        let network = ObjectNetParams { levels: vec![level(4), level(8)], hidden: 16, ..ObjectNetParams::default() };
        let learning = ObjectLearning {
            epochs: 8,
            batch: 16,
            regulariser: DensityParams { strength: 0.01, ..DensityParams::default() },
            pruning: 0.02,
            augment: ObjectAugmentation::NONE,
            ..ObjectLearning::default()
        };
        (network, learning)
    }

    #[test]
    fn bars_are_told_apart_and_weights_never_return() {
        let (objects, monitor) = (bars(200, 1), Monitor::default());
        let (network, learning) = settings();
        let mut training = ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
        let reports: Vec<EpochReport> = (0..8).map(|_| training.epoch(&objects, &monitor).unwrap()).collect();
        assert!(reports[7].loss < 0.5 * reports[0].loss, "{reports:?}");
        assert!(reports.windows(2).all(|pair| pair[1].weights <= pair[0].weights));
        assert!(reports[7].weights < reports[0].weights && reports[7].bytes > 0);
        let model = training.model();
        let others = bars(100, 2);
        let found = model.predict_proba(&others, &monitor).unwrap();
        let right = found.chunks_exact(2).zip(&others.labels).filter(|(p, l)| (p[1] > p[0]) == (**l == 1)).count();
        assert!(right >= 95, "{right} of 100");
        let read = ObjectModel::from_arrays(&model.to_arrays().unwrap()).unwrap();
        assert_eq!(read, model);
        assert!(
            read.predict_proba(&Objects { shape: ObjectShape { channels: 1, extent: vec![144] }, ..others }, &monitor)
                .is_err()
        );
    }

    #[test]
    fn training_goes_on_from_a_checkpoint_to_the_same_bytes_on_any_number_of_threads() {
        let (objects, monitor) = (bars(60, 3), Monitor::default());
        let (network, learning) = settings();
        let start = || ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
        let run = |threads: usize, stop: Option<usize>| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut training = start();
                for epoch in 0..5 {
                    if stop == Some(epoch) {
                        let bytes = training.to_arrays(&objects).unwrap().to_bytes().unwrap();
                        training = start();
                        let arrays = Arrays::from_bytes(&bytes, std::path::Path::new("x")).unwrap();
                        training.resume(&arrays, &objects).unwrap();
                    }
                    training.epoch(&objects, &monitor).unwrap();
                }
                training.to_arrays(&objects).unwrap().to_bytes().unwrap()
            })
        };
        let whole = run(1, None);
        assert!(run(2, Some(0)) == whole && run(3, Some(3)) == whole);
        // Other samples or settings are refused.
        let arrays = start().to_arrays(&objects).unwrap();
        assert!(start().resume(&arrays, &bars(60, 4)).unwrap_err().to_string().contains("other settings or samples"));
        let other = ObjectLearning { rate: 0.02, ..learning };
        let mut other = ObjectTraining::new(&network, &other, &objects, &names(2)).unwrap();
        assert!(other.resume(&arrays, &objects).is_err());
    }

    #[test]
    fn gradients_that_are_not_finite_stop_with_step_and_layer() {
        let mut objects = bars(40, 1);
        objects.samples[3] = Sample::Entries(vec![0, 1], vec![f32::MAX, f32::MAX]);
        let (network, learning) = settings();
        let mut training = ObjectTraining::new(&network, &learning, &objects, &names(2)).unwrap();
        let message = training.epoch(&objects, &Monitor::default()).unwrap_err().to_string();
        assert!(message.contains("step") && message.contains("level0"), "{message}");
        assert!(ObjectTraining::new(&network, &learning, &objects, &names(1)).is_err());
        assert!(ObjectLearning { batch: 0, ..learning }.validate().unwrap_err().to_string().contains("batch"));
    }
}
