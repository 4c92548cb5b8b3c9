//! Builds the octree from sorted Morton codes: a cell is a run of points with equal leading bits, inner nodes are not
//! stored.

use super::OctreeParams;
use crate::cloud::Positions;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::linalg::Moments;
use crate::linalg::closed_form::eigenvalues;
use crate::parallel::{Monitor, map_ordered, map_watched, sort_watched};
use crate::segmentation::Partition;
use crate::voxels::morton;
use std::ops::Range;

/// Least number of points of a task.
const TASK: usize = 4096;

/// A cube of the octree, in the local coordinates of the points (metres).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cube {
    /// Smallest corner.
    pub low: [f64; 3],
    /// Edge, ≥ 0.
    pub edge: f64,
}

/// A leaf: a cell that is not divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// Depth below the root, which has depth 0.
    pub depth: u32,
    /// Indices of the cell within its depth, each below 2^depth.
    pub cell: [u32; 3],
}

/// The leaves of an octree that hold points, in Morton order.
#[derive(Clone, Debug, PartialEq)]
pub struct Octree {
    /// The cube that holds all points.
    pub root: Cube,
    /// The leaves.
    pub leaves: Vec<Leaf>,
    /// The points of each leaf; concatenated, these are all points in Morton order (ties by index).
    pub points: Csr,
}

impl Cube {
    /// The smallest cube that holds all points and shares the smallest corner of their bounding box.
    pub fn around(points: &Positions) -> Self {
        let ends = |axis: &[f32]| {
            let (low, high) = axis.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
            (f64::from(low), f64::from(high))
        };
        if points.is_empty() {
            return Self::default();
        }
        let axes = [ends(&points.x), ends(&points.y), ends(&points.z)];
        Self { low: axes.map(|a| a.0), edge: axes.iter().fold(0.0, |m: f64, a| m.max(a.1 - a.0)) }
    }

    /// Cell of a position at a depth; positions outside are assigned to the outermost cells.
    #[inline(always)]
    fn cell(&self, at: [f32; 3], depth: u32) -> [u32; 3] {
        let cells = f64::from(1u32 << depth);
        let per_metre = if self.edge > 0.0 { cells / self.edge } else { 0.0 };
        [0, 1, 2].map(|a| ((f64::from(at[a]) - self.low[a]) * per_metre).clamp(0.0, cells - 1.0) as u32)
    }
}

impl Octree {
    /// Edge of the cells of a depth, metres.
    pub fn edge(&self, depth: u32) -> f64 {
        self.root.edge / f64::from(1u32 << depth.min(31))
    }

    /// Centre of a leaf, metres, in the local coordinates of the points.
    pub fn centre(&self, leaf: &Leaf) -> [f64; 3] {
        let edge = self.edge(leaf.depth);
        [0, 1, 2].map(|a| self.root.low[a] + (f64::from(leaf.cell[a]) + 0.5) * edge)
    }

    /// The leaves as segments of the points, and the leaf of each segment.
    ///
    /// # Errors
    /// Never for an octree that [`octree`] has made.
    pub fn partition(&self) -> Result<(Partition, Vec<Leaf>)> {
        let mut labels = vec![0u32; self.points.items().len()];
        for (leaf, members) in self.points.groups().enumerate() {
            members.iter().for_each(|&i| labels[i as usize] = leaf as u32);
        }
        let partition = Partition::from_labels(&labels)?;
        let first = partition.iter().filter_map(|members| members.first());
        let leaves = first.map(|&i| self.leaves[labels[i as usize] as usize]).collect();
        Ok((partition, leaves))
    }
}

/// Divides the cube around the points until the cells are flat, hold few points, or are of the greatest depth.
///
/// All cells above the least depth are divided; from there on a cell becomes a leaf if it has fewer than `min_points`
/// points, if its points fulfil the stop rule, or at the greatest depth. Empty cells are not stored. The leaves are the
/// same for any number of threads. O(n log n) for sorting, then O(n) a level; 28 temporary bytes a point.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, parallel::Monitor, segmentation::{OctreeParams, octree}};
/// # fn main() -> scansion_core::Result<()> {
/// let rows: Vec<[f64; 3]> = (0..1024).map(|i| [f64::from(i % 32), f64::from(i / 32), 0.0]).collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0).positions;
/// let params = OctreeParams { min_depth: 3, ..OctreeParams::default() };
/// let tree = octree(&points, &params, &Monitor::default())?;
/// assert_eq!((tree.leaves.len(), tree.points.group(0).len()), (64, 16));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// If a parameter is outside its range, a coordinate is not finite, or the work was cancelled.
pub fn octree(points: &Positions, params: &OctreeParams, monitor: &Monitor) -> Result<Octree> {
    params.validate()?;
    let root = Cube::around(points);
    if !(root.edge.is_finite() && root.low.iter().all(|v| v.is_finite())) || not_finite(points) {
        return Err(Error::input("a coordinate is not finite (allowed: finite coordinates)"));
    }
    let deepest = params.max_depth();
    let code = |i: usize| morton::encode(root.cell(points.xyz(i), deepest));
    let mut keys: Vec<(u64, u32)> = map_watched(points.len(), monitor, |i| (code(i), i as u32))?;
    sort_watched(&mut keys, monitor)?;
    let division = Division { points, params, keys: &keys, monitor };
    let tasks = division.tasks();
    let parts = map_ordered(tasks.len(), monitor, |t| {
        let mut leaves = Vec::new();
        for cell in division.cells(tasks[t].clone(), params.min_depth) {
            division.descend(cell, params.min_depth, &mut leaves)?;
        }
        Ok(leaves)
    })?;
    let mut offsets = vec![0];
    offsets.extend(parts.iter().flatten().map(|&(end, _)| end as u32));
    let leaves = parts.into_iter().flatten().map(|(_, leaf)| leaf).collect();
    let order = map_watched(keys.len(), monitor, |i| keys[i].1)?;
    drop(keys);
    Ok(Octree { root, leaves, points: Csr::new(offsets, order, points.len())? })
}

