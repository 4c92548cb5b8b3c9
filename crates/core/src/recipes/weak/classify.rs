//! Classification of all points of a cloud.

use super::WeakRecipe;
use super::describe::{DescribedCloud, PaperDescriptors, RoadSources, WeakScene, paper_descriptors, scaled_features};
use super::hold::{Constrained, KnownLabels};
use super::shares::most_probable;
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{DescribedPoints, Probabilities};
use crate::recipes::{CloudStatistics, Fitted};

/// Classifies every finite point of a cloud; the random field decides about all of them together.
pub(super) fn classify(fitted: &Fitted<WeakRecipe>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let (Fitted { recipe, learned }, model) = (fitted, job.model);
    let scene = WeakScene::new(job.scene, recipe, monitor)?;
    let labels = recipe.labels.found(&learned.labels, &scene, &model.classes, monitor)?;
    // The graph of the points needs most memory: it comes first, while little else is held.
    let described = DescribedPoints { points: &scene.points.positions, descriptors: &scene.local, labels: None };
    let known = KnownLabels { labels: &labels, step: recipe.labels.hold_step };
    let constrained = Constrained::new(described, known, job.regularise, monitor)?;
    let Probable { scene, mut values, warning } = probabilities(fitted, job, scene, monitor)?;
    let counts = match &job.params.statistics {
        Some(whole) => whole.class_counts.clone(),
        None => most_probable(&values, model.classes.len()),
    };
    if counts.len() != model.classes.len() {
        let found = format!("{} classes", counts.len());
        return Err(Error::parameter("statistics", found, format!("{} classes", model.classes.len())));
    }
    recipe.shares.apply(&mut values, &counts, &learned.shares);
    let given = Probabilities { values: &values, classes: model.classes.len() };
    let found = constrained.decide(given, job.regularise, monitor)?;
    let mut classified = job.decided(&scene.points, &found, monitor)?;
    classified.warnings.extend(warning);
    Ok(classified)
}

/// Number of points by their most probable class, before the adaptation to shares.
pub(super) fn statistics(fitted: &Fitted<WeakRecipe>, job: &Job<'_>, monitor: &Monitor) -> Result<CloudStatistics> {
    let scene = WeakScene::new(job.scene, &fitted.recipe, monitor)?;
    let Probable { values, .. } = probabilities(fitted, job, scene, monitor)?;
    Ok(CloudStatistics { class_counts: most_probable(&values, job.model.classes.len()) })
}

/// What the classifier says of a cloud.
struct Probable<'a> {
    /// The cloud without its local descriptors, which are freed.
    scene: WeakScene<'a>,
    /// The class probabilities of all points, row-major.
    values: Vec<f32>,
    /// The warning about a road that was not found.
    warning: Option<String>,
}

/// The class probabilities of all points.
fn probabilities<'a>(
    fitted: &Fitted<WeakRecipe>,
    job: &Job<'_>,
    mut scene: WeakScene<'a>,
    monitor: &Monitor,
) -> Result<Probable<'a>> {
    let (Fitted { recipe, learned }, model) = (fitted, job.model);
    let sources = RoadSources { examples: &learned.road, elevation: job.params.elevation.as_ref() };
    let PaperDescriptors { table: paper, warning } = paper_descriptors(&scene, sources, recipe, monitor)?;
    scene.local = FeatureTable::default();
    let described = DescribedCloud { scene, paper };
    let scaled = scaled_features(recipe);
    model.check_features(&described.names(scaled))?;
    let values = described.probabilities(&model.classifier, scaled, monitor)?;
    Ok(Probable { scene: described.scene, values, warning })
}
