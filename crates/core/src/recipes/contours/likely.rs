//! How likely points are to lie on a contour, and the direction of the contour there.

use super::ContoursRecipe;
use super::scaled::Scale;
use crate::cloud::{MetricCloud, Points};
use crate::contours::{Likely, tangents};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::predict::{CloudPredictor, Fit};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, regularise};
use crate::recipes::trained::{Stage, Trained};

/// Position of the contours among the classes.
pub(super) const CONTOUR: usize = 1;

/// The rated points of a scaled cloud.
pub(super) struct RatedPoints {
    pub(super) points: Points,
    /// Probabilities of both classes, row-major.
    pub(super) probabilities: Vec<f32>,
    pub(super) fit: Fit,
}

/// The classifier of points of a model.
pub(super) fn stage(model: &Trained) -> Result<Stage<'_>> {
    let missing =
        || Error::ModelMismatch("it has no classifier of contour points: train one with the recipe contours".into());
    model.first.as_ref().map(|first| first.stage()).ok_or_else(missing)
}

/// Rates all points of a scaled cloud.
///
/// # Errors
/// If a feature is unknown, or the work was cancelled.
pub(super) fn rate(
    recipe: &ContoursRecipe,
    scene: &MetricCloud<'_>,
    stage: Stage<'_>,
    monitor: &Monitor,
) -> Result<RatedPoints> {
    let points = scene.some_points(monitor)?;
    let row_of = points.frame.rows(scene.cloud.len());
    let predictor = CloudPredictor::new(scene, &recipe.features, stage, monitor)?;
    let rating = predictor.of_points(&row_of, points.len(), monitor)?;
    Ok(RatedPoints { points, probabilities: rating.probabilities, fit: rating.fit })
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
        let likelihoods: Vec<f32> =
            self.probabilities.chunks_exact(2).map(|row| row[CONTOUR].clamp(0.0, 1.0)).collect();
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
    let rated = rate(recipe, &scale.scene(job.scene), stage(job.model)?, monitor)?;
    let given = Probabilities { values: &rated.probabilities, classes: job.model.classes.len() };
    let found = regularise(&rated.points.positions, given, job.regularise, monitor)?;
    let points = job.scene.some_points(monitor)?;
    Ok(job.decided(&points, &found, monitor)?.compared(rated.fit.shares()))
}
