//! Training: samples of every cloud, their features, one classifier.

use super::{OneStage, OneStageReport};
use crate::classification::{Fingerprint, Predictor, Samples};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::training::sources::SampleSources;
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{Fitted, LabelledCloud, Nothing, Trained, TrainingResult};

/// The features of all samples.
#[derive(Default)]
struct DescribedSamples {
    names: Vec<String>,
    values: Vec<f32>,
    labels: Vec<u16>,
    found: Vec<String>,
}

/// Trains a model. Choices that the recipe leaves open are made on the first cloud.
///
/// # Errors
/// As [`System::train`](crate::recipes::System::train).
pub(in crate::recipes) fn train<R>(recipe: &R, clouds: &[LabelledCloud], monitor: &Monitor) -> Result<TrainingResult<R>>
where
    R: OneStage<Learned = Nothing, Report = OneStageReport>,
{
    recipe.validate()?;
    let data = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    let sources = SampleSources::select(&data, recipe.training(), recipe.seed(), monitor)?;
    let (recipe, described) = describe(recipe.clone(), &data, &sources, monitor)?;
    let weights = sources.sample_weights();
    let samples = Samples {
        features: &described.values,
        width: described.names.len(),
        labels: &described.labels,
        weights: (!weights.is_empty()).then_some(&weights[..]),
        classes: sources.classes.len(),
    };
    let params = recipe.classifier_params().with_seed(recipe.seed());
    let (classifier, out_of_bag_accuracy) = params.train_with_score(&samples, monitor)?;
    let (classifier, used) = classifier.retain_used();
    let report = OneStageReport {
        classes: sources.counts,
        unlabelled: data.unlabelled(),
        out_of_bag_accuracy,
        features: described.names.len(),
        used_features: used.len(),
        found: described.found,
        warnings: sources.warnings,
    };
    let trained = Trained {
        cars: None,
        earlier: Vec::new(),
        network: None,
        fingerprint: Fingerprint::of(&samples, density(&data, monitor)?).select(&used),
        feature_names: used.iter().map(|&f| described.names[f].clone()).collect(),
        classes: sources.classes,
        classifier,
    };
    Ok(TrainingResult { fitted: Fitted { recipe, learned: Nothing {} }, trained, report })
}

/// The features of the samples of all sources, and the recipe with its open choices made.
fn describe<R: OneStage>(
    mut recipe: R,
    data: &TrainingData<'_>,
    sources: &SampleSources,
    monitor: &Monitor,
) -> Result<(R, DescribedSamples)> {
    let mut all = DescribedSamples::default();
    for source in &sources.list {
        recipe = source.with_scene(data, monitor, |scene| {
            let description = recipe.describe(scene, monitor)?;
            let row_of = description.points.frame.rows(scene.cloud.len());
            let rows: Vec<u32> = source.candidates.iter().map(|c| row_of[c.point as usize]).collect();
            all.values.extend(description.rows(&rows, monitor)?);
            all.labels.extend(source.labels(&sources.classes));
            all.names = description.names();
            all.found.push(description.found.clone());
            Ok(recipe.settled(&description))
        })?;
    }
    Ok((recipe, all))
}
