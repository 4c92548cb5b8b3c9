//! Training: steps on parts of the clouds, then the summary of what the network has learned.

use super::cells::Cells;
use super::crop::{Batch, Crop};
use super::inputs::OWN;
use super::scenes::TrainingScene;
use super::{LearningParams, MOST_SAMPLES, UNetRecipe};
use crate::classification::{Classifier, Fingerprint, Samples};
use crate::error::Result;
use crate::nn::layers::{Loss, cross_entropy, disagreement};
use crate::nn::networks::{SceneLevels, UNet};
use crate::nn::parameters::Parameters;
use crate::nn::tape::Tape;
use crate::nn::workspace::Workspace;
use crate::parallel::Monitor;
use crate::random::{Stream, stream};
use crate::recipes::training::networks::{
    Checkpoint, Drawn, Labelled, NONE, NetworkReport, Progress, automatic_voxel, drawn, linear_of, names,
};
use crate::recipes::training::sources::SampleSources;
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{Fitted, LabelledCloud, Nothing, TrainOptions, Trained, TrainingResult};
use std::ops::Range;

/// Steps whose parts are looked at for the summary.
const LOOKED_AT: u64 = 8;
/// Cells of the summary.
const SAMPLES: usize = 50_000;

/// Clouds, network and settings of a training.
struct Training<'a> {
    recipe: &'a UNetRecipe,
    voxel: f64,
    /// Weight of the disagreement of two views; 0: one view.
    consistency: f64,
    scenes: Vec<TrainingScene>,
    /// Weight of each class in the loss.
    weights: Vec<f32>,
    net: UNet,
}

/// A batch in cells.
struct Prepared {
    cells: Cells,
    scene: SceneLevels,
    targets: Vec<f32>,
    /// Cells of the same point in two views of a part.
    pairs: Vec<[u32; 2]>,
}

