//! Training. The functions of this file follow the steps of Hackel 2018, chapter 4.4.

use super::PyramidRecipe;
use super::described::SampleTable;
use super::report::PyramidReport;
use super::select::{chosen_depth, chosen_regularisation};
use crate::classification::{Fingerprint, Predictor};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::training::sources::SampleSources;
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{Fitted, LabelledCloud, Nothing, System, TrainOptions, Trained, TrainingResult};

/// Trains a model. The finest voxel, if the recipe leaves it open, is that of the first cloud's point spacing; the depth
/// is the best of `options.depths`, and the regularisation is chosen if the recipe says `auto`.
pub(super) fn train(
    recipe: &PyramidRecipe,
    clouds: &[LabelledCloud],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<TrainingResult<PyramidRecipe>> {
    recipe.validate()?;
    let data = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    let sources = SampleSources::select(&data, &recipe.training, recipe.seed, monitor)?;
    let mut described = SampleTable::new(&data, &sources, recipe, monitor)?;
    let recipe = PyramidRecipe { features: described.features.clone(), ..recipe.clone() };
    let (recipe, tried) = chosen_depth(&described, recipe, options, monitor)?;
    let (regularise, regularisation) = chosen_regularisation(&described, &recipe, monitor)?;
    let recipe = PyramidRecipe { regularise, ..recipe };
    described.trials = Vec::new();
    let params = recipe.classifier().with_seed(recipe.seed);
    let (classifier, out_of_bag_accuracy) = params.train_with_score(&described.samples(), monitor)?;
    let (classifier, used) = classifier.retain_used();
    let report = PyramidReport {
        classes: sources.counts,
        unlabelled: data.unlabelled(),
        out_of_bag_accuracy,
        first_scale: recipe.features.pyramid.first_scale.unwrap_or_default(),
        used_features: used.len(),
        features: described.names.len(),
        folds: if options.cross_validates() { options.folds() } else { 0 },
        depths: tried.depths,
        block: tried.block,
        regularisation,
        warnings: sources.warnings,
    };
    let trained = Trained {
        cars: None,
        earlier: Vec::new(),
        network: None,
        fingerprint: Fingerprint::of(&described.samples(), density(&data, monitor)?).select(&used),
        feature_names: used.iter().map(|&f| described.names[f].clone()).collect(),
        classes: described.classes,
        classifier,
    };
    Ok(TrainingResult { fitted: Fitted { recipe, learned: Nothing {} }, trained, report })
}
