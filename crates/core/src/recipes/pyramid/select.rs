//! Model selection by cross-validation on spatial blocks: the depth of the trees, and the method of regularisation.

use super::PyramidRecipe;
use super::described::SampleTable;
use super::report::DepthScore;
use crate::classification::cross_validation::{FoldScore, GridScore, grid_search};
use crate::classification::{ClassifierParams, Samples};
use crate::error::{Error, Result};
use crate::evaluation::{ClassScores, Confusion};
use crate::parallel::Monitor;
use crate::recipes::TrainOptions;
use crate::recipes::regularise::{Regularise, RegulariseParams};
use crate::recipes::training::blocks::{SpatialFolds, spatial_folds};
use crate::recipes::training::choice::{ChoiceReport, CrossTraining, choose};

/// The recipe with the best of `options.depths` (of equal ones the first), and the scores of all; unchanged if no
/// cross-validation is asked for.
pub(super) fn chosen_depth(
    described: &SampleTable,
    recipe: PyramidRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(PyramidRecipe, TriedDepths)> {
    if !options.cross_validates() {
        return Ok((recipe, TriedDepths::default()));
    }
    let (grid, tried) = cross_validate(described, &recipe, options, monitor)?;
    let scored = grid.into_iter().zip(&tried.depths).rev();
    match scored.max_by(|(_, a), (_, b)| a.mean_f1.total_cmp(&b.mean_f1)) {
        Some((best, _)) => Ok((recipe.with_classifier(best), tried)),
        None => Ok((recipe, tried)),
    }
}

/// Scores of the depths that were tried, and the squares of the folds.
#[derive(Default)]
pub(super) struct TriedDepths {
    pub(super) depths: Vec<DepthScore>,
    /// Edge of the squares, metres; 0 without cross-validation.
    pub(super) block: f64,
}

/// k-fold cross-validation for each depth (of the recipe's own depth if none is given), on spatially disjoint folds of
/// whole squares: parameters and scores. Fails if there are fewer squares than folds.
fn cross_validate(
    described: &SampleTable,
    recipe: &PyramidRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(Vec<ClassifierParams>, TriedDepths)> {
    let SpatialFolds { of: folds, square: block } = spatial_folds(&described.places, options.folds(), options.block)?;
    let mut grid = vec![recipe.classifier()];
    if !options.depths.is_empty() {
        if grid[0].max_depth().is_none() {
            return Err(Error::parameter(
                "depths",
                format!("{:?}", options.depths),
                "none: the classifier has no depth",
            ));
        }
        grid = options.depths.iter().map(|&depth| with_depth(recipe.classifier(), depth)).collect();
    }
    let scores = grid_search(&described.samples(), &grid, &folds, monitor)?;
    let score = |(params, score): (&mut ClassifierParams, GridScore)| DepthScore {
        max_depth: params.max_depth().and_then(|depth| *depth),
        accuracy: score.accuracy,
        mean_f1: score.mean_f1,
        classes: class_scores(described, &score.folds),
    };
    let depths = grid.iter_mut().zip(scores).map(score).collect();
    Ok((grid, TriedDepths { depths, block }))
}

/// Scores of each class over all held-out samples.
fn class_scores(described: &SampleTable, folds: &[FoldScore]) -> Vec<ClassScores> {
    let mut confusion = Confusion::new(described.classes.clone());
    for fold in folds {
        confusion.add_counts(&fold.confusion);
    }
    confusion.scores().labels
}

fn with_depth(mut params: ClassifierParams, depth: usize) -> ClassifierParams {
    if let Some(limit) = params.max_depth() {
        *limit = Some(depth);
    }
    params
}

/// The regularisation that the recipe names, or the one that is best on held-out patches, with the scores of all.
pub(super) fn chosen_regularisation(
    described: &SampleTable,
    recipe: &PyramidRecipe,
    monitor: &Monitor,
) -> Result<(RegulariseParams, Option<ChoiceReport>)> {
    if recipe.regularise.method != Regularise::Auto {
        return Ok((recipe.regularise.clone(), None));
    }
    let params = recipe.classifier().with_seed(recipe.seed);
    let training = CrossTraining {
        samples: described.samples(),
        colours: &described.colours,
        classes: &described.classes,
        seed: recipe.seed,
        learn: |samples: &Samples<'_>, monitor: &Monitor| params.train(samples, monitor),
    };
    let report = choose(&described.trials, &training, &recipe.regularise, monitor)?;
    Ok((report.applied_to(&recipe.regularise), Some(report)))
}