pub(super) fn train(
    recipe: &UNetRecipe,
    clouds: &[LabelledCloud],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<TrainingResult<UNetRecipe>> {
    use crate::recipes::System;
    recipe.validate()?;
    let data = TrainingData::new(clouds, None, monitor)?;
    let sources = SampleSources::select(&data, &recipe.training, recipe.seed, monitor)?;
    let voxel = match recipe.voxel {
        Some(voxel) => voxel,
        None => automatic_voxel(&data, monitor)?,
    };
    let scenes = TrainingScene::all(recipe, &data, &sources, monitor)?;
    let classes = sources.classes.len();
    let inputs = OWN + recipe.inputs.width();
    let (net, parameters) = UNet::new::<f32>(&recipe.network, inputs, classes, recipe.seed)?;
    let weights = class_weights(&scenes, classes, recipe.learning.balance);
    let consistency = recipe.learning.consistency.unwrap_or_else(|| automatic_consistency(&recipe.learning, &data));
    let learning = LearningParams { consistency: Some(consistency), ..recipe.learning.clone() };
    let recipe = UNetRecipe { voxel: Some(voxel), learning, ..recipe.clone() };
    let training = Training { recipe: &recipe, voxel, consistency, scenes, weights, net };
    let feed = |sum: &mut _| training.scenes.iter().for_each(|scene| scene.feed(sum));
    let file = options.checkpoint.as_deref().map(|path| Checkpoint::new(path, &recipe, feed)).transpose()?;
    let mut progress = Progress::new(parameters);
    file.as_ref().map_or(Ok(()), |file| file.resume(&mut progress))?;
    training.run(&mut progress, file.as_ref(), monitor)?;
    let Progress { parameters, losses, cells, .. } = progress;
    let summary = training.summary(&parameters, density(&data, monitor)?, monitor)?;
    let head = linear_of(training.net.head(&parameters).into(), &summary)?;
    let feature_names = names(training.net.width());
    let report = NetworkReport {
        classes: sources.counts,
        unlabelled: data.unlabelled(),
        voxel,
        consistency,
        parameters: parameters.trained(),
        cells: cells as f64 / losses.len() as f64,
        losses,
        warnings: sources.warnings,
    };
    let trained = Trained {
        classes: sources.classes,
        feature_names,
        fingerprint: summary,
        classifier: Classifier::Linear(head),
        cars: None,
        earlier: Vec::new(),
        network: Some(parameters.sorted()),
    };
    Ok(TrainingResult { fitted: Fitted { recipe, learned: Nothing {} }, trained, report })
}

/// The weight of the disagreement of views where it is not given: views are worth their time if hardly any point has a label.
fn automatic_consistency(learning: &LearningParams, data: &TrainingData<'_>) -> f64 {
    let points: u64 = data.scenes.iter().map(|scene| scene.metric.cloud.len() as u64).sum();
    let few = points.saturating_sub(data.unlabelled()) * 100 < points;
    if few && learning.parts <= MOST_SAMPLES / 2 { 10.0 } else { 0.0 }
}

/// Share of the weight of the disagreement of views: exp(−5 (1 − t)²) over the first third of the steps (Laine and Aila 2017),
/// for at first the answers are random.
fn rise(step: u64, steps: u64) -> f64 {
    let t = (3.0 * step as f64 / steps as f64).min(1.0);
    (-5.0 * (1.0 - t).powi(2)).exp()
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
        let UNetRecipe { learning, inputs, seed, .. } = self.recipe;
        let mut draws = stream(*seed, 1 + step);
        let (mut batch, mut common) = (Batch::default(), Vec::new());
        for _ in 0..learning.parts {
            let part = self.drawn(None, &mut draws)?;
            let first = self.view(part, &mut batch, &mut draws)?;
            if self.consistency > 0.0 {
                let second = self.view(part, &mut batch, &mut draws)?;
                common.extend(batch.common([first, second], &self.scenes[part.scene].used));
            }
        }
        let cells = Cells::new(&batch.points, inputs.width(), monitor)?;
        let targets = batch.targets(&cells.of_point, cells.len(), &self.weights);
        let scene = SceneLevels::new(cells.sites.clone(), self.net.levels(), monitor)?;
        let pairs = common.into_iter().map(|pair| pair.map(|point| cells.of_point[point])).collect();
        Ok(Prepared { cells, scene, targets, pairs })
    }

    /// Adds a view of a part to a batch, as a sample of its own, and returns the points of the part.
    fn view(&self, part: Drawn, batch: &mut Batch, draws: &mut Stream) -> Result<Range<usize>> {
        let (augment, begin) = (&self.recipe.augment, batch.len());
        self.crop(part).gather(augment, batch, draws)?;
        let end = batch.len();
        if augment.mixes(draws) {
            let other = self.drawn(Some(part.scene), draws)?;
            self.crop(other).gather(augment, batch, draws)?;
        }
        batch.sample += 1;
        Ok(begin..end)
    }

    /// A labelled point, of each class equally often; of another cloud than `not`, if another has any.
    fn drawn(&self, not: Option<usize>, draws: &mut Stream) -> Result<Drawn> {
        let all: Vec<usize> = (0..self.scenes.len()).collect();
        let mut others = all.clone();
        others.retain(|&scene| Some(scene) != not && self.scenes[scene].labelled.can_be_drawn());
        let from = if others.is_empty() { all } else { others };
        let labelled: Vec<&Labelled> = from.iter().map(|&scene| &self.scenes[scene].labelled).collect();
        let found = drawn(&labelled, draws)?;
        Ok(Drawn { scene: from[found.scene], ..found })
    }

    /// The part around a point.
    fn crop(&self, Drawn { scene, point, .. }: Drawn) -> Crop<'_> {
        let scene = &self.scenes[scene];
        let [x, y, _] = scene.points.xyz(point as usize);
        Crop { scene, centre: [x, y], radius: self.recipe.learning.radius, voxel: self.voxel }
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
            let loss = self.loss(tape.values(scores), &batch, step);
            (loss.value, tape.backward(loss.gradient)?, tape.followed())
        };
        let rate = learning.rate * learning.schedule.factor(step, learning.steps as u64);
        learning.optimiser.step(&mut progress.parameters, &gradients, rate, &mut progress.state)?;
        followed.iter().for_each(|moments| moments.store(&mut progress.parameters));
        progress.losses.push(loss);
        progress.cells = progress.cells.saturating_add(batch.cells.len() as u64);
        Ok(())
    }

    /// The cross-entropy of the scores of a batch, and the gradient of all that is minimised: of the cross-entropy and of the
    /// disagreement of views.
    fn loss(&self, scores: &[f32], batch: &Prepared, step: u64) -> Loss<f32> {
        let classes = self.weights.len();
        let known = cross_entropy(scores, &batch.targets, classes);
        if batch.pairs.is_empty() {
            return known;
        }
        let weight = (self.consistency * rise(step, self.recipe.learning.steps as u64)) as f32;
        let views = disagreement(scores, &batch.pairs, classes).gradient;
        let both = known.gradient.iter().zip(&views).map(|(known, views)| known + weight * views);
        Loss { value: known.value, gradient: both.collect() }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, CodeScheme};
    use crate::nn::networks::UNetParams;
    use crate::recipes::System;
    use crate::recipes::labels::Labels;
    use crate::recipes::unet::{Augmentation, UNetInputs};

    /// A plane at a height, all of a class, and a roof (class 6) 9.5 m above its middle.
    fn plane(height: f64, code: u8, corner: [f64; 2]) -> LabelledCloud {
        let at = |dx: f64, dy: f64, dz: f64| [corner[0] + dx, corner[1] + dy, height + dz];
        let mut rows: Vec<[f64; 3]> =
            (0..900).map(|i| at(f64::from(i % 30) + 0.5, f64::from(i / 30) + 0.5, 0.0)).collect();
        rows.extend((0..36).map(|i| at(12.5 + f64::from(i % 6), 12.5 + f64::from(i / 6), 9.5)));
        let codes = (0..936).map(|i| Some(if i < 900 { code } else { 6 })).collect();
        LabelledCloud { cloud: Cloud::from_rows(&rows).unwrap(), labels: Labels::new(codes, CodeScheme::Asprs) }
    }

    fn recipe(mix: f64) -> UNetRecipe {
        let still = Augmentation { turn: false, scale: 0.0, noise: 0.0, thin: 1.0, hide: 0.0, mix };
        UNetRecipe {
            voxel: Some(1.0),
            network: UNetParams { widths: vec![4, 4] },
            inputs: UNetInputs { height: false, ..UNetInputs::default() },
            learning: LearningParams { steps: 8, parts: 2, radius: 10.0, ..LearningParams::default() },
            augment: still,
            ..UNetRecipe::default()
        }
    }

    /// The parts of the first steps, with the points of each.
    fn batches(recipe: &UNetRecipe, clouds: &[LabelledCloud]) -> Vec<Prepared> {
        let monitor = Monitor::default();
        let data = TrainingData::new(clouds, None, &monitor).unwrap();
        let sources = SampleSources::select(&data, &recipe.training, 0, &monitor).unwrap();
        let scenes = TrainingScene::all(recipe, &data, &sources, &monitor).unwrap();
        let classes = sources.classes.len();
        let (net, _) = UNet::new::<f32>(&recipe.network, OWN, classes, 0).unwrap();
        let consistency = recipe.learning.consistency.unwrap_or(0.0);
        let training = Training { recipe, voxel: 1.0, consistency, scenes, weights: vec![1.0; classes], net };
        (0..4).map(|step| training.prepared(step, &monitor).unwrap()).collect()
    }

    #[test]
    fn mixed_parts_lie_over_each_other_at_the_same_place_and_height() {
        // Clouds far apart, one with class 2, one with class 5, 40 m higher.
        let clouds = [plane(0.0, 2, [0.0, 0.0]), plane(40.0, 5, [5000.0, 300.0])];
        let classes = |batch: &Prepared, sample: u32| {
            let mut seen = [false; 3];
            let rows = batch.targets.chunks_exact(3).enumerate();
            for (_, row) in rows.filter(|(cell, _)| batch.cells.sites.position(*cell).0 == sample) {
                seen.iter_mut().zip(row).for_each(|(seen, &share)| *seen |= share > 0.0);
            }
            seen
        };
        let heights = |batch: &Prepared| {
            let heights = (0..batch.cells.len()).map(|cell| batch.cells.sites.position(cell).1[2]);
            heights.collect::<std::collections::BTreeSet<i64>>()
        };
        for batch in batches(&recipe(0.0), &clouds) {
            // Classes 2 and 5 come from different clouds.
            assert!((0..2).all(|sample| !(classes(&batch, sample)[0] && classes(&batch, sample)[1])));
        }
        for batch in batches(&recipe(1.0), &clouds) {
            assert!((0..2).all(|sample| classes(&batch, sample)[0] && classes(&batch, sample)[1]));
            // Both planes are at the lower end, within a cell, and the roofs 9.5 m above them.
            assert!(
                heights(&batch).iter().all(|z| (16..=17).contains(z) || (25..=27).contains(z)),
                "{:?}",
                heights(&batch)
            );
            // Parts of 314 cells each over the same place: hardly more columns than one has.
            let columns: std::collections::BTreeSet<[i64; 2]> = (0..batch.cells.len())
                .filter(|&cell| batch.cells.sites.position(cell).0 == 0)
                .map(|cell| batch.cells.sites.position(cell).1)
                .map(|[x, y, _]| [x, y])
                .collect();
            assert!(columns.len() < 500, "{}", columns.len());
        }
    }

    #[test]
    fn a_single_cloud_is_mixed_with_itself() {
        let cloud = [plane(0.0, 2, [0.0, 0.0])];
        let points = |mix| -> f32 {
            let count = |row: &[f32]| (3.0 * row[4]).exp() - 1.0;
            let own = |batch: &Prepared| batch.cells.inputs.chunks_exact(OWN).map(count).sum::<f32>();
            batches(&recipe(mix), &cloud).iter().map(own).sum()
        };
        assert!(points(1.0) > 1.5 * points(0.0), "{} {}", points(1.0), points(0.0));
    }

    #[test]
    fn two_views_of_a_part_share_the_cells_of_its_points() {
        let clouds = [plane(0.0, 2, [0.0, 0.0])];
        let views = |augment: Augmentation| {
            let mut recipe = UNetRecipe { augment, ..recipe(0.0) };
            recipe.learning.consistency = Some(1.0);
            batches(&recipe, &clouds)
        };
        let still = Augmentation { turn: false, scale: 0.0, noise: 0.0, thin: 1.0, hide: 0.0, mix: 0.0 };
        for batch in views(still) {
            let samples: Vec<u32> = (0..batch.cells.len()).map(|cell| batch.cells.sites.position(cell).0).collect();
            assert_eq!(samples.iter().copied().collect::<std::collections::BTreeSet<_>>().len(), 4, "two parts, twice");
            assert!(!batch.pairs.is_empty());
            for pair in &batch.pairs {
                let [a, b] = pair.map(|cell| batch.cells.sites.position(cell as usize));
                // Without any other change the views differ by a shift of less than a cell.
                assert!(a.0 + 1 == b.0 && a.0 % 2 == 0 && (0..3).all(|k| (a.1[k] - b.1[k]).abs() <= 1), "{a:?} {b:?}");
            }
            assert_eq!(batch.pairs.len() * 2, batch.cells.of_point.len(), "no point is left out");
        }
        // Thinned views share some of their points.
        let count = |batches: Vec<Prepared>| {
            let points: usize = batches.iter().map(|batch| batch.cells.of_point.len()).sum();
            (2 * batches.iter().map(|batch| batch.pairs.len()).sum::<usize>(), points)
        };
        let (shared, all) = count(views(Augmentation { thin: 0.1, ..still }));
        assert!(0 < shared && shared < all, "{shared} of {all}");
        // What is laid over a view is in no pair.
        let (shared, all) = count(views(Augmentation { mix: 1.0, ..still }));
        assert!(shared < all * 3 / 4, "{shared} of {all}");
        // Nor is what is excluded from training.
        let mut half = UNetRecipe { augment: still, ..recipe(0.0) };
        half.learning.consistency = Some(1.0);
        half.training.exclude = vec![[-1.0, -1.0, 10.0, 31.0]];
        let (shared, all) = count(batches(&half, &clouds));
        assert!(0 < shared && shared < all, "{shared} of {all}");
    }

    #[test]
    fn the_weight_of_views_rises_over_the_first_third_of_the_steps() {
        let e = |x: f64| (-5.0 * x).exp();
        for (step, expected) in [(0, e(1.0)), (50, e(0.25)), (100, 1.0), (299, 1.0)] {
            assert!((rise(step, 300) - expected).abs() < 1e-12, "{step}");
        }
        assert_eq!(rise(0, 1), e(1.0));
    }

    #[test]
    fn views_are_compared_by_default_if_hardly_any_point_has_a_label() {
        let train = |kept: usize| {
            let mut cloud = plane(0.0, 2, [0.0, 0.0]);
            let codes = (0..936).map(|i| (i % kept == 3).then_some(if i < 900 { 2 } else { 6 })).collect();
            cloud.labels = Labels::new(codes, CodeScheme::Asprs);
            recipe(0.0).train(&[cloud], &TrainOptions::default(), &Monitor::default()).unwrap()
        };
        let weight = |kept| train(kept).fitted.recipe.learning.consistency;
        assert_eq!((weight(30), weight(150)), (Some(0.0), Some(10.0)));
    }

    #[test]
    fn mixed_parts_give_the_same_model_on_any_number_of_threads() {
        let clouds = [plane(0.0, 2, [0.0, 0.0]), plane(40.0, 5, [5000.0, 300.0])];
        let train = |mix, threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| recipe(mix).train(&clouds, &TrainOptions::default(), &Monitor::default()).unwrap())
        };
        let model = train(0.5, 1);
        assert!(train(0.5, 3) == model && train(0.0, 1) != model);
        let views = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut recipe = recipe(0.5);
            recipe.learning.consistency = Some(5.0);
            pool.install(|| recipe.train(&clouds, &TrainOptions::default(), &Monitor::default()).unwrap())
        };
        let model = views(1);
        assert!(views(3) == model && model.trained != train(0.5, 1).trained);
        let mut many = recipe(0.0);
        many.learning.parts = 2049;
        assert!(many.validate().is_ok());
        many.learning.consistency = Some(1.0);
        assert!(many.validate().unwrap_err().to_string().contains("2048"));
        for mix in [-0.1, 1.5, f64::NAN] {
            let recipe = recipe(mix);
            assert!(recipe.validate().unwrap_err().to_string().contains("augment.mix"));
        }
    }
}
