//! Modified k-means: clusters of points that are near each other and have similar normals.
//!
//! Li 2018, equation 2: D = (2 − D_N) · D_s with D_N = n_p · n_c (clamped to −1..1), D_s = ‖p − c‖; each point is
//! assigned to the centre of least D, each centre moves to the mean of its points. D_s ≤ D ≤ 3 D_s. Unlike k-means this
//! decreases no objective function: the mean does not minimise Σ D.

use super::boxes::{Bounds, Boxes, Visitor};
use super::describe::OrientedPoints;
use super::params::{KMeansParams, Sides, Start};
use crate::error::Result;
use crate::parallel::{Looks, Monitor, concat_watched, map_ordered_with, map_watched, watched};
use crate::segmentation::Octree;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Points that are compared with a centre at once (SIMD lanes).
const LANES: usize = 16;
/// Points of a leaf that are compared with the same list of centres.
const GROUP: usize = 64;
/// Least number of points of a task.
const TASK: usize = 8192;
/// A sum of unit vectors shorter than this share of their number counts as zero: no mean direction.
const NO_DIRECTION: f64 = 1e-6;

/// A position and a unit normal: x, y, z, n_x, n_y, n_z.
type Row = [f32; 6];

/// Result of [`clusters`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clusters {
    /// Cluster of each point; cluster i starts from leaf i of the octree, some may be empty.
    pub(super) of: Vec<u32>,
    /// Iterations done.
    pub(super) iterations: usize,
    /// Mean displacement of the centres in the last iteration, metres.
    pub(super) mean_move: f64,
}

/// Where the clusters start: the leaves of an octree.
#[derive(Clone, Copy)]
pub(super) struct Seeds<'a> {
    pub(super) tree: &'a Octree,
    /// Edge of the octree's largest leaves, metres.
    pub(super) cell: f64,
}

/// Clusters that start from the leaves of an octree.
///
/// The nearest centre is found exactly, ties go to the smaller index. O(n · candidates) an iteration, about 50
/// candidates.
pub(super) fn clusters(
    oriented: OrientedPoints<'_>,
    Seeds { tree, cell }: Seeds<'_>,
    params: &KMeansParams,
    monitor: &Monitor,
) -> Result<Clusters> {
    let rows = SortedPoints::new(oriented, tree, monitor)?;
    let leaves: Vec<Range<usize>> = tree.points.offsets().windows(2).map(|w| w[0] as usize..w[1] as usize).collect();
    let mut of: Vec<u32> = Vec::with_capacity(oriented.points.len());
    let mut looks = Looks::at(monitor);
    for (leaf, range) in (0u32..).zip(&leaves) {
        looks.steps(range.len())?;
        of.extend(range.clone().map(|_| leaf));
    }
    let mut centres = vec![[0.0; 6]; leaves.len()];
    rows.first_normals(&leaves, &mut centres);
    rows.update(&of, &mut centres, monitor)?;
    if params.start == Start::Cube {
        for (centre, leaf) in centres.iter_mut().zip(&tree.leaves) {
            centre.iter_mut().zip(tree.centre(leaf)).for_each(|(c, at)| *c = at as f32);
        }
    }
    let leaves = LeafTasks { tasks: tasks(&leaves), leaves };
    let (mut iterations, mut mean_move) = (0, 0.0);
    monitor.stage("supervoxels", (params.max_iterations * of.len()) as u64);
    while iterations < params.max_iterations {
        of = rows.assign(&of, &centres, &leaves, monitor)?;
        mean_move = rows.update(&of, &mut centres, monitor)?;
        iterations += 1;
        if mean_move < params.tolerance * cell {
            break;
        }
    }
    let mut labels = vec![0; of.len()];
    for piece in watched(of.len(), monitor) {
        piece?.for_each(|at| labels[tree.points.items()[at] as usize] = of[at]);
    }
    Ok(Clusters { of: labels, iterations, mean_move })
}

