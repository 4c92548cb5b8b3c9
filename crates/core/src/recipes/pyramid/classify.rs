//! Classification of all points of a cloud.

use super::PyramidRecipe;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::classify::predict::CloudPredictor;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, Regularise, regularise};
use crate::voxels::PlanarDensity;

/// Classifies point by point; with regularisation the probabilities of all points are held for it.
pub(super) fn classify(recipe: &PyramidRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    if job.regularise.method == Regularise::None {
        return one_by_one(recipe, job, monitor);
    }
    let points = job.scene.points(monitor)?;
    let row_of = points.frame.rows(job.scene.cloud.len());
    let predictor = CloudPredictor::new(job.scene, &recipe.features, job.model.stage(), monitor)?;
    let rating = predictor.of_points(&row_of, points.len(), monitor)?;
    drop((predictor, row_of));
    let given = Probabilities { values: &rating.probabilities, classes: job.model.classes.len() };
    let found = regularise(&points.positions, given, job.regularise, monitor)?;
    Ok(job.decided(&points, &found, monitor)?.compared(rating.fit.shares()))
}

/// Features and probabilities are discarded block by block.
fn one_by_one(recipe: &PyramidRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let mut result = Classified::unknown(job.scene.cloud.len(), job.model, job.params.probabilities);
    result.take_density(PlanarDensity::new(&job.scene.points(monitor)?.positions, monitor)?);
    result.warnings = job.warnings(result.density, monitor)?;
    let predictor = CloudPredictor::new(job.scene, &recipe.features, job.model.stage(), monitor)?;
    let fit = predictor.run(|group| result.place(&group.points, &group.probabilities, job.model), monitor)?;
    Ok(result.compared(fit.shares()))
}
