//! Classifies the segments of a cloud.

use super::ObjectsRecipe;
use super::describe::objects;
use crate::classification::Predictor;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, Regularise, Regularised, largest, regularise};

/// Classifies every finite point of a cloud by its segment.
pub(super) fn classify(recipe: &ObjectsRecipe, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let model = job.model;
    let found = objects(job.cloud, recipe, job.params.metres_per_unit, monitor)?;
    if found.features.names != model.feature_names {
        return Err(Error::ModelMismatch(format!(
            "it needs the features {}; its recipe gives {}",
            model.feature_names.join(", "),
            found.features.names.join(", ")
        )));
    }
    monitor.stage("classify", found.partition.len() as u64);
    let classes = model.classes.len();
    let mut rows = vec![0.0; found.partition.len() * classes];
    model.classifier.predict_proba(&found.features.values, &mut rows)?;
    let of = found.partition.segments();
    let values: Vec<f32> = of.iter().flat_map(|&s| &rows[s as usize * classes..][..classes]).copied().collect();
    let decided = if job.regularise.method == Regularise::None {
        let best: Vec<u16> = rows.chunks_exact(classes).map(largest).collect();
        let labels = of.iter().map(|&s| best[s as usize]).collect();
        Regularised { labels, probabilities: values, partition: Some(found.partition), energy: None }
    } else {
        regularise(&found.points.positions, Probabilities { values: &values, classes }, None, job.regularise, monitor)?
    };
    job.decided(&found.points.frame.index, &decided, monitor)
}
