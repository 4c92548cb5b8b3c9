//! Training of both stages.

use super::AutoContextRecipe;
use super::classify::above_ground;
use super::folds::Squares;
use super::report::AutoContextReport;
use crate::classification::{
    Boosting, BoostingParams, Classifier, Fingerprint, Forest, ForestParams, ForestPart, Learner, Predictor, Samples,
    argmax,
};
use crate::cloud::{MetricCloud, Points};
use crate::error::{Error, Result};
use crate::features::definition::{Feature, Scope};
use crate::features::{self, Context, Rated, RatedPoint};
use crate::parallel::Monitor;
use crate::recipes::classify::predict::CloudPredictor;
use crate::recipes::regularise::Regularise;
use crate::recipes::trained::{EarlierStage, Stage, Trained};
use crate::recipes::training::choice::{ChoiceReport, CrossTraining, Labelled, NeededPoints, Trial, choose};
use crate::recipes::training::sources::{SampleSource, SampleSources};
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{Fitted, LabelledCloud, Nothing, System, TrainingResult};

pub(super) fn train(
    recipe: &AutoContextRecipe,
    clouds: &[LabelledCloud],
    monitor: &Monitor,
) -> Result<TrainingResult<AutoContextRecipe>> {
    recipe.validate()?;
    let data = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    let sources = SampleSources::select(&data, &recipe.training, recipe.seed, monitor)?;
    let lessons = Lessons { recipe, data: &data, sources: &sources };
    let mut first = lessons.first_stage(monitor)?;
    let halves = first.halves(&lessons, monitor)?;
    let (second, right) = lessons.second_stage(&mut first, &halves, monitor)?;
    let samples = second.samples(&sources);
    let boosting = BoostingParams { seed: recipe.boosting.seed.wrapping_add(recipe.seed), ..recipe.boosting.clone() };
    let regularisation = chosen_regularisation(&second, &lessons, &boosting, monitor)?;
    let recipe = AutoContextRecipe {
        regularise: regularisation.as_ref().map_or(recipe.regularise.clone(), |r| r.applied_to(&recipe.regularise)),
        ..recipe.clone()
    };
    let trained: Boosting = boosting.train(&samples, monitor)?;
    let density = density(&data, monitor)?;
    let fingerprint = Fingerprint::of(&samples, density);
    let (trained, used) = trained.retain_used();
    let report = AutoContextReport {
        classes: sources.counts.clone(),
        unlabelled: data.unlabelled(),
        first_stage_accuracy: right as f64 / second.labels.len().max(1) as f64,
        square: recipe.folds.square,
        first_features: first.names.len(),
        used_features: used.len(),
        regularisation,
        warnings: sources.warnings.clone(),
    };
    let [a, b] = halves;
    let trained = Trained {
        network: None,
        cars: None,
        earlier: vec![EarlierStage {
            fingerprint: Some(Fingerprint::of(&first.samples(&sources), density)),
            feature_names: first.names,
            classifier: Classifier::Forest(a.joined(&b)?),
        }],
        fingerprint: fingerprint.select(&used),
        feature_names: used.iter().map(|&f| second.names[f].clone()).collect(),
        classes: sources.classes.clone(),
        classifier: Classifier::Boosting(trained),
    };
    Ok(TrainingResult { fitted: Fitted { recipe, learned: Nothing {} }, trained, report })
}

/// The comparison of regularisations on held-out patches; `None` if the recipe names one. Points are rated by the forest
/// of the other colour, then by boosted trees of the other colour.
fn chosen_regularisation(
    second: &StageSamples,
    lessons: &Lessons<'_>,
    boosting: &BoostingParams,
    monitor: &Monitor,
) -> Result<Option<ChoiceReport>> {
    let params = &lessons.recipe.regularise;
    if params.method != Regularise::Auto {
        return Ok(None);
    }
    let training = CrossTraining {
        samples: second.samples(lessons.sources),
        colours: &second.folds,
        classes: &lessons.sources.classes,
        seed: lessons.recipe.seed,
        learn: |samples: &Samples<'_>, monitor: &Monitor| boosting.train(samples, monitor).map(Classifier::Boosting),
    };
    choose(&second.trials, &training, params, monitor).map(Some)
}

/// What the training of both stages reads.
struct Lessons<'a> {
    recipe: &'a AutoContextRecipe,
    data: &'a TrainingData<'a>,
    sources: &'a SampleSources,
}

