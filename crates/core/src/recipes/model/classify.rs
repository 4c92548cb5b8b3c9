//! Classifies every point of a cloud with a model of any recipe.

use super::Model;
use crate::cloud::{Cloud, MetricCloud};
use crate::error::Result;
use crate::memory;
use crate::parallel::Monitor;
use crate::recipes::classify::statistics::CloudStatistics;
use crate::recipes::classify::{Classified, ClassifyParams, Job, stray_code};
use crate::recipes::regularise::RegulariseParams;

/// Classifies every point of a cloud with a model of any recipe.
///
/// Without regularisation, the features of the pyramid are computed and discarded block by block; with it, the
/// probabilities and a graph of all points are held (about 300 bytes a point).
///
/// # Errors
/// If the model needs a feature that this version or this cloud does not have.
pub fn classify(cloud: &Cloud, model: &Model, params: &ClassifyParams, monitor: &Monitor) -> Result<Classified> {
    let regularise = params.regularise_of(model.fitted.regularise());
    forecast(cloud.len(), model.fitted.bytes_a_point(regularise.method))?;
    let scene = params.scene(cloud, model.fitted.metres_per_unit(), monitor)?;
    let mut result = model.fitted.classify(&model.job(&scene, params, &regularise), monitor)?;
    let rules = params.rules.clone().unwrap_or_else(|| model.fitted.rules());
    rules.apply(&mut result, &model.trained.classes, &scene, monitor)?;
    scene.strays.index.iter().for_each(|&i| result.codes[i as usize] = stray_code(&model.trained));
    Ok(result)
}

/// The first pass over a part of a cloud: what [`ClassifyParams::statistics`] takes, once those of all parts are added.
/// A model that needs nothing of the whole cloud gives empty statistics at once.
///
/// # Errors
/// As [`classify`](crate::recipes::classify()).
pub fn statistics(cloud: &Cloud, model: &Model, params: &ClassifyParams, monitor: &Monitor) -> Result<CloudStatistics> {
    let regularise = params.regularise_of(model.fitted.regularise());
    let scene = params.scene(cloud, model.fitted.metres_per_unit(), monitor)?;
    model.fitted.statistics(&model.job(&scene, params, &regularise), monitor)
}

impl Model {
    /// The classification of a cloud by this model.
    fn job<'a>(
        &'a self,
        scene: &'a MetricCloud<'a>,
        params: &'a ClassifyParams,
        regularise: &'a RegulariseParams,
    ) -> Job<'a> {
        Job { scene, model: &self.trained, params, regularise, lowest_density: self.fitted.lowest_density() }
    }
}

/// Fails before any work if there is less memory than the classification of so many points needs at least.
fn forecast(points: usize, bytes_a_point: u64) -> Result<()> {
    // The fine levels are held for only a part of the points.
    let needed = bytes_a_point * points as u64 + 150 * points.min(1 << 20) as u64;
    memory::require(needed, &format!("classifying {points} points"))
}
