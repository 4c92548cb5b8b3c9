//! Scenes with known edges: to learn from, and to measure lines with.

use super::scaled::Scale;
use super::{ContourLine, Contours, ContoursRecipe};
use crate::cloud::{Cloud, CodeScheme, MetricCloud, OwnClass, Positions};
use crate::contours::{LineScores, Polyline, ScoreParams, sampled, score_lines};
use crate::error::Result;
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::{LabelledCloud, Labels};
use crate::synthetic::{Scene, SceneKind, SceneParams, scene};

/// Distance from an edge up to which a point lies on it, in voxels.
const NEAR: f64 = 0.5;
/// Distance from which it lies on none, in voxels; points between are not labelled.
const FAR: f64 = 1.0;

/// Rays of a made-up scene that is learned from, but from an aircraft.
const RAYS: usize = 500_000;

/// A cloud with labels for the recipe `contours` from reference edges: code 1 for points on one, 0 for points far from all,
/// no label for those between. How near is near follows from the voxels of the recipe. O(n log n).
///
/// # Errors
/// If the cloud has no point, a coordinate is not finite, or the work was cancelled.
pub fn edge_labels(
    recipe: &ContoursRecipe,
    cloud: &Cloud,
    edges: &[Vec<[f64; 3]>],
    monitor: &Monitor,
) -> Result<Labels> {
    let scene = MetricCloud::new(cloud, recipe.features.metres_per_unit, monitor)?;
    let points = scene.some_points(monitor)?;
    let voxel = Scale::of(recipe, &scene, monitor)?.voxel;
    let local = |at: &[f64; 3]| std::array::from_fn(|a| (at[a] * scene.metres - points.frame.origin[a]) as f32);
    let lines: Vec<Polyline> = edges.iter().map(|edge| polyline(edge.iter().map(local).collect())).collect();
    let samples = sampled(&lines, NEAR * voxel / 4.0)?;
    let mut codes = vec![None; cloud.len()];
    for (&index, distance) in points.frame.index.iter().zip(distances(&points.positions, &samples, monitor)?) {
        codes[index as usize] = match distance {
            near if near <= NEAR * voxel => Some(1),
            far if far > FAR * voxel => Some(0),
            _ => None,
        };
    }
    Ok(named(codes))
}

/// Codes of points on contours (1) and off them (0) with their names.
pub(super) fn named(codes: Vec<Option<u8>>) -> Labels {
    let name = |name: &str| OwnClass { name: name.into(), ..OwnClass::default() };
    let names = [(0, name("other")), (1, name("contour"))].into_iter().collect();
    Labels { names, ..Labels::new(codes, CodeScheme::Own) }
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

/// The edges of a scene as lines.
fn lines_of(scene: &Scene) -> Vec<Vec<[f64; 3]>> {
    scene.edges.iter().map(|edge| edge.iter().map(|at| at.map(f64::from)).collect()).collect()
}

/// A scene as a cloud with labels for the recipe `contours`.
///
/// # Errors
/// As [`edge_labels`].
pub fn labelled_scene(recipe: &ContoursRecipe, scene: &Scene, monitor: &Monitor) -> Result<LabelledCloud> {
    let rows: Vec<[f64; 3]> = scene.positions.iter().map(|at| at.map(f64::from)).collect();
    let mut cloud = Cloud::from_rows(&rows)?;
    cloud.metres_per_unit = Some(1.0);
    let labels = edge_labels(recipe, &cloud, &lines_of(scene), monitor)?;
    Ok(LabelledCloud { cloud, labels })
}

/// Made-up scenes of all kinds in turn (street from tripods, street from a car, room, street from an aircraft) with labels
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

/// Precision and recall of lines on a scene: by the rules of the thesis (3 and 6 cm) for voxels of 0.1 m, and in
/// proportion for others.
///
/// # Errors
/// If a coordinate is not finite, or the work was cancelled.
pub fn measure_scene(found: &Contours, scene: &Scene, monitor: &Monitor) -> Result<LineScores> {
    let single = |line: &ContourLine| {
        let ends = line.vertices.iter().chain(line.vertices.first().filter(|_| line.closed));
        polyline(ends.map(|at| at.map(|v| v as f32)).collect())
    };
    let lines: Vec<Polyline> = found.lines.iter().map(single).collect();
    let reference: Vec<Polyline> = scene.edges.iter().map(|edge| polyline(edge.to_vec())).collect();
    let params = ScoreParams::default();
    let factor = found.voxel / super::scaled::VOXEL;
    let [tolerance, forgiven, step] = [params.tolerance, params.forgiven, params.step].map(|length| length * factor);
    score_lines(&lines, &reference, &ScoreParams { tolerance, forgiven, step }, monitor)
}
