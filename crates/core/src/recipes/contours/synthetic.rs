//! Scenes with known edges: to learn from, and to measure lines with.

use super::scaled::{LocalLines, Scale};
use super::{ContourLine, Contours, ContoursRecipe};
use crate::cloud::{Cloud, CodeScheme, MetricCloud, OwnClass, Positions};
use crate::contours::{ComparedLines, LineScores, Polyline, ScoreParams, sampled, score_lines};
use crate::error::{Error, Result};
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::{EdgeLines, LabelledCloud, Labels};
use crate::synthetic::{Scene, SceneKind, SceneParams, scene};
use serde::Serialize;

/// Distance from unsure edges up to which points are not labelled, in voxels.
const UNSURE: f64 = 1.0;

/// Rays of a synthetic scene that is learned from, but from an aircraft.
const RAYS: usize = 500_000;

/// A cloud with labels for the recipe `contours` from reference edges: its code for points on one, another code for points far
/// from all, no label for those between and those near unsure ones. How near is near follows from the voxels of the recipe. O(n
/// log n).
///
/// # Errors
/// If the cloud has no point, no point lies near a line, a coordinate is not finite, or the work was cancelled.
pub fn edge_labels(recipe: &ContoursRecipe, cloud: &Cloud, edges: EdgeLines, monitor: &Monitor) -> Result<Labels> {
    let scene = MetricCloud::new(cloud, recipe.features.metres_per_unit, monitor)?;
    let points = scene.some_points(monitor)?;
    let voxel = Scale::of(recipe, &scene, monitor)?.voxel;
    let distances = |edges: &[Vec<[f64; 3]>]| {
        let lines = LocalLines { metres: scene.metres, origin: points.frame.origin }.of(edges);
        distances(&points.positions, &sampled(&lines, recipe.near * voxel / 4.0)?, monitor)
    };
    let (near, unsure) = (distances(&edges.lines)?, distances(&edges.unsure)?);
    let [on, off] = [recipe.code, other(recipe.code)];
    let mut codes = vec![None; cloud.len()];
    for (row, &index) in points.frame.index.iter().enumerate() {
        codes[index as usize] = match near[row] {
            distance if distance <= recipe.near * voxel => Some(on),
            distance if distance > recipe.far * voxel && unsure[row] > UNSURE * voxel => Some(off),
            _ => None,
        };
    }
    if !edges.lines.is_empty() && !codes.contains(&Some(on)) {
        let near = recipe.near * voxel;
        return Err(Error::input(format!(
            "no point lies within {near:.3} m of a line (allowed: lines in the reference system and the unit of the cloud)"
        )));
    }
    let name = |name: &str| OwnClass { name: name.into(), ..OwnClass::default() };
    let names = [(off, name("other")), (on, name("contour"))].into_iter().collect();
    Ok(Labels { names, edges, ..Labels::new(codes, CodeScheme::Own) })
}

/// The code of points that lie on no contour.
fn other(code: u8) -> u8 {
    u8::from(code == 0)
}

/// Distance of each position from the nearest of some others.
fn distances(of: &Positions, from: &Positions, monitor: &Monitor) -> Result<Vec<f64>> {
    if from.is_empty() {
        return Ok(vec![f64::INFINITY; of.len()]);
    }
    let nearest = nearest_of(from, of, 1, monitor)?;
    Ok((0..of.len()).map(|i| f64::from(nearest.squared_distances(i)[0]).sqrt()).collect())
}

fn polyline(vertices: Vec<[f32; 3]>) -> Polyline {
    Polyline { vertices, confidence: 1.0, nodes: Vec::new() }
}

/// The edges of a scene; those whose points are farther apart than a voxel are unsure.
fn edges_of(scene: &Scene, voxel: f64) -> [Vec<[[f32; 3]; 2]>; 2] {
    let mut edges: [Vec<[[f32; 3]; 2]>; 2] = Default::default();
    for (edge, &spacing) in scene.edges.iter().zip(&scene.edge_spacing) {
        edges[usize::from(f64::from(spacing) > voxel)].push(*edge);
    }
    edges
}

