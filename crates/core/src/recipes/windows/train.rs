//! Training: steps on points drawn from the clouds, which are turned from time to time, then the summary of what the
//! network has learned.

use super::WindowsRecipe;
use super::occupancy::{Frame, Occupancy};
use crate::classification::{Classifier, Fingerprint, Samples};
use crate::cloud::{MetricCloud, Positions};
use crate::error::Result;
use crate::nn::layers::cross_entropy;
use crate::nn::networks::{Mode, WindowNet};
use crate::nn::parameters::Parameters;
use crate::nn::sparse::SparseTensor;
use crate::parallel::{Monitor, map_ordered};
use crate::random::{Stream, stream};
use crate::recipes::training::networks::{
    Checkpoint, Drawn, Labelled, NetworkReport, Progress, automatic_voxel, drawn, linear_of, names,
};
use crate::recipes::training::sources::{SampleSource, SampleSources};
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{Fitted, LabelledCloud, Nothing, System, TrainOptions, Trained, TrainingResult};
use sha2::Digest;

/// Steps whose points are looked at for the summary.
const LOOKED_AT: u64 = 8;
/// The random stream of the first turn; those below are of the parameters and steps.
const TURNS: u64 = 1 << 40;

/// A cloud, or a thinned copy of one.
struct TrainingCloud {
    positions: Positions,
    labelled: Labelled,
}

/// Clouds, network and settings of a training.
struct Training<'a> {
    recipe: &'a WindowsRecipe,
    frame: Frame,
    scenes: Vec<TrainingCloud>,
    classes: usize,
    net: WindowNet,
}

/// The clouds in cells, as they are turned for some steps.
struct Turned {
    /// How often they were turned before.
    turn: u64,
    clouds: Vec<Occupancy>,
}

/// The windows and classes of the points of a step.
struct Batch {
    windows: Vec<SparseTensor<f32>>,
    classes: Vec<u16>,
}

pub(super) fn train(
    recipe: &WindowsRecipe,
    clouds: &[LabelledCloud],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<TrainingResult<WindowsRecipe>> {
    recipe.validate()?;
    let data = TrainingData::new(clouds, None, monitor)?;
    let sources = SampleSources::select(&data, &recipe.training, recipe.seed, monitor)?;
    let voxel = match recipe.voxel {
        Some(voxel) => voxel,
        None => automatic_voxel(&data, monitor)?,
    };
    let recipe = WindowsRecipe { voxel: Some(voxel), ..recipe.clone() };
    let scene = |source: &SampleSource| {
        let codes = source.codes(&data, &sources.classes, &recipe.training);
        source.with_scene(&data, monitor, |scene: &MetricCloud<'_>| {
            let points = scene.some_points(monitor)?;
            let labelled = Labelled::new(&points, &codes, source, &sources.classes);
            Ok(TrainingCloud { positions: points.positions, labelled })
        })
    };
    let scenes = sources.list.iter().map(scene).collect::<Result<Vec<_>>>()?;
    let classes = sources.classes.len();
    let (net, parameters) = WindowNet::new::<f32>(&recipe.network, classes, recipe.seed)?;
    let training = Training { recipe: &recipe, frame: Frame::of(&recipe, voxel), scenes, classes, net };
    let feed = |sum: &mut _| training.scenes.iter().for_each(|scene| scene.feed(sum));
    let file = options.checkpoint.as_deref().map(|path| Checkpoint::new(path, &recipe, feed)).transpose()?;
    let mut progress = Progress::new(parameters);
    file.as_ref().map_or(Ok(()), |file| file.resume(&mut progress))?;
    training.run(&mut progress, file.as_ref(), monitor)?;
    let Progress { parameters, losses, cells, .. } = progress;
    let summary = training.summary(&parameters, density(&data, monitor)?, monitor)?;
    let [weights, bias] = training.net.head().map(|id| parameters.get(id));
    let head = linear_of([weights, bias], &summary)?;
    let windows = losses.len() * recipe.learning.batch * recipe.network.scales;
    let report = NetworkReport {
        classes: sources.counts,
        unlabelled: data.unlabelled(),
        voxel,
        consistency: 0.0,
        parameters: parameters.trained(),
        cells: cells as f64 / windows as f64,
        losses,
        warnings: sources.warnings,
    };
    let trained = Trained {
        feature_names: names(training.net.width()),
        classes: sources.classes,
        fingerprint: summary,
        classifier: Classifier::Linear(head),
        cars: None,
        earlier: Vec::new(),
        network: Some(parameters.sorted()),
    };
    Ok(TrainingResult { fitted: Fitted { recipe: recipe.clone(), learned: Nothing {} }, trained, report })
}

impl TrainingCloud {
    /// Feeds all that is learned from to a checksum.
    fn feed(&self, sum: &mut impl Digest) {
        let Positions { x, y, z } = &self.positions;
        [x, y, z].into_iter().flatten().for_each(|v| sum.update(v.to_le_bytes()));
        self.labelled.feed(sum);
    }

