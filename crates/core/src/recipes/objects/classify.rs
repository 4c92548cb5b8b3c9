//! Classifies the segments of a cloud.

use super::ObjectsRecipe;
use super::describe::objects;
use crate::classification::Predictor;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, Regularise, Regularised, regularise};
use std::sync::Arc;

/// Classifies every finite point of a cloud by its segment.
pub(super) fn classify(recipe: &ObjectsRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let model = job.model;
    let found = objects(job.scene, recipe, monitor)?;
    model.check_features(&found.features.names)?;
    monitor.stage("classify", found.partition.len() as u64);
    let classes = model.classes.len();
    let mut rows = vec![0.0; found.partition.len() * classes];
    model.classifier.predict_proba(&found.features.values, &mut rows)?;
    let decided = if job.regularise.method == Regularise::None {
        Regularised::by_largest(rows, classes, Some(Arc::new(found.partition)))
    } else {
        let of = found.partition.segments();
        let values: Vec<f32> = of.iter().flat_map(|&s| &rows[s as usize * classes..][..classes]).copied().collect();
        regularise(&found.points.positions, Probabilities { values: &values, classes }, job.regularise, monitor)?
    };
    job.decided(&found.points, &decided, monitor)
}
