//! Classifies the segments of a cloud.

use super::ObjectsRecipe;
use super::describe::objects;
use crate::classification::Model;
use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::regularise::{Probabilities, Regularise, RegulariseParams, Regularised, largest, regularise};

/// Classifies every finite point of a cloud by its segment; returns the points and the decision.
pub(in crate::recipes) fn classify_objects(
    cloud: &Cloud,
    (model, recipe): (&Model, &ObjectsRecipe),
    (metres, agree): (Option<f64>, &RegulariseParams),
    monitor: &Monitor,
) -> Result<(Points, Regularised)> {
    let found = objects(cloud, recipe, metres, monitor)?;
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
    if agree.method != Regularise::None {
        let decided = regularise(&found.points, Probabilities { values: &values, classes }, None, agree, monitor)?;
        return Ok((found.points, decided));
    }
    let names: Vec<u16> = rows.chunks_exact(classes).map(largest).collect();
    let labels = of.iter().map(|&s| names[s as usize]).collect();
    let decided = Regularised { labels, probabilities: values, partition: Some(found.partition), energy: None };
    Ok((found.points, decided))
}
