//! The whole method of Li 2018, at one depth or several.

use super::clusters::{Seeds, clusters};
use super::connected::connected_clusters;
use super::describe::{OrientedPoints, describe};
use super::graph::riemannian_graph;
use super::params::{NodeWeight, RiemannianParams, Sides};
use crate::cloud::{Points, Positions};
use crate::error::{Error, Result};
use crate::features::normals;
use crate::neighbours::{Neighbours, knn};
use crate::parallel::Monitor;
use crate::segmentation::{CutPursuitParams, Partition, Signal, cut_pursuit, octree};
use serde::Serialize;
use std::time::Instant;

/// Seconds of each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StageSeconds {
    /// Neighbours, normals and their orientation; 0 if they were given.
    pub normals: f64,
    /// Octree and clusters.
    pub supervoxels: f64,
    /// Features, spanning trees and nearest neighbours.
    pub graph: f64,
    /// Cut pursuit.
    pub optimisation: f64,
}

/// Sizes of the graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GraphSizes {
    /// Supervoxels.
    pub nodes: usize,
    /// Number of candidate edges for the spanning tree.
    pub candidates: usize,
    /// Edges of the graph.
    pub edges: usize,
}

/// Result of [`riemannian`].
#[derive(Clone, Debug, PartialEq)]
pub struct Riemannian {
    /// The supervoxels, as a partition of the points.
    pub supervoxels: Partition,
    /// The segments, as a partition of the points.
    pub segments: Partition,
    /// Sizes of the graph.
    pub sizes: GraphSizes,
    /// Iterations of the modified k-means.
    pub iterations: usize,
    /// Mean displacement of the centres in the last iteration, metres.
    pub mean_move: f64,
    /// Energy of the optimisation, Σ m ‖f − g‖² + μ Σ w over the edges between segments.
    pub energy: f64,
    /// Seconds of the stages.
    pub seconds: StageSeconds,
}

/// The segmentation at one depth of the octree.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// d_min.
    pub min_depth: u32,
    /// The result at that depth.
    pub found: Riemannian,
}

/// Segments a cloud by supervoxels on a Riemannian graph.
///
/// M. Li, *A super voxel-based Riemannian graph for multi scale segmentation of LiDAR point clouds*, ISPRS Annals,
/// 2018. The steps: oriented normals; an adaptive octree; a modified k-means that turns its leaves into supervoxels; a
/// graph of their minimum spanning tree and their 8 nearest neighbours by the length of arcs over the surface; l0 cut
/// pursuit on normal, planarity and scattering. `docs/riemannian.md` has our choices where the paper gives no details.
///
/// # Complexity
/// O(n log n) for neighbours, octree and each iteration of the k-means; the graph has one node a supervoxel.
///
/// # Determinism
/// All fields but `seconds` are the same for any number of threads.
///
/// # Errors
/// If a parameter is outside its range, a coordinate is not finite, or the work was cancelled.
///
/// ```
/// use scansion_core::segmentation::{RiemannianParams, riemannian};
/// use scansion_core::{Cloud, cloud::Points, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// // A floor and a wall.
/// let rows: Vec<[f64; 3]> = (0..8192)
///     .map(|i| (f64::from(i % 64) / 16.0, f64::from(i / 64 % 64) / 16.0 + 0.03, i / 4096))
///     .map(|(a, b, wall)| if wall == 1 { [a, 0.0, b] } else { [a, b, 0.0] })
///     .collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0);
/// let mut params = RiemannianParams { strength: 0.3, ..RiemannianParams::default() };
/// params.octree.min_depth = 3;
/// let found = riemannian(&points, &params, &Monitor::default())?;
/// let of = found.segments.segments();
/// assert!(of[2048 + 32] == of[2048 + 40] && of[4096 + 2048 + 32] != of[2048 + 32]);
/// # Ok(())
/// # }
/// ```
pub fn riemannian(points: &Points, params: &RiemannianParams, monitor: &Monitor) -> Result<Riemannian> {
    params.validate()?;
    let surface = Surface::new(points, params, monitor)?;
    run(&points.positions, &surface, params, monitor)
}

