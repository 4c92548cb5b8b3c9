//! Classification: heights above the ground, the first stage, then the second.

use super::AutoContextRecipe;
use crate::cloud::{MetricCloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::predict::{CloudPredictor, ContextColumns};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, Regularise, regularise};
use crate::recipes::system::System;
use crate::terrain::filtered_heights;
use crate::voxels::planar_density;

/// Height of each point of the cloud above the ground; NaN for stray points.
pub(super) fn heights(
    scene: &MetricCloud<'_>,
    points: &Points,
    recipe: &AutoContextRecipe,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    let mut heights = vec![f32::NAN; scene.cloud.len()];
    if recipe.features.height && !points.is_empty() {
        let found = filtered_heights(points, &recipe.ground, monitor)?;
        points.frame.index.iter().zip(found).for_each(|(&point, height)| heights[point as usize] = height);
    }
    Ok(heights)
}

pub(super) fn classify(recipe: &AutoContextRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let model = job.model;
    let Some(first) = &model.first else {
        return Err(Error::ModelMismatch(format!("a model of the recipe {} needs a first classifier", recipe.name())));
    };
    let points = job.scene.points(monitor)?;
    let heights = heights(job.scene, &points, recipe, monitor)?;
    let density = planar_density(&points.positions, monitor)?;
    drop(points);
    let scene = MetricCloud { heights: Some(&heights), ..job.scene.clone() };
    let rated = CloudPredictor::new(&scene, &recipe.features, first.stage(), monitor)?.by_voxel(recipe.rated_voxel);
    let first = rated.of_cloud(scene.cloud.len(), monitor)?;
    let fit = first.fit.shares();
    let codes: Vec<u8> = model.classes.classes().iter().map(|class| class.code).collect();
    let context = ContextColumns { probabilities: &first.probabilities, params: &recipe.context, codes: &codes };
    let second = rated.second(&scene, model.stage(), context, monitor)?;
    if job.regularise.method == Regularise::None {
        let mut result = Classified::unknown(scene.cloud.len(), model, job.params.probabilities);
        let own = second.run(|points, rows| result.place(points, rows, model), monitor)?;
        result.density = density;
        result.warnings = job.warnings(density, monitor)?;
        return Ok(result.compared(fit.or(own.shares())));
    }
    let points = job.scene.points(monitor)?;
    let values = second.of_points(&points.frame.rows(scene.cloud.len()), points.len(), monitor)?.probabilities;
    let given = Probabilities { values: &values, classes: codes.len() };
    let found = regularise(&points.positions, given, job.regularise, monitor)?;
    Ok(job.decided(&points, &found, monitor)?.compared(fit))
}