fn not_finite(points: &Positions) -> bool {
    [&points.x, &points.y, &points.z].iter().any(|axis| axis.iter().any(|v| !v.is_finite()))
}

/// The points in Morton order while their cells are divided.
struct Division<'a> {
    points: &'a Positions,
    params: &'a OctreeParams,
    /// (Morton code at the greatest depth, index), ascending.
    keys: &'a [(u64, u32)],
    monitor: &'a Monitor,
}

impl Division<'_> {
    /// Runs of whole cells of the least depth, each of at least [`TASK`] points.
    fn tasks(&self) -> Vec<Range<usize>> {
        let mut tasks: Vec<Range<usize>> = Vec::new();
        for cell in self.cells(0..self.keys.len(), self.params.min_depth) {
            match tasks.last_mut().filter(|task| task.len() < TASK) {
                Some(task) => task.end = cell.end,
                None => tasks.push(cell),
            }
        }
        tasks
    }

    /// The cells of a depth within a range, as runs of points.
    fn cells(&self, range: Range<usize>, depth: u32) -> impl Iterator<Item = Range<usize>> {
        let shift = 3 * (self.params.max_depth() - depth);
        let mut start = range.start;
        std::iter::from_fn(move || {
            let rest = self.keys.get(start..range.end).filter(|rest| !rest.is_empty())?;
            let code = rest[0].0 >> shift;
            let cell = start..start + run(rest, |key| key.0 >> shift == code);
            start = cell.end;
            Some(cell)
        })
    }

    /// Appends the leaves below a cell, each with the end of its points.
    fn descend(&self, cell: Range<usize>, depth: u32, leaves: &mut Vec<(usize, Leaf)>) -> Result<()> {
        if cell.len() > TASK {
            self.monitor.check()?;
        }
        if self.is_leaf(&cell, depth) {
            let code = self.keys[cell.start].0 >> (3 * (self.params.max_depth() - depth));
            leaves.push((cell.end, Leaf { depth, cell: morton::decode(code) }));
            return Ok(());
        }
        for child in self.cells(cell, depth + 1) {
            self.descend(child, depth + 1, leaves)?;
        }
        Ok(())
    }

    fn is_leaf(&self, cell: &Range<usize>, depth: u32) -> bool {
        if depth >= self.params.max_depth() || cell.len() < self.params.min_points as usize {
            return true;
        }
        let place = |i: u32| [&self.points.x, &self.points.y, &self.points.z].map(|axis| f64::from(axis[i as usize]));
        let base = place(self.keys[cell.start].1);
        let mut moments = Moments::default();
        for &(_, i) in &self.keys[cell.clone()] {
            let p = place(i);
            moments.add([p[0] - base[0], p[1] - base[1], p[2] - base[2]]);
        }
        self.params.stop.passes(eigenvalues(&moments.covariance()))
    }
}