    /// The positions, turned about a vertical line through the middle of the cloud.
    fn turned(&self, angle: f64) -> Positions {
        let Positions { x, y, z } = &self.positions;
        let middle = |axis: &Vec<f32>| {
            let [low, high] =
                axis.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], &v| [low.min(v), high.max(v)]);
            (f64::from(low) + f64::from(high)) / 2.0
        };
        let ([cx, cy], [cos, sin]) = ([middle(x), middle(y)], [angle.cos(), angle.sin()]);
        let place = |(&x, &y): (&f32, &f32)| {
            let [x, y] = [f64::from(x) - cx, f64::from(y) - cy];
            [cos * x - sin * y, sin * x + cos * y].map(|v| v as f32)
        };
        let (x, y) = x.iter().zip(y).map(place).map(|[x, y]| (x, y)).unzip();
        Positions { x, y, z: z.clone() }
    }
}

impl Training<'_> {
    /// The clouds as they are at a step, in cells.
    fn turned(&self, step: u64, monitor: &Monitor) -> Result<Turned> {
        let turn = self.turn(step);
        let mut draws = stream(self.recipe.seed, TURNS + turn);
        let clouds = self.scenes.iter().map(|scene| {
            let angle = std::f64::consts::TAU * draws.uniform();
            let positions = if turn == 0 { scene.positions.clone() } else { scene.turned(angle) };
            Occupancy::new(self.frame, positions, monitor)
        });
        Ok(Turned { turn, clouds: clouds.collect::<Result<Vec<_>>>()? })
    }

    /// How often the clouds were turned before a step.
    fn turn(&self, step: u64) -> u64 {
        step.checked_div(self.recipe.learning.turn_every as u64).unwrap_or(0)
    }

    /// The points of a step; `draws` then serves for what the network drops.
    fn batch(&self, turned: &Turned, draws: &mut Stream, monitor: &Monitor) -> Result<Batch> {
        let scenes: Vec<&Labelled> = self.scenes.iter().map(|scene| &scene.labelled).collect();
        let points = (0..self.recipe.learning.batch).map(|_| drawn(&scenes, draws));
        let points: Vec<Drawn> = points.collect::<Result<_>>()?;
        let windows =
            map_ordered(points.len(), monitor, |i| Ok(turned.clouds[points[i].scene].windows(points[i].point)))?;
        let classes = points.iter().map(|point| point.class as u16).collect();
        Ok(Batch { windows: super::occupancy::tensors(&self.frame, &windows)?, classes })
    }

    /// All steps that are left.
    fn run(&self, progress: &mut Progress, file: Option<&Checkpoint<'_>>, monitor: &Monitor) -> Result<()> {
        let steps = self.recipe.learning.steps;
        monitor.stage("train", steps as u64);
        monitor.advance(progress.losses.len() as u64);
        let mut turned: Option<Turned> = None;
        for step in progress.losses.len()..steps {
            monitor.check()?;
            let now = match turned.take().filter(|turned| turned.turn == self.turn(step as u64)) {
                Some(turned) => turned,
                None => self.turned(step as u64, monitor)?,
            };
            self.step(step as u64, &now, progress, monitor)?;
            turned = Some(now);
            file.map_or(Ok(()), |file| file.follow(progress, steps))?;
            monitor.advance(1);
        }
        Ok(())
    }

    fn step(&self, step: u64, turned: &Turned, progress: &mut Progress, monitor: &Monitor) -> Result<()> {
        let learning = &self.recipe.learning;
        let mut draws = stream(self.recipe.seed, 1 + step);
        let Batch { windows, classes } = self.batch(turned, &mut draws, monitor)?;
        let cells = windows.iter().map(|window| window.len() as u64).sum();
        progress.cells = progress.cells.saturating_add(cells);
        let mut targets = vec![0.0f32; classes.len() * self.classes];
        let rows = targets.chunks_exact_mut(self.classes);
        rows.zip(&classes).for_each(|(row, &class)| row[usize::from(class)] = 1.0);
        let pass = self.net.pass(&progress.parameters, windows, Mode::Training(&mut draws), monitor)?;
        let loss = cross_entropy(pass.scores(), &targets, self.classes);
        let gradients = pass.backward(&loss.gradient, monitor)?;
        let rate = learning.rate * learning.schedule.factor(step, learning.steps as u64);
        learning.optimiser.step(&mut progress.parameters, &gradients, rate, &mut progress.state)?;
        progress.losses.push(loss.value);
        Ok(())
    }

    /// Summary of the features of points as they are drawn.
    fn summary(&self, parameters: &Parameters<f32>, density: f64, monitor: &Monitor) -> Result<Fingerprint> {
        let (mut rows, mut labels) = (Vec::new(), Vec::new());
        let turned = self.turned(0, monitor)?;
        for step in 0..LOOKED_AT {
            let Batch { windows, classes } = self.batch(&turned, &mut stream(self.recipe.seed, 1 + step), monitor)?;
            rows.extend(self.net.pass(parameters, windows, Mode::Prediction, monitor)?.into_hidden());
            labels.extend(classes);
        }
        let width = self.net.width();
        let samples = Samples { features: &rows, width, labels: &labels, weights: None, classes: self.classes };
        Ok(Fingerprint::of(&samples, density))
    }
}