/// Runs of leaves that together hold about [`TASK`] points.
fn tasks(leaves: &[Range<usize>]) -> Vec<Range<usize>> {
    let mut tasks: Vec<Range<usize>> = Vec::new();
    let mut points = TASK;
    for (l, leaf) in leaves.iter().enumerate() {
        if points >= TASK {
            tasks.push(l..l);
            points = 0;
        }
        points += leaf.len();
        if let Some(task) = tasks.last_mut() {
            task.end = l + 1;
        }
    }
    tasks
}

/// The leaves, as ranges of the sorted points, in runs that are a task each.
struct LeafTasks {
    leaves: Vec<Range<usize>>,
    tasks: Vec<Range<usize>>,
}

/// The points in Morton order.
struct SortedPoints {
    axes: [Vec<f32>; 6],
    sides: Sides,
}

impl SortedPoints {
    fn new(oriented: OrientedPoints<'_>, tree: &Octree, monitor: &Monitor) -> Result<Self> {
        let OrientedPoints { points, normals: directions, sides } = oriented;
        let order = tree.points.items();
        let place = |axis: &[f32]| map_watched(order.len(), monitor, |i| axis[order[i] as usize]);
        let normal = |a: usize| map_watched(order.len(), monitor, |i| directions[order[i] as usize][a]);
        let axes = [place(&points.x)?, place(&points.y)?, place(&points.z)?, normal(0)?, normal(1)?, normal(2)?];
        Ok(Self { axes, sides })
    }

    fn row(&self, i: usize) -> Row {
        std::array::from_fn(|a| self.axes[a][i])
    }

    /// Initialises the normal of each centre with that of the first point of its leaf.
    fn first_normals(&self, leaves: &[Range<usize>], centres: &mut [Row]) {
        for (centre, leaf) in centres.iter_mut().zip(leaves) {
            centre[3..].copy_from_slice(&self.row(leaf.start)[3..]);
        }
    }

    /// Moves each centre to the mean of its points; a centre without points stays. Returns the mean displacement.
    ///
    /// For unsigned normals each normal is first turned to the side of the centre's previous normal.
    fn update(&self, of: &[u32], centres: &mut [Row], monitor: &Monitor) -> Result<f64> {
        let mut sums = vec![[0f64; 7]; centres.len()];
        for points in watched(of.len(), monitor) {
            for i in points? {
                let (row, cluster) = (self.row(i), of[i] as usize);
                let turned = self.sides == Sides::Unsigned && cosine(&row, &centres[cluster]) < 0.0;
                let side = if turned { -1.0 } else { 1.0 };
                let sum = &mut sums[cluster];
                sum[6] += 1.0;
                (0..3).for_each(|a| sum[a] += f64::from(row[a]));
                (3..6).for_each(|a| sum[a] += side * f64::from(row[a]));
            }
        }
        let (mut moved, mut filled) = (0.0, 0.0);
        for (centre, sum) in centres.iter_mut().zip(&sums).filter(|(_, sum)| sum[6] > 0.0) {
            let next = [0, 1, 2].map(|a| (sum[a] / sum[6]) as f32);
            moved += (0..3).map(|a| f64::from(next[a] - centre[a]).powi(2)).sum::<f64>().sqrt();
            filled += 1.0;
            centre[..3].copy_from_slice(&next);
            let length = (sum[3] * sum[3] + sum[4] * sum[4] + sum[5] * sum[5]).sqrt();
            if length > NO_DIRECTION * sum[6] {
                (3..6).for_each(|a| centre[a] = (sum[a] / length) as f32);
            }
        }
        Ok(if filled > 0.0 { moved / filled } else { 0.0 })
    }

