//! Lines of a cloud by a model of the recipe `contours`.

use super::Model;
use super::any::AnyFitted;
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::contours::{ContourModel, ContourParams, ContourStages, Contours, stages_of};

/// Lines along the edges of objects.
///
/// The model is one of the recipe `contours`. Results are the same for any number of threads. O(n log n) for n points; 80
/// bytes a point, about 250 more for each of up to a million points whose surroundings are described at a time, and about
/// 2 kB for each seed of a line, of which a voxel along an edge has one.
///
/// # Errors
/// If the model is of another recipe, the cloud has no points with finite coordinates or lacks a column, there is not one
/// class a point, a parameter is outside its range, or the work was cancelled.
pub fn contours(cloud: &Cloud, model: &Model, params: &ContourParams, monitor: &Monitor) -> Result<Contours> {
    let model = model.contours()?;
    stages_of(cloud, model, params, monitor)?.lines(&model.recipe.trace, monitor)
}

/// Rates the points and the candidates of a cloud by a model of the recipe `contours`.
///
/// # Errors
/// As [`contours`].
pub fn contour_stages(
    cloud: &Cloud,
    model: &Model,
    params: &ContourParams,
    monitor: &Monitor,
) -> Result<ContourStages> {
    stages_of(cloud, model.contours()?, params, monitor)
}

impl Model {
    fn contours(&self) -> Result<ContourModel<'_>> {
        match &self.fitted {
            AnyFitted::Contours(fitted) => Ok(ContourModel { recipe: &fitted.recipe, trained: &self.trained }),
            other => {
                let reason = format!("it is one of the recipe {} (allowed: contours)", other.recipe().name());
                Err(Error::ModelMismatch(reason))
            }
        }
    }
}
