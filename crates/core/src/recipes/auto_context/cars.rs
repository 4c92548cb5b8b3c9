//! Cars: a classifier beside the two stages of a trained model. It learns which of the points that the model classifies
//! as vegetation or building are cars; the results of the two stages do not change.

use super::AutoContextRecipe;
use super::classify::first_stage;
use super::train::Preparation;
use crate::classes::ClassTable;
use crate::classification::{Boosting, BoostingParams, ClassWeight, Classifier, Learner, Samples};
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::random::stream;
use crate::recipes::LabelledCloud;
use crate::recipes::classify::candidates::Candidates;
use crate::recipes::classify::predict::{ContextColumns, Group};
use crate::recipes::trained::Trained;
use crate::recipes::training::TrainingData;
use crate::recipes::training::samples::{Candidate, copies};
use crate::recipes::training::sources::{SampleSource, limited};
use serde::Serialize;

/// Training of the classifier of cars.
#[derive(Clone, Debug, PartialEq)]
pub struct CarTraining {
    /// Code of cars in the labels; all other labelled points are other things.
    pub code: u8,
    /// At most this many samples of cars, and of other things, from each cloud and each of its thinned copies; 0: all.
    pub per_copy: usize,
    /// The classifier.
    pub boosting: BoostingParams,
}

impl Default for CarTraining {
    fn default() -> Self {
        let boosting = BoostingParams { rounds: 250, class_weight: ClassWeight::Balanced, ..BoostingParams::default() };
        Self { code: 64, per_copy: 8000, boosting }
    }
}

/// What the classifier of cars has learned from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CarReport {
    /// Number of labelled points of cars.
    pub points: u64,
    /// Number of samples of cars: points that the model takes for vegetation or buildings.
    pub cars: u64,
    /// Number of samples of other things.
    pub others: u64,
}

/// Samples of all sources, one after the other.
#[derive(Default)]
struct CarSamples {
    features: Vec<f32>,
    /// 1: cars.
    labels: Vec<u16>,
}

/// The labelled points of a source that may be cars.
#[derive(Default)]
struct Seen {
    /// The row of each point of the source; `NONE` for those that are no candidates.
    row_of: Vec<u32>,
    /// Whether each row is a car.
    cars: Vec<bool>,
    /// Row-major.
    features: Vec<f32>,
}

const NONE: u32 = u32::MAX;

/// A trained model that learns cars.
pub(in crate::recipes) struct CarLessons<'a> {
    pub(in crate::recipes) recipe: &'a AutoContextRecipe,
    pub(in crate::recipes) trained: &'a Trained,
    pub(in crate::recipes) training: &'a CarTraining,
}

impl CarLessons<'_> {
    /// The classifier of cars, and what it has learned from.
    ///
    /// # Errors
    /// If the model is not one that can learn cars, no samples of cars or of other things are found, or the work was
    /// cancelled.
    pub(in crate::recipes) fn learn(
        &self,
        clouds: &[LabelledCloud],
        monitor: &Monitor,
    ) -> Result<(Classifier, CarReport)> {
        let Self { recipe, trained, training } = self;
        training.boosting.validate()?;
        let data = TrainingData::new(clouds, recipe.features.metres_per_unit, monitor)?;
        let (mut samples, mut sources) = (CarSamples::default(), 0);
        for (c, scene) in data.scenes.iter().enumerate() {
            for copy in copies(&scene.metric, &recipe.training, recipe.seed.wrapping_add(c as u64), monitor)? {
                let source = SampleSource { cloud: c, copy, candidates: Vec::new() };
                let codes =
                    source.codes(&data, &ClassTable::from_codes(&(0..=255).collect::<Vec<u8>>()), &recipe.training);
                source.with_scene(&data, monitor, |scene| {
                    let seen = self.seen(scene, &codes, sources, monitor)?;
                    self.choose(&seen, sources, &mut samples);
                    Ok(())
                })?;
                sources += 1;
            }
        }
        let cars = samples.labels.iter().filter(|&&label| label == 1).count() as u64;
        let others = samples.labels.len() as u64 - cars;
        if cars == 0 || others == 0 {
            return Err(Error::input(format!(
                "{cars} samples of cars (code {}) and {others} of other things: both are needed among the points that the \
                 model takes for vegetation or buildings",
                training.code
            )));
        }
        let seed = training.boosting.seed.wrapping_add(recipe.seed);
        let boosting = BoostingParams { seed, ..training.boosting.clone() };
        let (features, width) = (&samples.features[..], trained.feature_names.len());
        let samples = Samples { features, width, labels: &samples.labels, weights: None, classes: 2 };
        let boosted: Boosting = boosting.train(&samples, monitor)?;
        Ok((Classifier::Boosting(boosted), CarReport { points: data.points_with(training.code), cars, others }))
    }

    /// The labelled points of a cloud or copy, number `number`, that may be cars; `codes` are its labels.
    fn seen(&self, scene: &MetricCloud<'_>, codes: &[Option<u8>], number: u64, monitor: &Monitor) -> Result<Seen> {
        let Self { recipe, trained, training } = self;
        let preparation = Preparation { recipe, seed: recipe.seed.wrapping_add(number) };
        let mut seen = Seen { row_of: vec![NONE; scene.cloud.len()], ..Seen::default() };
        preparation.with(scene, monitor, |prepared| {
            let scene = &prepared.scene;
            let (first, rated) = first_stage(recipe, trained, scene, monitor)?;
            let classes = trained.classes.codes();
            let context =
                ContextColumns { probabilities: &first.probabilities, params: &recipe.context, codes: &classes };
            let second = rated.second(scene, trained.stage(), context, monitor)?;
            let keep = |group: &Group| {
                // Of a point that is given more than once the last features are valid.
                group.points.iter().for_each(|&point| seen.row_of[point as usize] = NONE);
                let rows = group.candidates.features.chunks_exact(trained.feature_names.len());
                for (&place, row) in group.candidates.places.iter().zip(rows) {
                    let point = group.points[place as usize] as usize;
                    if let Some(code) = codes[point] {
                        seen.row_of[point] = seen.cars.len() as u32;
                        seen.cars.push(code == training.code);
                        seen.features.extend_from_slice(row);
                    }
                }
            };
            let wanted = Candidates::to_learn(trained, scene.heights.unwrap_or_default())?;
            second.with_candidates(Some(wanted)).run(keep, monitor)?;
            Ok(())
        })?;
        Ok(seen)
    }

    /// Adds some of the points of source number `number` to the samples.
    fn choose(&self, seen: &Seen, number: u64, samples: &mut CarSamples) {
        let rows = seen.row_of.iter().filter(|&&row| row != NONE);
        let candidate = |&row: &u32| Candidate { point: row, code: seen.cars[row as usize].into(), weight: 1.0 };
        let candidates = rows.map(candidate).collect();
        let random = stream(self.recipe.seed, 0x6361_7273 ^ number << 32);
        let width = self.trained.feature_names.len();
        for Candidate { point: row, code, .. } in limited(candidates, self.training.per_copy, random) {
            samples.features.extend_from_slice(&seen.features[row as usize * width..][..width]);
            samples.labels.push(code.into());
        }
    }
}