/// The samples of a stage, of all sources one after the other.
#[derive(Default)]
struct StageSamples {
    names: Vec<String>,
    values: Vec<f32>,
    labels: Vec<u16>,
    /// Fold of each sample, 0 or 1.
    folds: Vec<usize>,
    weights: Vec<f32>,
    /// Of each source, the patches on which regularisations are compared; without points if there is nothing to choose.
    trials: Vec<Trial>,
}

/// A source as it is described: with heights above the ground, and without some of its columns.
pub(super) struct Prepared<'a> {
    pub(super) scene: MetricCloud<'a>,
    points: Points,
    squares: Squares<'a>,
}

/// How a source is prepared.
pub(super) struct Preparation<'a> {
    pub(super) recipe: &'a AutoContextRecipe,
    /// Seed of the choice of squares without optional columns.
    pub(super) seed: u64,
}

impl Preparation<'_> {
    /// Calls `work` with a prepared source.
    pub(super) fn with<T>(
        &self,
        scene: &MetricCloud<'_>,
        monitor: &Monitor,
        work: impl FnOnce(&Prepared<'_>) -> Result<T>,
    ) -> Result<T> {
        let squares = Squares { params: &self.recipe.folds, metres: scene.metres, seed: self.seed };
        let changed = squares.with_missing(scene, &self.recipe.columns())?;
        let cloud = changed.as_ref().unwrap_or(scene.cloud);
        let points = scene.points(monitor)?;
        let heights = above_ground(scene, &points, self.recipe, monitor)?.heights;
        let scene = MetricCloud { cloud, heights: Some(&heights), ..scene.clone() };
        work(&Prepared { scene, points, squares })
    }
}

impl StageSamples {
    fn samples(&self, sources: &SampleSources) -> Samples<'_> {
        let weights = (!self.weights.is_empty()).then_some(&self.weights[..]);
        Samples {
            features: &self.values,
            width: self.names.len(),
            labels: &self.labels,
            weights,
            classes: sources.classes.len(),
        }
    }

    fn row(&self, sample: usize) -> &[f32] {
        &self.values[sample * self.names.len()..][..self.names.len()]
    }

    /// The forests of both colours of the checkerboard, each with half of the trees.
    fn halves(&self, lessons: &Lessons<'_>, monitor: &Monitor) -> Result<[Forest; 2]> {
        let recipe = lessons.recipe;
        let part = |fold: usize| {
            let weight = |i: usize| match self.folds[i] == fold {
                true => self.weights.get(i).copied().unwrap_or(1.0),
                false => 0.0,
            };
            let weights: Vec<f32> = (0..self.labels.len()).map(weight).collect();
            if weights.iter().all(|&w| w == 0.0) {
                let square = recipe.folds.square;
                let expected = "smaller squares: all samples lie in squares of one colour";
                return Err(Error::parameter("folds.square", square, expected));
            }
            let trees = (recipe.forest.trees + 1 - fold) / 2;
            let seed = recipe.forest.seed.wrapping_add(recipe.seed).wrapping_add(fold as u64);
            Ok(ForestPart { weights, params: ForestParams { trees, seed, ..recipe.forest.clone() } })
        };
        let forests = Forest::fit_parts(&self.samples(lessons.sources), &[part(0)?, part(1)?], monitor)?;
        forests.try_into().map_err(|_| Error::input("two forests were asked for"))
    }
}