/// A scene as a cloud with labels for the recipe `contours`, in the unit of the recipe.
///
/// # Errors
/// As [`edge_labels`].
pub fn labelled_scene(recipe: &ContoursRecipe, scene: &Scene, monitor: &Monitor) -> Result<LabelledCloud> {
    let unit = recipe.features.metres_per_unit.unwrap_or(1.0);
    let place = |at: [f32; 3]| at.map(|v| f64::from(v) / unit);
    let rows: Vec<[f64; 3]> = scene.positions.iter().map(place).collect();
    let mut cloud = Cloud::from_rows(&rows)?;
    cloud.metres_per_unit = Some(unit);
    let voxel = Scale::of(recipe, &MetricCloud::new(&cloud, Some(unit), monitor)?, monitor)?.voxel;
    let [lines, unsure] = edges_of(scene, voxel).map(|part| part.iter().map(|edge| edge.map(place).to_vec()).collect());
    let labels = edge_labels(recipe, &cloud, EdgeLines { lines, unsure }, monitor)?;
    Ok(LabelledCloud { cloud, labels })
}

/// Synthetic scenes of all kinds in turn (street from tripods, street from a car, room, street from an aircraft) with labels
/// for the recipe `contours`: as many as are asked for, with seeds from that of the recipe on.
///
/// # Errors
/// As [`edge_labels`].
pub fn labelled_scenes(recipe: &ContoursRecipe, count: usize, monitor: &Monitor) -> Result<Vec<LabelledCloud>> {
    let kinds = [SceneKind::Urban, SceneKind::Mobile, SceneKind::Indoor, SceneKind::Airborne];
    let one = |number: usize| {
        // Two scenes of a kind follow each other, so that both halves of the clouds have all kinds.
        let own = SceneParams::of(kinds[number / 2 % kinds.len()]);
        let rays = if own.kind == SceneKind::Airborne { own.rays } else { RAYS };
        let params = SceneParams { seed: recipe.seed.wrapping_add(number as u64), rays, ..own };
        labelled_scene(recipe, &scene(&params, monitor)?, monitor)
    };
    (0..count).map(one).collect()
}

/// Scores of lines on a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SceneScores {
    /// On edges beside which points are at most a voxel apart; what was found along the others does not count.
    pub resolved: LineScores,
    /// On all edges that have points beside them, also those that are scanned too sparsely for the voxel.
    pub all: LineScores,
}

/// Precision and recall of lines on a scene: by the rules of the thesis (3 and 6 cm) for voxels of 0.1 m, and in
/// proportion for others.
///
/// # Errors
/// If a coordinate is not finite, or the work was cancelled.
pub fn measure_scene(found: &Contours, scene: &Scene, monitor: &Monitor) -> Result<SceneScores> {
    let single = |line: &ContourLine| {
        let ends = line.vertices.iter().chain(line.vertices.first().filter(|_| line.closed));
        polyline(ends.map(|at| at.map(|v| v as f32)).collect())
    };
    let lines: Vec<Polyline> = found.lines.iter().map(single).collect();
    let [reference, unsure] =
        edges_of(scene, found.voxel).map(|part| part.iter().map(|edge| polyline(edge.to_vec())).collect::<Vec<_>>());
    let params = ScoreParams::default();
    let factor = found.voxel / super::scaled::VOXEL;
    let [tolerance, forgiven, step] = [params.tolerance, params.forgiven, params.step].map(|length| length * factor);
    let params = ScoreParams { tolerance, forgiven, step };
    let score = |reference: &[Polyline], unsure: &[Polyline]| {
        score_lines(&ComparedLines { found: &lines, reference, unsure }, &params, monitor)
    };
    Ok(SceneScores {
        resolved: score(&reference, &unsure)?,
        all: score(&[reference.clone(), unsure.clone()].concat(), &[])?,
    })
}