/// [`riemannian`] with given unit normals of the points, for instance oriented towards the scanner.
///
/// # Errors
/// As [`riemannian`], and if there is not a finite normal for each point.
pub fn riemannian_with_normals(
    points: &Positions,
    directions: Vec<[f32; 3]>,
    params: &RiemannianParams,
    monitor: &Monitor,
) -> Result<Riemannian> {
    params.validate()?;
    if directions.len() != points.len() || directions.iter().flatten().any(|c| !c.is_finite()) {
        let (given, n) = (directions.len(), points.len());
        return Err(Error::input(format!("{given} normals for {n} points (allowed: a finite one for each)")));
    }
    let near = if params.clusters.connected { knn(points, params.neighbours, monitor)? } else { Neighbours::default() };
    run(points, &Surface { near, directions, seconds: 0.0 }, params, monitor)
}

/// [`riemannian`] at several least depths of the octree (the paper: 4 to 7); normals are computed once.
///
/// # Errors
/// As [`riemannian`].
pub fn multi_scale(
    points: &Points,
    params: &RiemannianParams,
    depths: impl IntoIterator<Item = u32>,
    monitor: &Monitor,
) -> Result<Vec<Scale>> {
    params.validate()?;
    let mut surface = None;
    let mut scales = Vec::new();
    for min_depth in depths {
        let mut params = params.clone();
        params.octree.min_depth = min_depth;
        params.validate()?;
        let surface = match &mut surface {
            Some(surface) => surface,
            none => none.insert(Surface::new(points, &params, monitor)?),
        };
        scales.push(Scale { min_depth, found: run(&points.positions, surface, &params, monitor)? });
        surface.seconds = 0.0;
    }
    Ok(scales)
}

/// Nearest neighbours and normals of the points.
struct Surface {
    near: Neighbours,
    directions: Vec<[f32; 3]>,
    seconds: f64,
}

impl Surface {
    fn new(points: &Points, params: &RiemannianParams, monitor: &Monitor) -> Result<Self> {
        let start = Instant::now();
        let near = knn(&points.positions, params.neighbours, monitor)?;
        let mut directions = normals(&points.positions, &near, monitor)?.directions;
        if params.sides == Sides::Signed {
            params.orientation.orient(points, &near, &mut directions, monitor)?;
        }
        Ok(Self { near, directions, seconds: start.elapsed().as_secs_f64() })
    }
}

fn run(points: &Positions, surface: &Surface, params: &RiemannianParams, monitor: &Monitor) -> Result<Riemannian> {
    let start = Instant::now();
    let oriented = OrientedPoints { points, normals: &surface.directions, sides: params.sides };
    let tree = octree(points, &params.octree, monitor)?;
    let seeds = Seeds { tree: &tree, cell: tree.edge(params.octree.min_depth) };
    monitor.check()?;
    let grown = clusters(oriented, seeds, &params.clusters, monitor)?;
    let labels = match params.clusters.connected {
        true => connected_clusters(&grown.of, &surface.near, params.octree.min_points, monitor)?,
        false => grown.of,
    };
    let supervoxels = Partition::from_labels_watched(&labels, monitor)?;
    drop(labels);
    let mut seconds = StageSeconds { normals: surface.seconds, ..StageSeconds::default() };
    seconds.supervoxels = start.elapsed().as_secs_f64();

    monitor.check()?;
    let start = Instant::now();
    let nodes = describe(oriented, &supervoxels, params.shape_weight, monitor)?;
    let built = riemannian_graph(&nodes, &params.graph, monitor)?;
    seconds.graph = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let weights = node_weights(&supervoxels, params.node_weight);
    let signal = Signal::new(&nodes.features, nodes.width)?.with_weights(&weights)?;
    let cut = CutPursuitParams {
        strength: params.strength,
        seed: params.seed,
        steps: params.cut_pursuit.clone(),
        ..CutPursuitParams::default()
    };
    let optimum = cut_pursuit(&signal, &built.graph, &cut, monitor)?;
    let segments = supervoxels.coarser(&optimum.partition, monitor)?;
    seconds.optimisation = start.elapsed().as_secs_f64();
    let sizes = GraphSizes { nodes: supervoxels.len(), candidates: built.candidates, edges: built.graph.edges().len() };
    let (iterations, mean_move, energy) = (grown.iterations, grown.mean_move, optimum.energy);
    Ok(Riemannian { supervoxels, segments, sizes, iterations, mean_move, energy, seconds })
}