/// Length of the leading run for which `inside` holds, by exponential and then binary search.
fn run<T>(items: &[T], inside: impl Fn(&T) -> bool) -> usize {
    let mut step = 1;
    while step < items.len() && inside(&items[step]) {
        step *= 2;
    }
    let (known, end) = (step / 2, step.min(items.len()));
    known + items[known..end].partition_point(inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;
    use crate::segmentation::StopRule;

    fn from_rows(rows: &[[f64; 3]]) -> Positions {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
    }

    /// A floor, a wall and a ball of foliage; coordinates are multiples of 2^-8 m.
    fn scene(count: usize) -> Vec<[f64; 3]> {
        let mut random = stream(7, 1);
        (0..count)
            .map(|i| {
                let [a, b, c] = [0; 3].map(|_| random.uniform());
                match i % 3 {
                    0 => [8.0 * a, 8.0 * b, 0.02 * c],
                    1 => [8.0 * a, 0.02 * c, 4.0 * b],
                    _ => [5.0 + 2.0 * a, 5.0 + 2.0 * b, 2.0 + 2.0 * c],
                }
            })
            .map(|p| p.map(|v| (v * 256.0).round() / 256.0))
            .collect()
    }

    fn params(stop: StopRule) -> OctreeParams {
        OctreeParams { min_depth: 3, extra_depth: 4, min_points: 12, stop }
    }

    /// λ of the points inside a cell, computed directly.
    fn values(points: &Positions, members: &[u32]) -> [f64; 3] {
        let axes = [&points.x, &points.y, &points.z];
        let rows: Vec<[f64; 3]> = members.iter().map(|&i| axes.map(|axis| f64::from(axis[i as usize]))).collect();
        let centre = crate::linalg::mean(&rows);
        crate::linalg::Sym3::scatter(&rows, centre, rows.len() as f64).eigen().values
    }

    #[test]
    fn leaves_partition_the_points_and_obey_a_rule_that_their_parents_do_not() {
        let points = from_rows(&scene(4000));
        for stop in [StopRule::Absolute(0.003), StopRule::Sigma(0.03), StopRule::Flat(0.03)] {
            let params = params(stop);
            let tree = octree(&points, &params, &Monitor::default()).unwrap();
            let mut seen = tree.points.items().to_vec();
            seen.sort_unstable();
            assert!(seen.into_iter().eq(0..4000));
            let inside = |leaf: &Leaf, depth: u32| -> Vec<u32> {
                let cell = leaf.cell.map(|c| c >> (leaf.depth - depth));
                let here = |&i: &u32| {
                    let at = points.xyz(i as usize);
                    tree.root.cell(at, depth) == cell
                };
                (0..4000).filter(here).collect()
            };
            let stops =
                |members: &[u32], depth| depth == 7 || members.len() < 12 || stop.passes(values(&points, members));
            for (leaf, members) in tree.leaves.iter().zip(tree.points.groups()) {
                let mut members = members.to_vec();
                members.sort_unstable();
                assert_eq!(members, inside(leaf, leaf.depth));
                assert!(leaf.depth >= 3 && stops(&members, leaf.depth), "{leaf:?}");
                if leaf.depth > 3 {
                    assert!(!stops(&inside(leaf, leaf.depth - 1), leaf.depth - 1), "parent of {leaf:?}");
                }
            }
            let depths = (3..8).filter(|&depth| tree.leaves.iter().any(|leaf| leaf.depth == depth));
            assert!(depths.count() >= 3, "{stop:?}");
        }
    }

    #[test]
    fn segments_know_their_leaf_and_leaves_their_centre() {
        let points = from_rows(&scene(1000));
        let tree = octree(&points, &params(StopRule::Sigma(0.05)), &Monitor::default()).unwrap();
        let (partition, leaves) = tree.partition().unwrap();
        assert_eq!((partition.len(), partition.nodes()), (tree.leaves.len(), 1000));
        for (members, leaf) in partition.iter().zip(&leaves) {
            let (centre, half) = (tree.centre(leaf), tree.edge(leaf.depth) / 2.0 + 1e-9);
            for &i in members {
                let at = points.xyz(i as usize).map(f64::from);
                assert!((0..3).all(|a| (at[a] - centre[a]).abs() <= half));
            }
        }
    }

    #[test]
    fn moving_the_cloud_or_scaling_it_with_the_threshold_changes_nothing() {
        let rows = scene(3000);
        let tree = |points: &Positions, stop| octree(points, &params(stop), &Monitor::default()).unwrap();
        let here = tree(&from_rows(&rows), StopRule::Absolute(0.002));
        let mut moved = from_rows(&rows);
        [&mut moved.x, &mut moved.y, &mut moved.z]
            .into_iter()
            .for_each(|axis| axis.iter_mut().for_each(|v| *v += 64.0));
        let there = tree(&moved, StopRule::Absolute(0.002));
        assert_eq!((&here.leaves, &here.points), (&there.leaves, &there.points));
        let large = from_rows(&rows.iter().map(|p| p.map(|v| 4.0 * v)).collect::<Vec<_>>());
        let scaled = tree(&large, StopRule::Absolute(0.002 * 16.0));
        assert_eq!((&here.leaves, &here.points), (&scaled.leaves, &scaled.points));
        let sigma = tree(&large, StopRule::Sigma((0.002f64 * 16.0).sqrt()));
        assert_eq!(here.leaves, sigma.leaves);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_tree() {
        let points = from_rows(&scene(30_000));
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| octree(&points, &params(StopRule::Flat(0.02)), &Monitor::default()).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn few_points_and_equal_points_are_fine_and_nonsense_is_refused() {
        let run = |points: &Positions| octree(points, &OctreeParams::default(), &Monitor::default());
        let none = run(&Positions::default()).unwrap();
        assert!(none.leaves.is_empty() && none.partition().unwrap().0.is_empty());
        let same = run(&from_rows(&[[3.0, 2.0, 1.0]; 40])).unwrap();
        assert_eq!((same.leaves.len(), same.points.group(0).len()), (1, 40));
        let mut broken = from_rows(&[[0.0; 3], [1.0; 3]]);
        broken.y[1] = f32::NAN;
        assert!(run(&broken).is_err());
        let cancelled = Monitor::default();
        cancelled.cancel();
        assert!(octree(&from_rows(&scene(9)), &OctreeParams::default(), &cancelled).is_err());
    }
}
