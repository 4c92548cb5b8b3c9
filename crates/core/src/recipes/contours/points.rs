//! Training of the classifiers of points: a forest, then boosted trees that also see how likely the forest finds the points
//! around (auto-context: Z. Tu, X. Bai, IEEE TPAMI 32(10), 2010, doi:10.1109/TPAMI.2009.186).
//!
//! Each half of the training clouds is rated by the forest of the other, so that the second classifier learns from
//! likelihoods like those of clouds that no forest has seen.

use super::ContoursRecipe;
use super::likely::{CODES, CONTOUR, contour_likelihoods};
use crate::classification::{
    Boosting, BoostingParams, Classifier, Fingerprint, Forest, ForestParams, ForestPart, Learner, Predictor, Samples,
};
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::features::{self, Context, FeatureSet, Rated, RatedPoint};
use crate::parallel::Monitor;
use crate::recipes::classify::predict::CloudPredictor;
use crate::recipes::trained::{EarlierStage, Stage};
use crate::recipes::training::sources::{SampleSource, SampleSources};
use crate::recipes::training::{TrainingData, density};

/// The half to which a training cloud belongs.
pub(super) fn half_of(cloud: usize) -> usize {
    cloud % 2
}

/// What both classifiers of points learn from.
pub(super) struct PointLessons<'a> {
    recipe: &'a ContoursRecipe,
    data: &'a TrainingData<'a>,
    sources: &'a SampleSources,
    /// The scaled copies have a unit of their own.
    features: FeatureSet,
    density: f64,
}

/// Both classifiers of points, in their order.
pub(super) struct PointStages {
    /// Taught by all clouds.
    pub(super) all: Vec<EarlierStage>,
    /// Taught by each half of them.
    pub(super) halves: [Vec<EarlierStage>; 2],
}

/// Samples of all clouds, one after the other.
struct PointSamples {
    names: Vec<String>,
    /// Row-major.
    values: Vec<f32>,
    labels: Vec<u16>,
    weights: Vec<f32>,
    /// The half that each sample is from.
    halves: Vec<usize>,
}

impl PointSamples {
    /// No samples of these features yet.
    fn with_names(names: Vec<String>) -> Self {
        Self { names, values: Vec::new(), labels: Vec::new(), weights: Vec::new(), halves: Vec::new() }
    }

    fn samples(&self) -> Samples<'_> {
        let weights = (!self.weights.is_empty()).then_some(&self.weights[..]);
        Samples { features: &self.values, width: self.names.len(), labels: &self.labels, weights, classes: CODES.len() }
    }

    fn row(&self, sample: usize) -> &[f32] {
        &self.values[sample * self.names.len()..][..self.names.len()]
    }

    /// Those of one half.
    fn of_half(&self, half: usize) -> Self {
        let kept: Vec<usize> = (0..self.labels.len()).filter(|&sample| self.halves[sample] == half).collect();
        Self {
            names: self.names.clone(),
            values: kept.iter().flat_map(|&sample| self.row(sample)).copied().collect(),
            labels: kept.iter().map(|&sample| self.labels[sample]).collect(),
            weights: kept.iter().filter_map(|&sample| self.weights.get(sample)).copied().collect(),
            halves: vec![half; kept.len()],
        }
    }

    /// The forests of both halves, each with half of the trees.
    fn forests(&self, recipe: &ContoursRecipe, monitor: &Monitor) -> Result<[Forest; 2]> {
        let part = |half: usize| {
            let weight = |sample: usize| match self.halves[sample] == half {
                true => self.weights.get(sample).copied().unwrap_or(1.0),
                false => 0.0,
            };
            let trees = (recipe.forest.trees + 1 - half) / 2;
            let seed = recipe.forest.seed.wrapping_add(recipe.seed).wrapping_add(half as u64);
            let params = ForestParams { trees: trees.max(1), seed, ..recipe.forest.clone() };
            ForestPart { weights: (0..self.labels.len()).map(weight).collect(), params }
        };
        let forests = Forest::fit_parts(&self.samples(), &[part(0), part(1)], monitor)?;
        forests.try_into().map_err(|_| Error::input("two forests were asked for"))
    }

    /// A classifier of these samples, without the features that it does not use.
    fn stage(&self, classifier: Classifier, density: f64) -> EarlierStage {
        let (classifier, used) = classifier.retain_used();
        EarlierStage {
            feature_names: used.iter().map(|&column| self.names[column].clone()).collect(),
            fingerprint: Some(Fingerprint::of(&self.samples(), density).select(&used)),
            classifier,
        }
    }

    /// Boosted trees that these samples teach.
    fn boosted(&self, params: &BoostingParams, density: f64, monitor: &Monitor) -> Result<EarlierStage> {
        let trained: Boosting = params.train(&self.samples(), monitor)?;
        Ok(self.stage(Classifier::Boosting(trained), density))
    }
}

