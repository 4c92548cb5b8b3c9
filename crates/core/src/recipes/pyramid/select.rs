//! Model selection: the depth of the trees, by cross-validation on spatial blocks.

use super::PyramidRecipe;
use super::described::Described;
use super::report::DepthScore;
use crate::classification::ClassifierParams;
use crate::classification::cross_validation::{GridScore, grid_search, grouped_folds};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::TrainOptions;

/// The recipe with the best of `options.depths` (of equal ones the first), and the scores of all; unchanged if no
/// cross-validation is asked for.
pub(super) fn chosen_depth(
    described: &Described,
    recipe: PyramidRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(PyramidRecipe, Vec<DepthScore>)> {
    if !options.cross_validates() {
        return Ok((recipe, Vec::new()));
    }
    let (grid, depths) = cross_validate(described, &recipe, options, monitor)?;
    let scored = grid.into_iter().zip(&depths).rev();
    match scored.max_by(|(_, a), (_, b)| a.mean_f1.total_cmp(&b.mean_f1)) {
        Some((best, _)) => Ok((recipe.with_classifier(best), depths)),
        None => Ok((recipe, depths)),
    }
}

/// k-fold cross-validation for each depth (of the recipe's own depth if none is given), on spatially disjoint folds of
/// whole squares: parameters and scores. Fails if there are fewer squares than folds.
fn cross_validate(
    described: &Described,
    recipe: &PyramidRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(Vec<ClassifierParams>, Vec<DepthScore>)> {
    let folds = grouped_folds(&described.blocks, options.folds())?;
    let mut grid = vec![recipe.classifier()];
    if !options.depths.is_empty() {
        grid = options.depths.iter().map(|&depth| with_depth(recipe.classifier(), depth)).collect();
    }
    let scores = grid_search(&described.samples(), &grid, &folds, monitor)?;
    let score = |(params, score): (&mut ClassifierParams, GridScore)| DepthScore {
        max_depth: params.max_depth().and_then(|depth| *depth),
        accuracy: score.accuracy,
        mean_f1: score.mean_f1,
    };
    let scores = grid.iter_mut().zip(scores).map(score).collect();
    Ok((grid, scores))
}

fn with_depth(mut params: ClassifierParams, depth: usize) -> ClassifierParams {
    if let Some(limit) = params.max_depth() {
        *limit = Some(depth);
    }
    params
}
