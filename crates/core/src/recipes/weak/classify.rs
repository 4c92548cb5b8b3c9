//! Classification of all points of a cloud.

use super::WeakRecipe;
use super::describe::{self, Described, DescribedScene, head};
use super::hold::{self, Known, LabelScene, Question};
use super::shares::most_probable;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::points::points_of;
use crate::recipes::regularise::{Probabilities, Scene};
use crate::recipes::{CloudStatistics, Fitted};

/// Classifies every finite point of a cloud; the random field decides about all of them together.
pub(super) fn classify(fitted: &Fitted<WeakRecipe>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
    let (Fitted { recipe, learned }, cloud, model) = (fitted, job.cloud, job.model);
    let metres = cloud.metres(job.params.metres_per_unit.or(recipe.features.metres_per_unit))?;
    let points = points_of(cloud, Some(metres), monitor)?;
    let scene = LabelScene { cloud, points: &points, metres };
    let labels = recipe.labels.found(&learned.labels, &scene, &model.classes, monitor)?;
    let local = describe::local(&points.positions, recipe, monitor)?;
    // The step that needs most memory comes first, while little else is held.
    let mut segments = Scene::to_be_recut(&points.positions, Some(&local), job.regularise, monitor)?;
    segments.only_recut_at(labels.iter().map(|(point, _)| *point));
    let (described, mut values) = probabilities(fitted, job, Local { points, table: local }, monitor)?;
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
    let Described { points, six, .. } = described;
    let known = Known { descriptors: head(&six), labels, step: recipe.labels.hold_step };
    drop(six);
    let found = hold::decide(segments, &Question { given, params: job.regularise }, &known, monitor)?;
    job.decided(&points.frame.index, &found, monitor)
}

/// Number of points by their most probable class, before the adaptation to shares.
pub(super) fn statistics(fitted: &Fitted<WeakRecipe>, job: &Job<'_>, monitor: &Monitor) -> Result<CloudStatistics> {
    let recipe = &fitted.recipe;
    let metres = job.cloud.metres(job.params.metres_per_unit.or(recipe.features.metres_per_unit))?;
    let points = points_of(job.cloud, Some(metres), monitor)?;
    let table = describe::local(&points.positions, recipe, monitor)?;
    let (_, values) = probabilities(fitted, job, Local { points, table }, monitor)?;
    Ok(CloudStatistics { class_counts: most_probable(&values, job.model.classes.len()) })
}

/// Points and their four local descriptors.
struct Local {
    points: Points,
    table: FeatureTable,
}

/// The descriptors of all points and their class probabilities, row-major.
fn probabilities<'a>(
    fitted: &Fitted<WeakRecipe>,
    job: &Job<'a>,
    local: Local,
    monitor: &Monitor,
) -> Result<(Described<'a>, Vec<f32>)> {
    let (Fitted { recipe, learned }, cloud, model) = (fitted, job.cloud, job.model);
    let Local { points, table } = local;
    let elevation = job.params.elevation.as_ref();
    let scene = DescribedScene { cloud, points: &points, examples: &learned.road, elevation };
    let six = describe::six(&scene, table, recipe, monitor)?;
    let more = describe::more(recipe, job.params.metres_per_unit);
    let described = Described { cloud, points, six };
    let names = described.names(more.as_ref());
    if names != model.feature_names {
        return Err(Error::ModelMismatch(format!(
            "it needs the features {}; its recipe gives {}",
            model.feature_names.join(", "),
            names.join(", ")
        )));
    }
    let values = described.probabilities(&model.classifier, more.as_ref(), monitor)?;
    Ok((described, values))
}