impl<'a> PointLessons<'a> {
    /// `data` has scaled clouds, in turn of the one and the other half.
    pub(super) fn new(
        recipe: &'a ContoursRecipe,
        data: &'a TrainingData<'a>,
        sources: &'a SampleSources,
        monitor: &Monitor,
    ) -> Result<Self> {
        for (half, name) in ["first", "second"].into_iter().enumerate() {
            let own = || sources.list.iter().filter(|source| half_of(source.cloud) == half).flat_map(|s| &s.candidates);
            if let Some(code) = CODES.into_iter().find(|&code| own().all(|sample| sample.code != code)) {
                let missing = ["off contours", "on contours"][usize::from(code)];
                return Err(Error::input(format!(
                    "the {name} half of the clouds has no labelled point {missing} (allowed: both kinds in each half)"
                )));
            }
        }
        let features = FeatureSet { metres_per_unit: None, ..recipe.features.clone() };
        Ok(Self { recipe, data, sources, features, density: density(data, monitor)? })
    }

    pub(super) fn learn(&self, monitor: &Monitor) -> Result<PointStages> {
        let first = self.described(monitor)?;
        let forests = first.forests(self.recipe, monitor)?;
        let second = self.with_context(&first, &forests, monitor)?;
        let seed = self.recipe.boosting.seed.wrapping_add(self.recipe.seed);
        let params = BoostingParams { seed, ..self.recipe.boosting.clone() };
        let halves = [0, 1].map(|half| {
            let forest = first.of_half(half).stage(Classifier::Forest(forests[half].clone()), self.density);
            Ok(vec![forest, second.of_half(half).boosted(&params, self.density, monitor)?])
        });
        let [one, other] = halves;
        let [a, b] = &forests;
        let joined = first.stage(Classifier::Forest(a.joined(b)?), self.density);
        let all = vec![joined, second.boosted(&params, self.density, monitor)?];
        Ok(PointStages { all, halves: [one?, other?] })
    }

    /// The samples with the features of the set.
    fn described(&self, monitor: &Monitor) -> Result<PointSamples> {
        let mut samples = PointSamples::with_names(Vec::new());
        samples.weights = self.sources.sample_weights();
        for source in &self.sources.list {
            source.with_scene(self.data, monitor, |scene| {
                let points = source.points();
                let (table, _) = features::table_at(scene, &self.features, &points, monitor)?;
                samples.values.extend_from_slice(&table.values);
                samples.labels.extend(source.labels(&self.sources.classes));
                samples.halves.resize(samples.labels.len(), half_of(source.cloud));
                samples.names = table.names;
                Ok(())
            })?;
        }
        Ok(samples)
    }

    /// The samples that are rated again, with what the forest of the other half says about their surroundings as further
    /// features.
    fn with_context(&self, first: &PointSamples, forests: &[Forest; 2], monitor: &Monitor) -> Result<PointSamples> {
        let around = self.recipe.context.names(&CODES[CONTOUR..]);
        let forests = forests.clone().map(Classifier::Forest);
        let mut samples = PointSamples::with_names(first.names.iter().cloned().chain(around.iter().cloned()).collect());
        let mut sample = 0;
        for source in &self.sources.list {
            let classifier = &forests[1 - half_of(source.cloud)];
            source.with_scene(self.data, monitor, |scene| {
                let stage = Stage { names: &first.names, classifier, training: None };
                for row in self.surroundings(source, scene, stage, monitor)?.chunks_exact(around.len()) {
                    // The first column of the surroundings is the likelihood of the point itself.
                    if self.recipe.rated_again(row[0]) {
                        samples.values.extend_from_slice(first.row(sample));
                        samples.values.extend_from_slice(row);
                        samples.labels.push(first.labels[sample]);
                        samples.halves.push(first.halves[sample]);
                        samples.weights.extend(first.weights.get(sample));
                    }
                    sample += 1;
                }
                Ok(())
            })?;
        }
        Ok(samples)
    }

