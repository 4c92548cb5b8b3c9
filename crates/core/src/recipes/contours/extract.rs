//! From a cloud and a model to lines.

use super::classes::{Sides, codes_of};
use super::likely::{rate, stage};
use super::scaled::Scale;
use crate::classification::{ClassifierScratch, Predictor};
use crate::cloud::{Cloud, MetricCloud};
use crate::contours::{Candidates, Polyline, VALUES, candidates, trace};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::FeatureFit;
use crate::recipes::model::Model;
use crate::recipes::system::any::AnyFitted;
use serde::Serialize;

/// How lines are extracted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContourParams {
    /// Metres per unit of the coordinates; `None`: the cloud's own, else 1.
    pub metres_per_unit: Option<f64>,
    /// Class of each point, for the classes on both sides of a line; `None`: the cloud's classification, if it has one.
    pub codes: Option<Vec<u8>>,
    /// Points of these classes carry no line, for instance those of vegetation.
    pub without: Vec<u8>,
}

/// A line along an edge.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ContourLine {
    /// The vertices in the coordinates of the cloud; the first is not repeated at the end of a closed line.
    pub vertices: Vec<[f64; 3]>,
    /// Whether a last piece leads from the last vertex to the first.
    pub closed: bool,
    /// Metres.
    pub length: f64,
    /// Mean probability of the candidates along the line, 0 to 1.
    pub confidence: f32,
    /// The most frequent classes beside the line, ascending; one twice if there is only one; `None` without classes.
    pub classes: Option<[u8; 2]>,
}

/// The lines of a cloud.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Contours {
    /// The lines.
    pub lines: Vec<ContourLine>,
    /// Edge of a voxel, metres.
    pub voxel: f64,
    /// Number of points that were looked at.
    pub points: usize,
    /// Number of seeds.
    pub seeds: usize,
    /// Number of candidates.
    pub candidates: usize,
    /// Energy of the random field before the first sweep and after each.
    pub energies: Vec<f64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Lines along the edges of objects.
///
/// The model is one of the recipe `contours`. Results are the same for any number of threads. O(n log n) for n points; 80
/// bytes a point.
///
/// # Errors
/// If the model is of another recipe, the cloud has no points with finite coordinates or lacks a column, there is not one
/// class a point, or the work was cancelled.
pub fn contours(cloud: &Cloud, model: &Model, params: &ContourParams, monitor: &Monitor) -> Result<Contours> {
    let AnyFitted::Contours(fitted) = &model.fitted else {
        let reason = format!("it is one of the recipe {} (allowed: contours)", model.fitted.recipe().name());
        return Err(Error::ModelMismatch(reason));
    };
    let recipe = &fitted.recipe;
    let original = MetricCloud::new(cloud, params.metres_per_unit.or(recipe.features.metres_per_unit), monitor)?;
    let scale = Scale::of(recipe, &original, monitor)?;
    let scene = scale.scene(&original);
    let codes = codes_of(cloud, params.codes.as_deref())?;
    let mut rated = rate(recipe, &scene, stage(model)?, monitor)?;
    match &codes {
        Some(codes) => rated.leave_out(codes, &params.without),
        None if params.without.is_empty() => {}
        None => return Err(Error::input("there are no classes of points to leave out (classify the cloud first)")),
    }
    let likely = rated.likely(recipe.candidates.neighbourhood.keep, monitor)?;
    let found = candidates(&likely, &recipe.candidates, monitor)?;
    let traced = trace(&found, &probabilities(model, &found)?, &recipe.trace, monitor)?;
    let sides = codes.as_ref().and_then(|codes| Sides::of(&rated.points, codes));
    let classes = match &sides {
        Some(sides) => sides.beside(&traced.polylines, monitor)?,
        None => vec![None; traced.polylines.len()],
    };
    let place = Place { origin: rated.points.frame.origin, scale };
    let lines = traced.polylines.iter().zip(classes).map(|(line, classes)| place.drawn(line, classes));
    Ok(Contours {
        lines: lines.collect(),
        voxel: scale.voxel,
        points: rated.points.len(),
        seeds: found.seeds.len(),
        candidates: found.list.len(),
        energies: traced.choice.trace.clone(),
        warnings: [original.oddities(), warnings(rated.fit.shares())].concat(),
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
fn probabilities(model: &Model, found: &Candidates) -> Result<Vec<f32>> {
    let mut rows = vec![0.0; found.list.len() * 2];
    debug_assert_eq!(found.descriptors.len(), found.list.len() * VALUES);
    model.classifier.predict_block(&found.descriptors, &mut ClassifierScratch::default(), &mut rows)?;
    Ok(rows.chunks_exact(2).map(|row| row[super::likely::CONTOUR]).collect())
}

/// Where scaled lines lie.
struct Place {
    origin: [f64; 3],
    scale: Scale,
}

impl Place {
    /// A line in the coordinates of the cloud.
    fn drawn(&self, line: &Polyline, classes: Option<[u8; 2]>) -> ContourLine {
        let factor = self.scale.factor();
        let world =
            |at: &[f32; 3]| std::array::from_fn(|a| (f64::from(at[a]) + self.origin[a]) / (self.scale.metres * factor));
        let mut vertices: Vec<[f64; 3]> = line.vertices.iter().map(world).collect();
        let closed = line.vertices.len() > 3 && line.vertices.first() == line.vertices.last();
        if closed {
            vertices.pop();
        }
        ContourLine { vertices, closed, length: line.length() / factor, confidence: line.confidence, classes }
    }
}