    /// The nearest centre of every point. `of` has the previous centre of each point, whose distance limits the search;
    /// any other centre gives the same result.
    fn assign(&self, of: &[u32], centres: &[Row], leaves: &LeafTasks, monitor: &Monitor) -> Result<Vec<u32>> {
        let places: Vec<[f32; 3]> = centres.iter().map(|c| [c[0], c[1], c[2]]).collect();
        let candidates = Candidates { points: self, of, centres, boxes: Boxes::new(&places) };
        let LeafTasks { leaves, tasks } = leaves;
        let parts = map_ordered_with(0..tasks.len(), monitor, Vec::new, |found: &mut Vec<(u32, Row)>, t| {
            let leaves = &leaves[tasks[t].clone()];
            let mut out = Vec::with_capacity(leaves.iter().map(ExactSizeIterator::len).sum());
            for leaf in leaves {
                for first in leaf.clone().step_by(GROUP) {
                    let group = first..(first + GROUP).min(leaf.end);
                    candidates.near(group.clone(), found);
                    Arch::new().dispatch(Compare { rows: self, group, centres: found, out: &mut out });
                }
            }
            monitor.advance(out.len() as u64);
            Ok(out)
        })?;
        concat_watched(parts, monitor)
    }
}

/// The centres that points are compared with.
struct Candidates<'a> {
    points: &'a SortedPoints,
    /// Previous centre of every point.
    of: &'a [u32],
    centres: &'a [Row],
    boxes: Boxes,
}

impl Candidates<'_> {
    /// The centres that may be nearest to one of the points of a group, ascending. A centre farther from the points' box than any
    /// point is from its previous centre cannot be: D² ≥ D_s² ≥ the squared gap.
    fn near(&self, group: Range<usize>, found: &mut Vec<(u32, Row)>) {
        let Self { points, of, centres, boxes } = self;
        let (mut bounds, mut reach) = (Bounds::none(), 0f32);
        for i in group {
            let row = points.row(i);
            bounds.include(&Bounds::at([row[0], row[1], row[2]]));
            reach = reach.max(squared_distance(&row, &centres[of[i] as usize], points.sides));
        }
        found.clear();
        boxes.visit(&mut Within { bounds, reach, centres, found });
    }
}

/// Collects the centres within reach of a box.
struct Within<'a> {
    bounds: Bounds,
    reach: f32,
    centres: &'a [Row],
    found: &'a mut Vec<(u32, Row)>,
}

impl Visitor for Within<'_> {
    #[inline(always)]
    fn wants(&mut self, _: usize, _: usize, bounds: &Bounds) -> bool {
        bounds.gap(&self.bounds) <= self.reach
    }

    #[inline(always)]
    fn take(&mut self, places: Range<usize>) {
        for (c, centre) in (places.start as u32..).zip(&self.centres[places]) {
            if Bounds::at([centre[0], centre[1], centre[2]]).gap(&self.bounds) <= self.reach {
                self.found.push((c, *centre));
            }
        }
    }
}

#[inline(always)]
fn cosine(a: &Row, b: &Row) -> f32 {
    a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}

/// D² of a point and a centre, m².
#[inline(always)]
fn squared_distance(p: &Row, c: &Row, sides: Sides) -> f32 {
    let cosine = cosine(p, c);
    let alike = if sides == Sides::Unsigned { cosine.abs() } else { cosine };
    let factor = (2.0 - alike).clamp(1.0, 3.0);
    let [x, y, z] = [p[0] - c[0], p[1] - c[1], p[2] - c[2]];
    factor * factor * (x * x + y * y + z * z)
}

/// Compares a group with its candidates, compiled for each instruction set.
struct Compare<'a> {
    rows: &'a SortedPoints,
    group: Range<usize>,
    centres: &'a [(u32, Row)],
    out: &'a mut Vec<u32>,
}

impl WithSimd for Compare<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for first in self.group.clone().step_by(LANES) {
            let lanes = LANES.min(self.group.end - first);
            let mut at = [[0f32; LANES]; 6];
            for (lane, axis) in at.iter_mut().zip(&self.rows.axes) {
                lane[..lanes].copy_from_slice(&axis[first..first + lanes]);
            }
            let best = match self.rows.sides {
                Sides::Signed => nearest::<false>(&at, self.centres),
                Sides::Unsigned => nearest::<true>(&at, self.centres),
            };
            self.out.extend_from_slice(&best[..lanes]);
        }
    }
}