impl Lessons<'_> {
    /// Calls `work` with each source.
    fn each(&self, monitor: &Monitor, mut work: impl FnMut(&SampleSource, &Prepared<'_>) -> Result<()>) -> Result<()> {
        for (number, source) in self.sources.list.iter().enumerate() {
            let preparation = Preparation { recipe: self.recipe, seed: self.recipe.seed.wrapping_add(number as u64) };
            source.with_scene(self.data, monitor, |scene| {
                preparation.with(scene, monitor, |prepared| work(source, prepared))
            })?;
        }
        Ok(())
    }

    /// The samples with all features of the set.
    fn first_stage(&self, monitor: &Monitor) -> Result<StageSamples> {
        let mut described = StageSamples { weights: self.sources.sample_weights(), ..StageSamples::default() };
        self.each(monitor, |source, prepared| {
            let Prepared { scene, squares, .. } = prepared;
            let points = source.points();
            let plan = self.plan(source, prepared, monitor)?;
            let (table, _) = features::table_at(scene, &self.recipe.features, &plan.points, monitor)?;
            described.values.extend_from_slice(&table.values[..points.len() * table.width()]);
            described.trials.push(plan.into_trial(&table));
            described.labels.extend(source.labels(&self.sources.classes));
            described.folds.extend(points.iter().map(|&p| squares.fold(scene.cloud.xyz(p as usize))));
            described.names = table.names;
            Ok(())
        })?;
        Ok(described)
    }

    /// The points of a source whose features are needed: its samples and, if a regularisation is to be chosen, patches.
    fn plan(&self, source: &SampleSource, prepared: &Prepared<'_>, monitor: &Monitor) -> Result<NeededPoints> {
        let AutoContextRecipe { regularise, training, .. } = self.recipe;
        if regularise.method != Regularise::Auto {
            return Ok(NeededPoints::samples(&source.points()));
        }
        let codes = source.codes(self.data, &self.sources.classes, training);
        let Prepared { scene, squares, .. } = prepared;
        let labelled = Labelled { scene, codes: &codes, board: squares.board(), seed: squares.seed };
        NeededPoints::new(&labelled, &source.points(), &regularise.choice, monitor)
    }

    /// The samples with the features of the second stage, and how many of them the first stage names right.
    fn second_stage(
        &self,
        first: &mut StageSamples,
        halves: &[Forest; 2],
        monitor: &Monitor,
    ) -> Result<(StageSamples, u64)> {
        let codes = self.sources.classes.codes();
        let kept = self.kept(&first.names);
        let own = kept.iter().map(|&column| first.names[column].clone());
        let mut described = StageSamples {
            names: own.chain(self.recipe.context.names(&codes)).collect(),
            labels: first.labels.clone(),
            weights: first.weights.clone(),
            folds: first.folds.clone(),
            ..StageSamples::default()
        };
        let mut trials = std::mem::take(&mut first.trials).into_iter();
        let halves = halves.clone().map(Classifier::Forest);
        let (mut sample, mut right) = (0, 0);
        self.each(monitor, |source, prepared| {
            let rated = self.rated(&first.names, &halves, prepared, monitor)?;
            let rated = Rated { points: &prepared.points.positions, probabilities: &rated, classes: codes.len() };
            let context = Context::new(&rated, &self.recipe.context, monitor)?;
            let row_of = prepared.points.frame.rows(prepared.scene.cloud.len());
            let mut around = vec![0.0; context.width()];
            for point in source.points() {
                let row = row_of[point as usize] as usize;
                let own = &rated.probabilities[row * codes.len()..][..codes.len()];
                context.describe(RatedPoint { at: prepared.points.positions.xyz(row), own }, &mut around);
                described.values.extend(kept.iter().map(|&column| first.row(sample)[column]));
                described.values.extend_from_slice(&around);
                right += u64::from(argmax(own) == usize::from(first.labels[sample]));
                sample += 1;
            }
            let mut trial = trials.next().unwrap_or_default();
            let mut rows = Vec::with_capacity(trial.points.len() * described.names.len());
            for (own, &point) in trial.rows.chunks_exact(first.names.len()).zip(&trial.points) {
                let row = row_of[point as usize] as usize;
                let rated = &rated.probabilities[row * codes.len()..][..codes.len()];
                context.describe(RatedPoint { at: prepared.points.positions.xyz(row), own: rated }, &mut around);
                rows.extend(kept.iter().map(|&column| own[column]));
                rows.extend_from_slice(&around);
            }
            trial.rows = rows;
            described.trials.push(trial);
            Ok(())
        })?;
        Ok((described, right))
    }

    /// Columns of the first stage that the second uses as well.
    fn kept(&self, names: &[String]) -> Vec<usize> {
        let wanted = |name: &str| self.recipe.pyramid_twice || Feature::named(name, Scope::Level).is_none();
        (0..names.len()).filter(|&column| wanted(&names[column])).collect()
    }

    /// The probabilities of all points, each by the forest of the other colour.
    fn rated(
        &self,
        names: &[String],
        halves: &[Classifier; 2],
        prepared: &Prepared<'_>,
        monitor: &Monitor,
    ) -> Result<Vec<f32>> {
        let Prepared { scene, points, squares } = prepared;
        let row_of = points.frame.rows(scene.cloud.len());
        let classes = self.sources.classes.len();
        let by = |classifier| {
            let stage = Stage { names, classifier, training: None };
            let predictor =
                CloudPredictor::new(scene, &self.recipe.features, stage, monitor)?.by_voxel(self.recipe.rated_voxel);
            Ok::<_, Error>(predictor.of_points(&row_of, points.len(), monitor)?.probabilities)
        };
        let [a, mut b] = [by(&halves[0])?, by(&halves[1])?];
        for (row, &point) in points.frame.index.iter().enumerate() {
            if squares.fold(scene.cloud.xyz(point as usize)) == 1 {
                b[row * classes..][..classes].copy_from_slice(&a[row * classes..][..classes]);
            }
        }
        Ok(b)
    }
}