    /// What a classifier says about the surroundings of the samples of a source, row-major.
    fn surroundings(
        &self,
        source: &SampleSource,
        scene: &MetricCloud<'_>,
        stage: Stage<'_>,
        monitor: &Monitor,
    ) -> Result<Vec<f32>> {
        let points = scene.some_points(monitor)?;
        let row_of = points.frame.rows(scene.cloud.len());
        let predictor = CloudPredictor::new(scene, &self.features, stage, monitor)?;
        let rating = predictor.of_points(&row_of, points.len(), monitor)?;
        let likelihoods = contour_likelihoods(&rating.probabilities);
        let rated = Rated { points: &points.positions, probabilities: &likelihoods, classes: 1 };
        let context = Context::new(&rated, &self.recipe.context, monitor)?;
        let samples = source.points();
        let mut rows = vec![0.0; samples.len() * context.width()];
        for (&point, row) in samples.iter().zip(rows.chunks_exact_mut(context.width())) {
            let at = row_of[point as usize] as usize;
            context.describe(RatedPoint { at: points.positions.xyz(at), own: &likelihoods[at..=at] }, row);
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::super::likely::{CONTOUR, rate};
    use super::super::scaled::Scale;
    use super::super::{ContoursRecipe, labelled_scene};
    use crate::classification::{BoostingParams, ForestParams};
    use crate::cloud::MetricCloud;
    use crate::parallel::Monitor;
    use crate::recipes::contours::train::train;
    use crate::recipes::training::samples::TrainingParams;
    use crate::synthetic::{SceneKind, SceneParams, scene};

    #[test]
    fn points_that_the_forest_finds_likely_are_rated_again_and_better() {
        let monitor = Monitor::default();
        let forest = ForestParams { trees: 10, ..ForestParams::default() };
        let recipe = ContoursRecipe {
            training: TrainingParams { max_samples: 8000, ..TrainingParams::default() },
            candidate_forest: ForestParams { trees: 5, ..forest.clone() },
            forest,
            boosting: BoostingParams { rounds: 20, ..BoostingParams::default() },
            ..ContoursRecipe::default()
        };
        let room = |seed: u64| {
            let params = SceneParams { seed, rays: 60_000, ..SceneParams::of(SceneKind::Indoor) };
            labelled_scene(&recipe, &scene(&params, &monitor).unwrap(), &monitor).unwrap()
        };
        let (rooms, unseen) = ([room(0), room(1)], room(2));
        let trained = train(&recipe, &rooms, &monitor).unwrap().trained;
        let [first, _] = &trained.earlier[..] else { panic!("{} classifiers of points", trained.earlier.len()) };
        let metric = MetricCloud::new(&unseen.cloud, None, &monitor).unwrap();
        let scale = Scale::of(&recipe, &metric, &monitor).unwrap();
        let scaled = scale.scene(&metric);
        let likelihoods = |stages: &[_]| -> Vec<f32> {
            let rated = rate(&recipe, &scaled, stages, &monitor).unwrap();
            rated.probabilities.chunks_exact(2).map(|row| row[CONTOUR]).collect()
        };
        let (once, twice) = (likelihoods(std::slice::from_ref(first)), likelihoods(&trained.earlier));
        let unlikely = |p: f32| f64::from(p) < recipe.least_rated;
        let kept = once.iter().zip(&twice).filter(|(once, twice)| unlikely(**once) && once == twice).count();
        assert_eq!(kept, once.iter().filter(|&&p| unlikely(p)).count());
        let changed = once.iter().zip(&twice).filter(|(once, twice)| once != twice).count();
        assert!(kept > once.len() / 10 && changed > once.len() / 10, "{kept} kept, {changed} changed");
        // Precision where as many points are taken for contours as there are.
        let precision = |likelihoods: &[f32]| {
            let codes = &unseen.labels.codes;
            let mut labelled: Vec<usize> = (0..codes.len()).filter(|&point| codes[point].is_some()).collect();
            labelled.sort_by(|&a, &b| likelihoods[b].total_cmp(&likelihoods[a]));
            let on = |points: &[usize]| points.iter().filter(|&&point| codes[point] == Some(1)).count();
            let all = on(&labelled);
            on(&labelled[..all]) as f64 / all as f64
        };
        let [before, after] = [precision(&once), precision(&twice)];
        assert!(after > before, "{before} {after}");
    }
}