fn node_weights(supervoxels: &Partition, weight: NodeWeight) -> Vec<f32> {
    let mean = supervoxels.nodes() as f64 / supervoxels.len().max(1) as f64;
    let of = |members: &[u32]| match weight {
        NodeWeight::One => 1.0,
        NodeWeight::Points => (members.len() as f64 / mean) as f32,
    };
    supervoxels.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;

    /// The faces of a cube of 4 m without noise, with outward normals; and the face of each point.
    fn cube(side: usize) -> (Positions, Vec<[f32; 3]>, Vec<u32>) {
        let (mut points, mut normals, mut faces) = (Positions::default(), Vec::new(), Vec::new());
        let place = |i: usize| 4.0 * (i as f32 + 0.5) / side as f32;
        for i in 0..6 * side * side {
            let (face, a, b) = (i % 6, place(i / 6 % side), place(i / 6 / side));
            let (axis, far) = (face / 2, face % 2 == 1);
            let mut at = [0.0; 3];
            at[axis] = if far { 4.0 } else { 0.0 };
            at[(axis + 1) % 3] = a;
            at[(axis + 2) % 3] = b;
            let mut normal = [0.0; 3];
            normal[axis] = if far { 1.0 } else { -1.0 };
            points.push(at);
            normals.push(normal);
            faces.push(face as u32);
        }
        (points, normals, faces)
    }

    fn params(strength: f64) -> RiemannianParams {
        let mut params = RiemannianParams { strength, ..RiemannianParams::default() };
        params.octree.min_depth = 3;
        params
    }

    /// The cube without points near its edges: no leaf of depth 3 holds points of two faces.
    fn faces_apart() -> (Positions, Vec<[f32; 3]>, Vec<u32>) {
        let (points, normals, faces) = cube(64);
        let rim = |v: f32| (0.01..0.5).contains(&v) || (3.5..3.99).contains(&v);
        let inner = |i: &usize| !points.xyz(*i).into_iter().any(rim);
        let keep: Vec<usize> = (0..points.len()).filter(inner).collect();
        let part = keep.iter().map(|&i| points.xyz(i)).collect();
        (part, keep.iter().map(|&i| normals[i]).collect(), keep.iter().map(|&i| faces[i]).collect())
    }

    #[test]
    fn a_cube_has_six_segments_for_a_range_of_strengths() {
        let run = |(points, normals, faces): (Positions, Vec<[f32; 3]>, Vec<u32>), strength| {
            let mut params = params(strength);
            params.octree.stop = crate::segmentation::StopRule::Absolute(0.5);
            let found = riemannian_with_normals(&points, normals, &params, &Monitor::default()).unwrap();
            (found.segments, Partition::from_labels(&faces).unwrap())
        };
        for strength in [0.002, 0.01, 0.05, 0.1, 0.2, 0.3, 0.6] {
            let (found, expected) = run(faces_apart(), strength);
            assert!(found == expected, "strength {strength}: {} segments", found.len());
        }
        // On a whole cube the leaves at the edges hold points of two faces: their clusters join a face only at a higher
        // strength.
        for strength in [0.3, 0.4, 0.6] {
            assert_eq!(run(cube(64), strength).0.len(), 6, "strength {strength}");
        }
    }

    /// A rough floor, two walls that meet, and a ball above.
    fn room(count: usize) -> Points {
        let mut random = stream(9, 1);
        let row = |i: usize| {
            let [a, b, c] = [0; 3].map(|_| random.uniform() as f32);
            let noise = 0.02 * (c - 0.5);
            let at = match i % 4 {
                0 => [8.0 * a, 8.0 * b, noise],
                1 => [8.0 * a, noise, 4.0 * b],
                2 => [noise, 8.0 * a, 4.0 * b],
                _ => {
                    let (turn, z) = (std::f32::consts::TAU * a, 2.0 * b - 1.0);
                    let r = (1.0 - z * z).sqrt();
                    [4.0 + r * turn.cos(), 4.0 + r * turn.sin(), 2.5 + z]
                }
            };
            // Multiples of 2^-9 m, so that moving and scaling are exact.
            at.map(|v| f64::from((v * 512.0).round() / 512.0 + 0.0))
        };
        of_rows((0..count).map(row))
    }

    fn of_rows(rows: impl Iterator<Item = [f64; 3]>) -> Points {
        Points::from_cloud(&Cloud::from_rows(&rows.collect::<Vec<_>>()).unwrap(), 1.0)
    }

    #[test]
    fn parts_fit_together_and_any_number_of_threads_gives_the_same() {
        let points = room(20_000);
        for connected in [false, true] {
            let mut params = params(0.1);
            params.clusters.connected = connected;
            let with = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let found = pool.install(|| riemannian(&points, &params, &Monitor::default())).unwrap();
                Riemannian { seconds: StageSeconds::default(), ..found }
            };
            let found = with(1);
            assert_eq!(found, with(3));
            assert_eq!((found.supervoxels.nodes(), found.segments.nodes()), (20_000, 20_000));
            assert!(found.supervoxels.iter().chain(found.segments.iter()).all(|members| !members.is_empty()));
            for members in found.supervoxels.iter() {
                let of = |i: &u32| found.segments.segments()[*i as usize];
                assert!(members.iter().all(|i| of(i) == of(&members[0])), "a supervoxel lies in one segment");
            }
            assert_eq!(found.sizes.nodes, found.supervoxels.len());
            assert!(found.sizes.edges >= found.sizes.nodes - 1 && found.sizes.edges <= found.sizes.candidates);
            assert!(found.segments.len() > 3 && found.segments.len() < found.supervoxels.len() / 4);
        }
    }

    #[test]
    fn scaling_the_cloud_with_the_threshold_changes_nothing() {
        let points = room(8000);
        let by = |factor: f32| {
            let mut points = points.clone();
            let Positions { x, y, z } = &mut points.positions;
            [x, y, z].into_iter().flatten().for_each(|v| *v *= factor);
            let mut params = params(0.1);
            params.octree.stop = crate::segmentation::StopRule::Absolute(0.001 * f64::from(factor).powi(2));
            riemannian(&points, &params, &Monitor::default()).unwrap()
        };
        let (here, large) = (by(1.0), by(4.0));
        assert_eq!((here.supervoxels, here.segments), (large.supervoxels, large.segments));
    }

    #[test]
    fn the_energy_is_that_of_the_segments_and_a_strength_without_bounds_leaves_one() {
        let points = room(8000);
        let surface = Surface::new(&points, &params(0.1), &Monitor::default()).unwrap();
        let at = |strength| run(&points.positions, &surface, &params(strength), &Monitor::default()).unwrap();
        let found = at(0.1);
        let oriented = OrientedPoints { points: &points.positions, normals: &surface.directions, sides: Sides::Signed };
        let nodes = describe(oriented, &found.supervoxels, 1.0, &Monitor::default()).unwrap();
        let graph = riemannian_graph(&nodes, &params(0.1).graph, &Monitor::default()).unwrap().graph;
        let segment: Vec<u32> =
            found.supervoxels.iter().map(|members| found.segments.segments()[members[0] as usize]).collect();
        let energy = |segment: &[u32], strength: f64| {
            let mut energy = 0.0;
            for members in Partition::from_labels(segment).unwrap().iter() {
                for value in 0..5 {
                    let of = |&node: &u32| f64::from(nodes.features[node as usize * 5 + value]);
                    let mean = members.iter().map(of).sum::<f64>() / members.len() as f64;
                    energy += members.iter().map(|node| (of(node) - mean).powi(2)).sum::<f64>();
                }
            }
            let cut = graph.edges().iter().filter(|[a, b]| segment[*a as usize] != segment[*b as usize]);
            energy + strength * cut.count() as f64
        };
        assert!((found.energy - energy(&segment, 0.1)).abs() < 1e-6 * found.energy);
        let (alone, whole): (Vec<u32>, Vec<u32>) = ((0..segment.len() as u32).collect(), vec![0; segment.len()]);
        assert!(found.energy < energy(&alone, 0.1) && found.energy < energy(&whole, 0.1));
        assert_eq!(at(1e6).segments.len(), 1, "the graph is connected");
        assert_eq!(at(0.0).energy, 0.0);
    }

    #[test]
    fn several_depths_are_those_one_by_one() {
        let points = room(6000);
        let scales = multi_scale(&points, &params(0.1), [2, 4], &Monitor::default()).unwrap();
        for Scale { min_depth, found } in &scales {
            let mut params = params(0.1);
            params.octree.min_depth = *min_depth;
            let alone = riemannian(&points, &params, &Monitor::default()).unwrap();
            assert_eq!((&found.supervoxels, &found.segments), (&alone.supervoxels, &alone.segments));
        }
        assert!(scales[0].found.supervoxels.len() < scales[1].found.supervoxels.len());
        assert!(scales[0].found.seconds.normals > 0.0 && scales[1].found.seconds.normals == 0.0);
    }

    #[test]
    fn other_options_run_and_weights_count_points() {
        let points = room(6000);
        for change in [
            |p: &mut RiemannianParams| p.sides = Sides::Unsigned,
            |p: &mut RiemannianParams| p.node_weight = NodeWeight::Points,
            |p: &mut RiemannianParams| p.clusters.start = super::super::Start::Cube,
            |p: &mut RiemannianParams| p.graph.thin_wall = true,
        ] {
            let mut params = params(0.1);
            change(&mut params);
            let found = riemannian(&points, &params, &Monitor::default()).unwrap();
            assert!(found.segments.len() > 3);
        }
        let parts = Partition::from_labels(&[0, 0, 0, 1]).unwrap();
        assert_eq!(node_weights(&parts, NodeWeight::Points), [1.5, 0.5]);
        assert_eq!(node_weights(&parts, NodeWeight::One), [1.0, 1.0]);
    }

    #[test]
    fn few_points_are_fine_and_nonsense_is_refused() {
        for count in [0, 1, 2, 5] {
            let found = riemannian(&room(count), &params(0.1), &Monitor::default()).unwrap();
            assert_eq!(found.segments.nodes(), count);
        }
        let one = of_rows(cube(1).0.iter().map(|at| at.map(f64::from)));
        let one = riemannian(&one, &params(0.1), &Monitor::default()).unwrap();
        assert_eq!(one.supervoxels.nodes(), 6);
        let (points, mut normals, _) = cube(2);
        normals[3][1] = f32::NAN;
        assert!(riemannian_with_normals(&points, normals, &params(0.1), &Monitor::default()).is_err());
        assert!(riemannian_with_normals(&points, vec![], &params(0.1), &Monitor::default()).is_err());
        let cancelled = Monitor::default();
        cancelled.cancel();
        assert!(riemannian(&room(5), &params(0.1), &cancelled).is_err());
    }
}