/// The centre of least D² for 16 points, with the same arithmetic as [`squared_distance`].
#[inline(always)]
fn nearest<const UNSIGNED: bool>(at: &[[f32; LANES]; 6], centres: &[(u32, Row)]) -> [u32; LANES] {
    let mut best = [f32::INFINITY; LANES];
    let mut index = [0u32; LANES];
    for (c, centre) in centres {
        for l in 0..LANES {
            let cosine = at[3][l] * centre[3] + at[4][l] * centre[4] + at[5][l] * centre[5];
            let alike = if UNSIGNED { cosine.abs() } else { cosine };
            let factor = (2.0 - alike).clamp(1.0, 3.0);
            let (x, y, z) = (at[0][l] - centre[0], at[1][l] - centre[1], at[2][l] - centre[2]);
            let distance = factor * factor * (x * x + y * y + z * z);
            let closer = distance < best[l];
            best[l] = if closer { distance } else { best[l] };
            index[l] = if closer { *c } else { index[l] };
        }
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Positions;
    use crate::random::{Stream, stream};
    use crate::segmentation::{OctreeParams, StopRule, octree};

    fn unit(random: &mut Stream) -> [f32; 3] {
        let v = [0; 3].map(|_| random.uniform() - 0.5);
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
        v.map(|c| (c / length) as f32)
    }

    /// The two faces of a wall, a floor and a bush, with random normals.
    fn scene(count: usize) -> (Positions, Vec<[f32; 3]>) {
        let mut random = stream(3, 9);
        let mut points = Positions::default();
        let mut normals = Vec::new();
        for i in 0..count {
            let [a, b, c] = [0; 3].map(|_| random.uniform() as f32);
            let (at, normal) = match i % 4 {
                0 => ([6.0 * a, 6.0 * b, 0.0], [0.0, 0.0, 1.0]),
                1 => ([6.0 * a, 3.0, 2.0 * b], [0.0, -1.0, 0.0]),
                2 => ([6.0 * a, 3.1, 2.0 * b], [0.0, 1.0, 0.0]),
                _ => ([1.0 + a, 1.0 + b, 1.0 + c], unit(&mut random)),
            };
            let bent: [f32; 3] = std::array::from_fn(|k| normal[k] + 0.2 * unit(&mut random)[k]);
            let length = bent.iter().map(|c| c * c).sum::<f32>().sqrt();
            points.push(at);
            normals.push(bent.map(|c| c / length));
        }
        (points, normals)
    }

    fn tree(points: &Positions) -> Octree {
        let params = OctreeParams { min_depth: 3, stop: StopRule::Sigma(0.02), ..OctreeParams::default() };
        octree(points, &params, &Monitor::default()).unwrap()
    }

    #[test]
    fn the_nearest_centre_is_that_of_brute_force() {
        let (points, normals) = scene(3000);
        let tree = tree(&points);
        let leaves: Vec<Range<usize>> =
            tree.points.offsets().windows(2).map(|w| w[0] as usize..w[1] as usize).collect();
        let tasks = LeafTasks { tasks: tasks(&leaves), leaves: leaves.clone() };
        let mut random = stream(4, 4);
        for sides in [Sides::Signed, Sides::Unsigned] {
            let oriented = OrientedPoints { points: &points, normals: &normals, sides };
            let rows = SortedPoints::new(oriented, &tree, &Monitor::default()).unwrap();
            let mut centres: Vec<Row> = leaves.iter().map(|l| rows.row(l.start + l.len() / 2)).collect();
            centres[5] = centres[6];
            for start in ["leaf", "anywhere"] {
                let of: Vec<u32> = match start {
                    "leaf" => (0u32..).zip(&leaves).flat_map(|(l, r)| r.clone().map(move |_| l)).collect(),
                    _ => (0..3000).map(|_| random.below(leaves.len()) as u32).collect(),
                };
                let found = rows.assign(&of, &centres, &tasks, &Monitor::default()).unwrap();
                for (i, &cluster) in found.iter().enumerate() {
                    let distance = |c: usize| squared_distance(&rows.row(i), &centres[c], sides);
                    let expected = (1..centres.len()).fold(0, |b, c| if distance(c) < distance(b) { c } else { b });
                    assert_eq!(cluster as usize, expected, "point {i} from {start}");
                }
            }
        }
    }

    #[test]
    fn the_distance_lies_between_the_euclidean_and_three_times_it() {
        let mut random = stream(8, 8);
        for _ in 0..1000 {
            let row = |random: &mut Stream| {
                let (place, normal) = (unit(random), unit(random));
                [place[0], place[1], place[2], normal[0], normal[1], normal[2]]
            };
            let (p, c) = (row(&mut random), row(&mut random));
            let euclidean: f32 = (0..3).map(|a| (p[a] - c[a]).powi(2)).sum::<f32>();
            for (sides, most) in [(Sides::Signed, 9.0), (Sides::Unsigned, 4.0)] {
                let found = squared_distance(&p, &c, sides);
                assert!(found >= euclidean * 0.999_999 && found <= most * euclidean * 1.000_001);
            }
        }
        let (p, c) = ([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 0.0, 0.0, -1.0]);
        assert_eq!(squared_distance(&p, &c, Sides::Signed), 36.0);
        assert_eq!(squared_distance(&p, &c, Sides::Unsigned), 4.0);
    }

    #[test]
    fn iterations_end_and_opposite_faces_of_a_wall_are_parted() {
        let (points, normals) = scene(6000);
        let tree = tree(&points);
        let cell = tree.edge(3);
        let run = |start, sides| {
            let params = KMeansParams { start, ..KMeansParams::default() };
            let oriented = OrientedPoints { points: &points, normals: &normals, sides };
            clusters(oriented, Seeds { tree: &tree, cell }, &params, &Monitor::default()).unwrap()
        };
        for start in [Start::Centroid, Start::Cube] {
            let signed = run(start, Sides::Signed);
            assert!((1..=10).contains(&signed.iterations));
            assert!(signed.iterations == 10 || signed.mean_move < 0.01 * cell);
            assert!(signed.of.iter().all(|&c| (c as usize) < tree.leaves.len()));
            let mixed = |of: &[u32]| {
                let mut faces = vec![[0u32; 2]; tree.leaves.len()];
                (0..6000).filter(|i| (1..3).contains(&(i % 4))).for_each(|i| faces[of[i] as usize][i % 4 - 1] += 1);
                faces.iter().map(|f| f[0].min(f[1])).sum::<u32>()
            };
            let before: Vec<u32> = {
                let mut labels = vec![0; 6000];
                tree.points
                    .groups()
                    .enumerate()
                    .for_each(|(l, g)| g.iter().for_each(|&i| labels[i as usize] = l as u32));
                labels
            };
            assert!(mixed(&signed.of) * 2 < mixed(&before), "{} {}", mixed(&signed.of), mixed(&before));
        }
    }

    #[test]
    fn unsigned_clusters_do_not_depend_on_the_sides_of_normals_at_first() {
        let (points, normals) = scene(2000);
        let tree = tree(&points);
        let turned: Vec<[f32; 3]> =
            normals.iter().enumerate().map(|(i, n)| if i % 3 == 0 { n.map(|c| -c) } else { *n }).collect();
        let params = KMeansParams::default();
        let run = |normals: &[[f32; 3]]| {
            let oriented = OrientedPoints { points: &points, normals, sides: Sides::Unsigned };
            clusters(oriented, Seeds { tree: &tree, cell: tree.edge(3) }, &params, &Monitor::default()).unwrap()
        };
        assert_eq!(run(&normals), run(&turned));
    }
}
