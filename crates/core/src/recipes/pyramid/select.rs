//! Model selection: the depth of the trees, by cross-validation on spatial blocks.

use super::PyramidRecipe;
use super::report::DepthScore;
use super::train::Described;
use crate::classification::ClassifierParams;
use crate::classification::cross_validation::{grid_search, grouped_folds};
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
    let depths = cross_validate(described, &recipe, options, monitor)?;
    let recipe = match depths.iter().rev().max_by(|a, b| a.mean_f1.total_cmp(&b.mean_f1)) {
        Some(best) => recipe.with_max_depth(best.max_depth),
        None => recipe,
    };
    Ok((recipe, depths))
}

/// k-fold cross-validation for each depth (of the recipe's own depth if none is given), on spatially disjoint folds of
/// whole squares. Fails if there are fewer squares than folds.
fn cross_validate(
    described: &Described,
    recipe: &PyramidRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<Vec<DepthScore>> {
    let folds = grouped_folds(&described.blocks, options.folds())?;
    let mut grid = vec![recipe.classifier()];
    if !options.depths.is_empty() {
        grid = options.depths.iter().map(|&depth| with_depth(recipe.classifier(), depth)).collect();
    }
    let scores = grid_search(&described.samples(), &grid, &folds, monitor)?;
    let pairs = grid.iter_mut().zip(scores);
    Ok(pairs.map(|(p, s)| DepthScore { max_depth: *p.max_depth(), accuracy: s.accuracy, mean_f1: s.mean_f1 }).collect())
}

fn with_depth(mut params: ClassifierParams, depth: usize) -> ClassifierParams {
    *params.max_depth() = Some(depth);
    params
}
