//! The intermediate results between points and lines: rated points and rated candidates.

use super::ContoursRecipe;
use super::classes::codes_of;
use super::likely::{CONTOUR, rate, stages};
use super::scaled::Scale;
use crate::classification::{ClassifierScratch, Predictor};
use crate::cloud::{Cloud, MetricCloud, Points};
use crate::contours::{Candidates, Likely, VALUES, candidates};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered_with};
use crate::recipes::classify::FeatureFit;
use crate::recipes::trained::Trained;

/// Candidates that one task rates.
const BLOCK: usize = 4096;

/// How lines are extracted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContourParams {
    /// Metres per unit of the coordinates; `None`: the cloud's own, else 1.
    pub metres_per_unit: Option<f64>,
    /// Class of each point, for the classes on both sides of a line; `None`: the cloud's classification, if it has one.
    pub codes: Option<Vec<u8>>,
    /// Points of these classes carry no line, for instance those of vegetation.
    pub without: Vec<u8>,
    /// Lines of a lower confidence are left out, 0 to 1.
    pub min_confidence: f32,
}

/// Rated points and rated candidates of a cloud, from which lines can be drawn with several settings. Lengths are those for
/// voxels of 0.1 m.
#[derive(Clone, Debug)]
pub struct ContourStages {
    /// The points with their likelihoods of lying on a contour; with tangents only if they were not moved to the edge.
    pub likely: Likely,
    /// The candidates.
    pub candidates: Candidates,
    /// Probability of each candidate to be a contour.
    pub probabilities: Vec<f32>,
    pub(super) points: Points,
    pub(super) scale: Scale,
    /// Class of each point of the cloud that has one, if there are classes.
    pub(super) codes: Option<Vec<Option<u8>>>,
    pub(super) min_confidence: f32,
    pub(super) warnings: Vec<String>,
}

/// A model of this recipe.
#[derive(Clone, Copy)]
pub(in crate::recipes) struct ContourModel<'a> {
    pub(in crate::recipes) recipe: &'a ContoursRecipe,
    pub(in crate::recipes) trained: &'a Trained,
}

/// Rates the points and the candidates of a cloud.
///
/// # Errors
/// As [`contours`](crate::recipes::contours()).
pub(in crate::recipes) fn stages_of(
    cloud: &Cloud,
    model: ContourModel<'_>,
    params: &ContourParams,
    monitor: &Monitor,
) -> Result<ContourStages> {
    if !(0.0..=1.0).contains(&params.min_confidence) {
        return Err(Error::parameter("min_confidence", params.min_confidence, "0 to 1"));
    }
    let ContourModel { recipe, trained } = model;
    let original = MetricCloud::new(cloud, params.metres_per_unit.or(recipe.features.metres_per_unit), monitor)?;
    let scale = Scale::of(recipe, &original, monitor)?;
    let scene = scale.scene(&original);
    let codes = codes_of(cloud, params.codes.as_deref())?;
    let mut rated = rate(recipe, &scene, stages(trained)?, monitor)?;
    match &codes {
        Some(codes) => {
            for class in params.without.iter().filter(|&&class| !codes.contains(&Some(class))) {
                monitor.warn(format!("no point has class {class}, which is to be left out"));
            }
            rated.leave_out(codes, &params.without);
        }
        None if params.without.is_empty() => {}
        None => return Err(Error::input("there are no classes of points to leave out (classify the cloud first)")),
    }
    let likely = rated.likely(recipe, monitor)?;
    let candidates = candidates(&likely, &recipe.candidates, monitor)?;
    let warnings = [original.oddities(), warnings(rated.fit.shares())].concat();
    let probabilities = probabilities(trained, &candidates, monitor)?;
    let points = rated.points;
    Ok(ContourStages {
        likely,
        candidates,
        probabilities,
        points,
        scale,
        codes,
        min_confidence: params.min_confidence,
        warnings,
    })
}

/// Warnings about features unlike those of the training.
fn warnings(fit: Option<FeatureFit>) -> Vec<String> {
    let unlike = fit.filter(|fit| fit.beyond > 0.05);
    let said = |fit: FeatureFit| {
        format!(
            "{:.0} % of the feature values lie beyond those of the training: lines may be wrong",
            100.0 * fit.beyond
        )
    };
    unlike.map(said).into_iter().collect()
}

/// The probability of each candidate to be a contour.
fn probabilities(model: &Trained, found: &Candidates, monitor: &Monitor) -> Result<Vec<f32>> {
    debug_assert_eq!(found.descriptors.len(), found.list.len() * VALUES);
    monitor.stage("candidates", found.list.len() as u64);
    let blocks: Vec<&[f32]> = found.descriptors.chunks(BLOCK * VALUES).collect();
    let parts = map_ordered_with(0..blocks.len(), monitor, ClassifierScratch::default, |scratch, block| {
        let mut rows = vec![0.0; blocks[block].len() / VALUES * 2];
        model.classifier.predict_block(blocks[block], scratch, &mut rows)?;
        monitor.advance(BLOCK as u64);
        Ok(rows.chunks_exact(2).map(|row| row[CONTOUR]).collect::<Vec<_>>())
    })?;
    Ok(parts.concat())
}
