//! How likely points are to lie on a contour, and the direction of the contour there.
//!
//! A forest rates the points first. Boosted trees rate them again, from the same features and from what the forest says about
//! the points around.

use super::ContoursRecipe;
use super::scaled::Scale;
use crate::cloud::{MetricCloud, Points};
use crate::contours::{Likely, tangents};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::predict::{CloudPredictor, ContextColumns, Fit, Rating};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, regularise};
use crate::recipes::trained::{EarlierStage, Trained};

/// Position of the contours among the classes.
pub(super) const CONTOUR: usize = 1;

/// Codes of points off and on contours.
pub(super) const CODES: [u8; 2] = [0, 1];

/// The rated points of a scaled cloud.
pub(super) struct RatedPoints {
    pub(super) points: Points,
    /// Probabilities of both classes, row-major.
    pub(super) probabilities: Vec<f32>,
    pub(super) fit: Fit,
}

/// The classifiers of points of a model: models of older programs have only the first.
pub(super) fn stages(model: &Trained) -> Result<&[EarlierStage]> {
    match &model.earlier[..] {
        [] => Err(Error::ModelMismatch(
            "it has no classifier of contour points: train one with the recipe contours".into(),
        )),
        stages => Ok(stages),
    }
}

/// Rates all points of a scaled cloud with one or two classifiers.
///
/// # Errors
/// If there is no classifier, a feature is unknown, or the work was cancelled.
pub(super) fn rate(
    recipe: &ContoursRecipe,
    scene: &MetricCloud<'_>,
    stages: &[EarlierStage],
    monitor: &Monitor,
) -> Result<RatedPoints> {
    let Some((first, further)) = stages.split_first() else {
        return Err(Error::ModelMismatch("it has no classifier of contour points".into()));
    };
    let points = scene.some_points(monitor)?;
    let row_of = points.frame.rows(scene.cloud.len());
    let predictor = CloudPredictor::new(scene, &recipe.features, first.stage(), monitor)?;
    let Some(second) = further.first() else {
        let rating = predictor.of_points(&row_of, points.len(), monitor)?;
        return Ok(RatedPoints { points, probabilities: rating.probabilities, fit: rating.fit });
    };
    let Rating { probabilities, fit, .. } = predictor.of_cloud(scene.cloud.len(), monitor)?;
    let likelihoods = &contour_likelihoods(&probabilities);
    drop(probabilities);
    let context = ContextColumns { probabilities: likelihoods, params: &recipe.context, codes: &CODES[CONTOUR..] };
    let again: Vec<bool> = likelihoods.iter().map(|&likelihood| recipe.rated_again(likelihood)).collect();
    let predictor = predictor.second(scene, second.stage(), context, monitor)?.only(again);
    let mut probabilities = predictor.of_points(&row_of, points.len(), monitor)?.probabilities;
    for (row, &point) in probabilities.chunks_exact_mut(CODES.len()).zip(&points.frame.index) {
        let likelihood = likelihoods[point as usize];
        if !recipe.rated_again(likelihood) {
            (row[CONTOUR], row[1 - CONTOUR]) = (likelihood, 1.0 - likelihood);
        }
    }
    Ok(RatedPoints { points, probabilities, fit })
}

impl ContoursRecipe {
    /// Whether a point that the first classifier finds so likely is rated by the second.
    pub(super) fn rated_again(&self, likelihood: f32) -> bool {
        f64::from(likelihood) >= self.least_rated
    }
}

/// The probability to lie on a contour of each row of probabilities.
pub(super) fn contour_likelihoods(probabilities: &[f32]) -> Vec<f32> {
    probabilities.chunks_exact(CODES.len()).map(|row| row[CONTOUR].clamp(0.0, 1.0)).collect()
}

impl RatedPoints {
    /// Points of these classes lie on no contour; `codes` are those of all points of the cloud.
    pub(super) fn leave_out(&mut self, codes: &[Option<u8>], classes: &[u8]) {
        for (row, &index) in self.probabilities.chunks_exact_mut(2).zip(&self.points.frame.index) {
            if codes[index as usize].is_some_and(|code| classes.contains(&code)) {
                (row[CONTOUR], row[1 - CONTOUR]) = (0.0, 1.0);
            }
        }
    }

    /// The points with their likelihoods, and the directions of contours there: none if the points are moved to the edge, which
    /// finds the directions anew. O(n log n).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn likely(&self, recipe: &ContoursRecipe, monitor: &Monitor) -> Result<Likely> {
        let likelihoods = contour_likelihoods(&self.probabilities);
        let positions = self.points.positions.clone();
        let tangents = match recipe.candidates.ridge.passes {
            0 => {
                monitor.stage("tangents", positions.len() as u64);
                tangents(&positions, &likelihoods, &recipe.tangents, monitor)?
            }
            _ => vec![[0.0; 3]; positions.len()],
        };
        Ok(Likely { tangents, positions, likelihoods })
    }
}

/// Names the points that are likely to lie on a contour.
pub(super) fn classify(recipe: &ContoursRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let scale = Scale::of(recipe, job.scene, monitor)?;
    let rated = rate(recipe, &scale.scene(job.scene), stages(job.model)?, monitor)?;
    let given = Probabilities { values: &rated.probabilities, classes: job.model.classes.len() };
    let found = regularise(&rated.points.positions, given, job.regularise, monitor)?;
    let points = job.scene.some_points(monitor)?;
    Ok(job.decided(&points, &found, monitor)?.compared(rated.fit.shares()))
}
