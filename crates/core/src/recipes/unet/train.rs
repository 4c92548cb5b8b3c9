//! Training: steps on parts of the clouds, then the summary of what the network has learned.

use super::cells::Cells;
use super::crop::{Batch, Crop};
use super::inputs::OWN;
use super::scenes::TrainingScene;
use super::{UNetRecipe, UNetReport};
use crate::classification::{Classifier, Fingerprint, Samples};
use crate::error::Result;
use crate::nn::layers::cross_entropy;
use crate::nn::networks::{Scene, UNet};
use crate::nn::parameters::Parameters;
use crate::nn::tape::Tape;
use crate::nn::workspace::Workspace;
use crate::parallel::Monitor;
use crate::random::stream;
use crate::recipes::training::networks::{
    Checkpoint, Labelled, NONE, Progress, automatic_voxel, drawn, linear_of, names,
};
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
    let (net, parameters) = UNet::new::<f32>(&recipe.network, inputs, classes, recipe.seed)?;
    let weights = class_weights(&scenes, classes, recipe.learning.balance);
    let training = Training { recipe, voxel, scenes, weights, net };
    let recipe = UNetRecipe { voxel: Some(voxel), ..recipe.clone() };
    let feed = |sum: &mut _| training.scenes.iter().for_each(|scene| scene.feed(sum));
    let file = options.checkpoint.as_deref().map(|path| Checkpoint::new(path, &recipe, feed)).transpose()?;
    let mut progress = Progress::new(parameters);
    file.as_ref().map_or(Ok(()), |file| file.resume(&mut progress))?;
    training.run(&mut progress, file.as_ref(), monitor)?;
    let Progress { parameters, losses, cells, .. } = progress;
    let summary = training.summary(&parameters, density(&data, monitor)?, monitor)?;
    let head = linear_of(training.net.head(&parameters).into(), &summary)?;
    let report = UNetReport {
        classes: sources.counts,
        unlabelled: data.unlabelled(),
        voxel,
        parameters: parameters.trained(),
        cells: cells as f64 / losses.len() as f64,
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

/// The share of each class in the samples to the power of minus `balance`, with mean 1.
fn class_weights(scenes: &[TrainingScene], classes: usize, balance: f64) -> Vec<f32> {
    let mut counts = vec![0.0f64; classes];
    for &label in scenes.iter().flat_map(|scene| &scene.labelled.labels).filter(|label| **label != NONE) {
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
        let scenes: Vec<&Labelled> = self.scenes.iter().map(|scene| &scene.labelled).collect();
        let found = drawn(&scenes, draws)?;
        let scene = &self.scenes[found.scene];
        let [x, y, _] = scene.points.xyz(found.point as usize);
        Ok(Crop { scene, centre: [x, y], radius: 0.0, voxel: 0.0 })
    }

    /// All steps that are left.
    fn run(&self, progress: &mut Progress, file: Option<&Checkpoint<'_>>, monitor: &Monitor) -> Result<()> {
        let learning = &self.recipe.learning;
        monitor.stage("train", learning.steps as u64);
        monitor.advance(progress.losses.len() as u64);
        let workspace = Workspace::default();
        for step in progress.losses.len()..learning.steps {
            monitor.check()?;
            self.step(step as u64, progress, &workspace, monitor)?;
            file.map_or(Ok(()), |file| file.follow(progress, learning.steps))?;
            monitor.advance(1);
        }
        Ok(())
    }

    fn step(&self, step: u64, progress: &mut Progress, workspace: &Workspace<f32>, monitor: &Monitor) -> Result<()> {
        let learning = &self.recipe.learning;
        let batch = self.prepared(step, monitor)?;
        let (loss, gradients, followed) = {
            let mut tape = Tape::training(&progress.parameters, workspace, monitor);
            let inputs = tape.input(batch.cells.inputs.clone(), OWN + self.recipe.inputs.width());
            let scores = self.net.scores(&mut tape, &batch.scene, inputs)?;
            let loss = cross_entropy(tape.values(scores), &batch.targets, self.weights.len());
            (loss.value, tape.backward(loss.gradient)?, tape.followed())
        };
        let rate = learning.rate * learning.schedule.factor(step, learning.steps as u64);
        learning.optimiser.step(&mut progress.parameters, &gradients, rate, &mut progress.state)?;
        followed.iter().for_each(|moments| moments.store(&mut progress.parameters));
        progress.losses.push(loss);
        progress.cells += batch.cells.len() as u64;
        Ok(())
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
