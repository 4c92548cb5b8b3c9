//! Classification of all points of a cloud.

use super::PyramidRecipe;
use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::{Monitor, watched};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::predict::CloudPredictor;
use crate::recipes::regularise::{Probabilities, Regularise, regularise};

/// Classifies point by point; with regularisation the probabilities of all points are held for it.
pub(super) fn classify(recipe: &PyramidRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let mut set = recipe.features.clone();
    set.metres_per_unit = job.params.metres_per_unit.or(set.metres_per_unit);
    let (cloud, metres) = (job.cloud, set.metres(job.cloud));
    let alone = job.regularise.method == Regularise::None;
    let mut result = Classified::unknown(cloud.len(), job.model, job.params.probabilities || !alone);
    result.warnings = job.warnings(metres, monitor)?;
    let predictor = CloudPredictor::new(cloud, &set, job.model, monitor)?;
    predictor.run(|points, rows| result.place(points, rows, job.model), monitor)?;
    if alone {
        return Ok(result);
    }
    drop(predictor);
    let points = Points::from_cloud_watched(cloud, metres, monitor)?;
    let classes = job.model.classes.len();
    let all = result.probabilities.take().unwrap_or_default();
    let values = match points.len() == cloud.len() {
        true => all,
        false => rows_of(&all, classes, &points.frame.index, monitor)?,
    };
    let found =
        regularise(&points.positions, Probabilities { values: &values, classes }, None, job.regularise, monitor)?;
    let warnings = std::mem::take(&mut result.warnings);
    result = Classified { warnings, ..Classified::unknown(cloud.len(), job.model, job.params.probabilities) };
    result.adopt(&points.frame.index, &found, job.model, monitor)?;
    Ok(result)
}

/// The probabilities of the points with these indices, one row a point.
fn rows_of(all: &[f32], classes: usize, index: &[u32], monitor: &Monitor) -> Result<Vec<f32>> {
    let mut rows = Vec::with_capacity(index.len() * classes);
    for piece in watched(index.len(), monitor) {
        piece?.for_each(|i| rows.extend_from_slice(&all[index[i] as usize * classes..][..classes]));
    }
    Ok(rows)
}
