//! What the recipes with a network share: drawing of labelled points, checkpoints, the head as a
//! classifier, and the report.

mod labelled;
mod progress;
mod report;

pub(in crate::recipes) use labelled::{Drawn, Labelled, NONE, drawn};
pub(in crate::recipes) use progress::{Checkpoint, Progress};
pub use report::NetworkReport;

use super::TrainingData;
use crate::classification::{Fingerprint, Linear};
use crate::error::{Error, Result};
use crate::features::spacing;
use crate::nn::parameters::Parameters;
use crate::parallel::Monitor;
use crate::recipes::trained::Trained;

/// Names of the features that a network gives.
pub(in crate::recipes) fn names(width: usize) -> Vec<String> {
    (0..width).map(|channel| format!("Learned_{channel}")).collect()
}

/// Twice the spacing of the first cloud, to two digits.
///
/// # Errors
/// If there is no cloud, or the work was cancelled.
pub(in crate::recipes) fn automatic_voxel(data: &TrainingData<'_>, monitor: &Monitor) -> Result<f64> {
    let Some(first) = data.scenes.first() else { return Err(Error::input("no cloud to learn from")) };
    let spacing = spacing(&first.metric.some_points(monitor)?, monitor)?;
    let found = (2.0 * spacing).clamp(1e-2, 1e2);
    let digit = 10f64.powf(found.log10().floor() - 1.0);
    Ok((found / digit).round() * digit)
}

/// The last layer (its weights, its terms) as a classifier of its own.
///
/// # Errors
/// If the lengths do not fit.
pub(in crate::recipes) fn linear_of([weights, bias]: [&[f32]; 2], summary: &Fingerprint) -> Result<Linear> {
    let means = summary.means.iter().map(|&mean| if mean.is_finite() { mean as f32 } else { 0.0 }).collect();
    Linear::of_layer(weights, bias, means)
}

/// Checks that a model holds as many values of a network as its recipe tells, before any network is built.
///
/// # Errors
/// If it has no network, or the numbers differ.
pub(in crate::recipes) fn check_values(model: &Trained, expected: usize) -> Result<()> {
    let Some(stored) = &model.network else {
        return Err(Error::ModelMismatch("a model of this recipe needs a network".into()));
    };
    let found: usize = stored.iter().map(|array| array.values.len()).sum();
    match found == expected {
        true => Ok(()),
        false => {
            let reason = format!("a network of {found} values (allowed: {expected}, by the model's recipe)");
            Err(Error::ModelMismatch(reason))
        }
    }
}

/// Puts what a model has learned in the place of the parameters of its network, which gives `width` features.
///
/// # Errors
/// If an array is absent or does not fit, or the model has other features.
pub(in crate::recipes) fn restore(parameters: &mut Parameters<f32>, model: &Trained, width: usize) -> Result<()> {
    let Some(stored) = &model.network else {
        return Err(Error::ModelMismatch("a model of this recipe needs a network".into()));
    };
    if stored.iter().len() != parameters.iter().len() {
        let found = stored.iter().len();
        let reason = format!("{found} arrays of a network (allowed: {})", parameters.iter().len());
        return Err(Error::ModelMismatch(reason));
    }
    stored.iter().try_for_each(|array| parameters.replace(&array.name, array.values.clone()))?;
    model.check_features(&names(width))
}
