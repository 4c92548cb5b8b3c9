//! Training: steps on parts of the clouds, then the summary of what the network has learned.

use super::cells::Cells;
use super::crop::{Batch, Crop};
use super::inputs::OWN;
use super::scenes::{NONE, TrainingScene};
use super::{UNetRecipe, UNetReport};
use crate::classification::{Classifier, Fingerprint, Linear, Samples};
use crate::error::{Error, Result};
use crate::features::spacing;
use crate::nn::layers::cross_entropy;
use crate::nn::networks::{Scene, UNet};
use crate::nn::parameters::Parameters;
use crate::nn::tape::Tape;
use crate::nn::training::OptimiserState;
use crate::nn::workspace::Workspace;
use crate::parallel::Monitor;
use crate::random::stream;
use crate::recipes::training::sources::Sources;
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{Fitted, LabelledCloud, Model, Nothing, TrainOptions};

/// Steps whose parts are looked at for the summary.
const LOOKED_AT: u64 = 8;
/// Cells of the summary.
const SAMPLES: usize = 50_000;

/// Clouds, network and settings of a training.
struct Training<'a> {
    recipe: &'a UNetRecipe,
    voxel: f64,
    scenes: Vec<TrainingScene>,
    /// Weight of each class in the loss.
    weights: Vec<f32>,
    net: UNet,
}

/// A batch in cells.
struct Prepared {
    cells: Cells,
    scene: Scene,
    targets: Vec<f32>,
}

