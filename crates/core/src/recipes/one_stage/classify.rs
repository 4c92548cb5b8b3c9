//! Classification of all points of a cloud.

use super::{Description, OneStage};
use crate::classification::Predictor;
use crate::error::Result;
use crate::memory;
use crate::parallel::Monitor;
use crate::recipes::Fitted;
use crate::recipes::classify::predict::{Fit, LOOKED_AT};
use crate::recipes::classify::{Classified, Job};
use crate::recipes::regularise::{Probabilities, regularise};

/// Points that are described before they are classified: their features are held together.
const TOGETHER: usize = 1 << 16;

/// Classifies all points; their probabilities are held, their features are discarded.
///
/// # Errors
/// As [`System::classify`](crate::recipes::System::classify).
pub(in crate::recipes) fn classify<R: OneStage>(
    fitted: &Fitted<R>,
    job: &Job<'_>,
    monitor: &Monitor,
) -> Result<Classified> {
    let description = fitted.recipe.describe(job.scene, monitor)?;
    let (values, fit) = rate(&description, job, monitor)?;
    let given = Probabilities { values: &values, classes: job.model.classes.len() };
    let points = &description.points;
    let found = regularise(&points.positions, given, job.regularise, monitor)?;
    Ok(job.decided(points, &found, monitor)?.compared(fit.shares()))
}

/// Class probabilities of all points, and how their features compare with those of the training.
fn rate(description: &Description, job: &Job<'_>, monitor: &Monitor) -> Result<(Vec<f32>, Fit)> {
    let (model, classes, points) = (job.model, job.model.classes.len(), description.points.len());
    let columns = description.columns(&model.feature_names)?;
    let width = description.names().len();
    let mut values = memory::filled(0.0, points * classes, &format!("probabilities of {points} points"))?;
    let mut fit = Fit::default();
    monitor.stage("classify", points as u64);
    for first in (0..points).step_by(TOGETHER) {
        let own = first..(first + TOGETHER).min(points);
        let rows: Vec<u32> = own.clone().map(|row| row as u32).collect();
        let all = description.rows(&rows, monitor)?;
        let used: Vec<f32> = all.chunks_exact(width).flat_map(|row| columns.iter().map(|&c| row[c])).collect();
        let out = &mut values[own.start * classes..own.end * classes];
        model.classifier.predict_proba(&used, out)?;
        let looked_at = used.chunks_exact(columns.len().max(1)).step_by(LOOKED_AT as usize);
        looked_at.for_each(|row| fit.look(row, &model.fingerprint));
    }
    Ok((values, fit))
}
