//! How likely points are to lie on a contour, and the direction of the contour there.

use super::ContoursRecipe;
use super::scaled::{Scale, VOXEL};
use crate::cloud::{MetricCloud, Points};
use crate::contours::Likely;
use crate::error::{Error, Result};
use crate::linalg::{Sym3, mean};
use crate::parallel::{Monitor, map_ordered_with};
use crate::recipes::classify::predict::{CloudPredictor, Fit};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::model::{Model, Stage};
use crate::recipes::regularise::{Probabilities, regularise};
use crate::voxels::{Grid, Search, build_levels, sorted};

/// Neighbours that give the direction at a point.
const NEIGHBOURS: usize = 10;
/// Points of a block.
const BLOCK: usize = 1 << 14;
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
pub(super) fn stage(model: &Model) -> Result<Stage<'_>> {
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
    pub(super) fn leave_out(&mut self, codes: &[u8], classes: &[u8]) {
        for (row, &index) in self.probabilities.chunks_exact_mut(2).zip(&self.points.frame.index) {
            if classes.contains(&codes[index as usize]) {
                (row[CONTOUR], row[1 - CONTOUR]) = (0.0, 1.0);
            }
        }
    }

    /// The points with their likelihoods, and the direction of largest extent of their surroundings at the level of
    /// voxels, for points of likelihood `least` or more. O(n log n).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn likely(&self, least: f64, monitor: &Monitor) -> Result<Likely> {
        let likelihoods: Vec<f32> =
            self.probabilities.chunks_exact(2).map(|row| row[CONTOUR].clamp(0.0, 1.0)).collect();
        let tangents = tangents(&self.points, |i| f64::from(likelihoods[i]) >= least, monitor)?;
        Ok(Likely { positions: self.points.positions.clone(), likelihoods, tangents })
    }
}

/// First principal direction of the nearest centres of voxels of some points; zeros for the others.
fn tangents(points: &Points, wanted: impl Fn(usize) -> bool + Sync, monitor: &Monitor) -> Result<Vec<[f32; 3]>> {
    let grid = Grid::new(points, VOXEL)?;
    let in_order = sorted(points.clone(), &grid, monitor)?;
    let levels = build_levels(&in_order.positions, &grid, 1, monitor)?;
    drop(in_order);
    let Some(level) = levels.first() else { return Ok(vec![[0.0; 3]; points.len()]) };
    monitor.stage("tangents", points.len() as u64);
    let block = |search: &mut Search, block: usize| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(points.len());
        monitor.advance(range.len() as u64);
        let direction = |i: usize| {
            if !wanted(i) {
                return [0.0; 3];
            }
            let mut found = [0; NEIGHBOURS];
            let count = search.nearest(level, points.positions.xyz(i), &mut found);
            let at = |&j: &u32| [level.x[j as usize], level.y[j as usize], level.z[j as usize]].map(f64::from);
            let near: Vec<[f64; 3]> = found[..count].iter().map(at).collect();
            let eigen = Sym3::scatter(&near, mean(&near), count.max(1) as f64).eigen();
            if eigen.values[0] > 0.0 { eigen.vectors[0].map(|v| v as f32) } else { [0.0; 3] }
        };
        Ok(range.map(direction).collect::<Vec<_>>())
    };
    let parts = map_ordered_with(0..points.len().div_ceil(BLOCK), monitor, Search::default, block)?;
    Ok(parts.concat())
}

/// Names the points that are likely to lie on a contour.
pub(super) fn classify(recipe: &ContoursRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let scale = Scale::of(recipe, job.scene, monitor)?;
    let rated = rate(recipe, &scale.scene(job.scene), stage(job.model)?, monitor)?;
    let given = Probabilities { values: &rated.probabilities, classes: job.model.classes.len() };
    let found = regularise(&rated.points.positions, given, None, job.regularise, monitor)?;
    let points = job.scene.some_points(monitor)?;
    Ok(job.decided(&points, &found, monitor)?.compared(rated.fit.shares()))
}