pub(super) fn train(
    recipe: &UNetRecipe,
    clouds: &[LabelledCloud],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(Model, UNetReport)> {
    options.without_strengths("unet")?;
    options.without_depths("unet")?;
    use crate::recipes::System;
    recipe.validate()?;
    let data = TrainingData::new(clouds, None, monitor)?;
    let sources = Sources::select(&data, &recipe.training, recipe.seed, monitor)?;
    let voxel = match recipe.voxel {
        Some(voxel) => voxel,
        None => automatic_voxel(&data, monitor)?,
    };
    let scene = |source| TrainingScene::new(recipe, &data, source, &sources, monitor);
    let scenes = sources.list.iter().map(scene).collect::<Result<Vec<_>>>()?;
    let classes = sources.classes.len();
    let inputs = OWN + recipe.inputs.width();
    let (net, mut parameters) = UNet::new::<f32>(&recipe.network, inputs, classes, recipe.seed)?;
    let weights = class_weights(&scenes, classes, recipe.learning.balance);
    let training = Training { recipe, voxel, scenes, weights, net };
    let (losses, cells) = training.run(&mut parameters, monitor)?;
    let recipe = UNetRecipe { voxel: Some(voxel), ..recipe.clone() };
    let summary = training.summary(&parameters, density(&data, monitor)?, monitor)?;
    let head = linear_of(&parameters, &training.net, &summary)?;
    let report = UNetReport {
        classes: sources.counts,
        unlabelled: data.unlabelled(),
        voxel,
        parameters: parameters.trained(),
        cells,
        losses,
        warnings: sources.warnings,
    };
    let model = Model {
        fitted: Fitted { recipe, learned: Nothing {} }.into(),
        classes: sources.classes,
        feature_names: names(training.net.width()),
        fingerprint: summary,
        classifier: Classifier::Linear(head),
        first: None,
        network: Some(parameters.sorted()),
    };
    Ok((model, report))
}

/// Names of the features that the network gives.
pub(super) fn names(width: usize) -> Vec<String> {
    (0..width).map(|channel| format!("Learned_{channel}")).collect()
}

/// Twice the spacing of the first cloud, to two digits.
fn automatic_voxel(data: &TrainingData<'_>, monitor: &Monitor) -> Result<f64> {
    let Some(first) = data.scenes.first() else { return Err(Error::input("no cloud to learn from")) };
    let spacing = spacing(&first.metric.some_points(monitor)?, monitor)?;
    let found = (2.0 * spacing).clamp(1e-2, 1e2);
    let digit = 10f64.powf(found.log10().floor() - 1.0);
    Ok((found / digit).round() * digit)
}

/// The share of each class in the samples to the power of minus `balance`, with mean 1.
fn class_weights(scenes: &[TrainingScene], classes: usize, balance: f64) -> Vec<f32> {
    let mut counts = vec![0.0f64; classes];
    for &label in scenes.iter().flat_map(|scene| &scene.labels).filter(|label| **label != NONE) {
        counts[usize::from(label)] += 1.0;
    }
    let weights: Vec<f64> = counts.iter().map(|count| count.max(1.0).powf(-balance)).collect();
    let mean = weights.iter().sum::<f64>() / classes as f64;
    weights.iter().map(|weight| (weight / mean) as f32).collect()
}

impl Training<'_> {
    /// The parts of a step, in cells.
    fn prepared(&self, step: u64, monitor: &Monitor) -> Result<Prepared> {
        let UNetRecipe { learning, augment, inputs, seed, .. } = self.recipe;
        let mut draws = stream(*seed, 1 + step);
        let mut batch = Batch::default();
        for _ in 0..learning.parts {
            let centre = self.centre(&mut draws)?;
            let crop = Crop { radius: learning.radius, voxel: self.voxel, ..centre };
            crop.gather(augment, &mut batch, &mut draws)?;
        }
        let cells = Cells::new(&batch.points, inputs.width(), monitor)?;
        let targets = batch.targets(&cells.of_point, cells.len(), &self.weights);
        let scene = Scene::new(cells.sites.clone(), self.net.levels(), monitor)?;
        Ok(Prepared { cells, scene, targets })
    }

    /// A part around a labelled point: of each class equally often.
    fn centre(&self, draws: &mut crate::random::Stream) -> Result<Crop<'_>> {
        let classes: Vec<usize> = (0..self.weights.len())
            .filter(|&class| self.scenes.iter().any(|scene| !scene.centres(class).is_empty()))
            .collect();
        let Some(&class) = classes.get(draws.below(classes.len())) else {
            return Err(Error::input("no labelled point to learn from"));
        };
        let all: usize = self.scenes.iter().map(|scene| scene.centres(class).len()).sum();
        let mut number = draws.below(all);
        for scene in &self.scenes {
            let own = scene.centres(class);
            if let Some(&point) = own.get(number) {
                let [x, y, _] = scene.points.xyz(point as usize);
                return Ok(Crop { scene, centre: [x, y], radius: 0.0, voxel: 0.0 });
            }
            number -= own.len();
        }
        Err(Error::input("no labelled point to learn from"))
    }

    /// All steps; returns their losses and the mean number of cells.
    fn run(&self, parameters: &mut Parameters<f32>, monitor: &Monitor) -> Result<(Vec<f64>, f64)> {
        let learning = &self.recipe.learning;
        let steps = learning.steps as u64;
        monitor.stage("train", steps);
        let (mut state, mut losses, mut cells) = (OptimiserState::default(), Vec::new(), 0);
        let workspace = Workspace::default();
        for step in 0..steps {
            monitor.check()?;
            let batch = self.prepared(step, monitor)?;
            let (loss, gradients, followed) = {
                let mut tape = Tape::training(parameters, &workspace, monitor);
                let inputs = tape.input(batch.cells.inputs.clone(), OWN + self.recipe.inputs.width());
                let scores = self.net.scores(&mut tape, &batch.scene, inputs)?;
                let loss = cross_entropy(tape.values(scores), &batch.targets, self.weights.len());
                (loss.value, tape.backward(loss.gradient)?, tape.followed())
            };
            let rate = learning.rate * learning.schedule.factor(step, steps);
            learning.optimiser.step(parameters, &gradients, rate, &mut state)?;
            followed.iter().for_each(|moments| moments.store(parameters));
            losses.push(loss);
            cells += batch.cells.len();
            monitor.advance(1);
        }
        Ok((losses, cells as f64 / steps as f64))
    }

    /// Summary of the features of labelled cells.
    fn summary(&self, parameters: &Parameters<f32>, density: f64, monitor: &Monitor) -> Result<Fingerprint> {
        let (width, classes) = (self.net.width(), self.weights.len());
        let (mut rows, mut labels, workspace) = (Vec::new(), Vec::new(), Workspace::default());
        for step in 0..LOOKED_AT {
            let batch = self.prepared(step, monitor)?;
            let mut tape = Tape::prediction(parameters, &workspace, monitor);
            let inputs = tape.input(batch.cells.inputs.clone(), OWN + self.recipe.inputs.width());
            let features = self.net.features(&mut tape, &batch.scene, inputs)?;
            let known = tape.values(features).chunks_exact(width).zip(batch.targets.chunks_exact(classes));
            for (row, targets) in known.filter(|(_, targets)| targets.iter().any(|&t| t > 0.0)) {
                if labels.len() < SAMPLES {
                    rows.extend_from_slice(row);
                    labels.push(crate::classification::argmax(targets) as u16);
                }
            }
        }
        let samples = Samples { features: &rows, width, labels: &labels, weights: None, classes };
        Ok(Fingerprint::of(&samples, density))
    }
}

/// The last layer as a classifier of its own.
fn linear_of(parameters: &Parameters<f32>, net: &UNet, summary: &Fingerprint) -> Result<Linear> {
    let (weights, bias) = net.head(parameters);
    let means = summary.means.iter().map(|&mean| if mean.is_finite() { mean as f32 } else { 0.0 }).collect();
    Linear::of_layer(weights, bias, means)
}
