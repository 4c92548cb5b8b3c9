//! Classification: heights above the ground, the first stage, then the second.

use super::AutoContextRecipe;
use crate::cloud::{MetricCloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::candidates::Candidates;
use crate::recipes::classify::predict::{CloudPredictor, ContextColumns, Group, Rating};
use crate::recipes::classify::returns::falling;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, Regularise, regularise};
use crate::recipes::system::System;
use crate::recipes::trained::Trained;
use crate::terrain::{PointAboveGround, points_above_ground};
use crate::voxels::PlanarDensity;

/// The points of a cloud above the ground of the ground filter.
pub(super) struct AboveGround {
    /// Metres; NaN for stray points.
    pub(super) heights: Vec<f32>,
    /// Whether each is ground itself; empty if the recipe has no heights.
    pub(super) lying: Vec<bool>,
}

/// What the ground filter finds, if the recipe has heights.
pub(super) fn above_ground(
    scene: &MetricCloud<'_>,
    points: &Points,
    recipe: &AutoContextRecipe,
    monitor: &Monitor,
) -> Result<AboveGround> {
    let mut heights = vec![f32::NAN; scene.cloud.len()];
    if !recipe.features.height || points.is_empty() {
        return Ok(AboveGround { heights, lying: Vec::new() });
    }
    let mut lying = vec![false; heights.len()];
    let found = points_above_ground(points, &recipe.ground, monitor)?;
    for (&point, PointAboveGround { height, is_ground }) in points.frame.index.iter().zip(found) {
        heights[point as usize] = height;
        lying[point as usize] = is_ground;
    }
    Ok(AboveGround { heights, lying })
}

pub(super) fn classify(recipe: &AutoContextRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let model = job.model;
    let points = job.scene.points(monitor)?;
    let AboveGround { heights, lying } = above_ground(job.scene, &points, recipe, monitor)?;
    let density = PlanarDensity::new(&points.positions, monitor)?;
    let returns_falling = falling(job.scene, &points, monitor)?;
    drop(points);
    let scene = MetricCloud { heights: Some(&heights), ..job.scene.clone() };
    let (first, rated) = first_stage(recipe, model, &scene, monitor)?;
    let fit = first.fit.shares();
    let codes = model.classes.codes();
    let context = ContextColumns { probabilities: &first.probabilities, params: &recipe.context, codes: &codes };
    let candidates = if recipe.classes.cars.points > 0 { Candidates::to_rate(model, &heights)? } else { None };
    let mut cars = vec![0.0; if candidates.is_some() { scene.cloud.len() } else { 0 }];
    let second = rated.second(&scene, model.stage(), context, monitor)?.with_candidates(candidates);
    if job.regularise.method == Regularise::None {
        let mut result = Classified::unknown(scene.cloud.len(), model, job.params.probabilities);
        let place = |group: &Group| {
            result.place(&group.points, &group.probabilities, model);
            group.place_cars(&mut cars, |point| point as usize);
        };
        let own = second.run(place, monitor)?;
        result.take_density(density);
        result.warnings = job.warnings(result.density, monitor)?;
        return Ok(Classified { cars, lying, returns_falling, ..result }.compared(fit.or(own.shares())));
    }
    let points = job.scene.points(monitor)?;
    let found = second.of_points(&points.frame.rows(scene.cloud.len()), points.len(), monitor)?;
    points.frame.index.iter().zip(&found.cars).for_each(|(&point, &car)| cars[point as usize] = car);
    let given = Probabilities { values: &found.probabilities, classes: codes.len() };
    let labels = regularise(&points.positions, given, job.regularise, monitor)?;
    let result = job.decided(&points, &labels, monitor)?;
    Ok(Classified { cars, lying, is_regularised: true, returns_falling, ..result }.compared(fit))
}

/// What the first stage of a model says about each point of a cloud with heights, and the features of the cloud, for the
/// second stage.
pub(super) fn first_stage<'a>(
    recipe: &AutoContextRecipe,
    model: &'a Trained,
    scene: &MetricCloud<'a>,
    monitor: &Monitor,
) -> Result<(Rating, CloudPredictor<'a>)> {
    let [first] = &model.earlier[..] else {
        return Err(Error::ModelMismatch(format!("a model of the recipe {} needs a first classifier", recipe.name())));
    };
    let rated = CloudPredictor::new(scene, &recipe.features, first.stage(), monitor)?.by_voxel(recipe.rated_voxel);
    Ok((rated.of_cloud(scene.cloud.len(), monitor)?, rated))
}
