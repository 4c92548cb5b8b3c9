//! The leaves of an octree as plane patches, and their adjacency.

use crate::cloud::Positions;
use crate::error::Result;
use crate::linalg::{Moments, Sym3};
use crate::parallel::{Monitor, concat_watched, map_ordered, map_watched, sort_watched};
use crate::segmentation::{Leaf, Octree};
use crate::voxels::morton;

/// Leaves that one task describes.
const BLOCK: usize = 256;

/// A plane through the points of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Patch {
    /// Mean of the points, metres.
    pub(super) centre: [f64; 3],
    /// Unit normal.
    pub(super) normal: [f64; 3],
    /// √λ3, the root mean square distance of the points from the plane, metres; infinite for fewer points than asked.
    pub(super) residual: f64,
}

impl Patch {
    /// Distance of a position from the plane, metres.
    pub(super) fn distance(&self, at: [f64; 3]) -> f64 {
        (0..3).map(|a| (at[a] - self.centre[a]) * self.normal[a]).sum::<f64>().abs()
    }
}

/// The patch of each leaf with at least `min_points` points. O(n).
pub(super) fn patches(points: &Positions, tree: &Octree, min_points: u32, monitor: &Monitor) -> Result<Vec<Patch>> {
    let count = tree.leaves.len();
    let parts = map_ordered(count.div_ceil(BLOCK), monitor, |block| {
        let leaves = block * BLOCK..((block + 1) * BLOCK).min(count);
        Ok(leaves.map(|l| patch(points, tree.points.group(l), min_points)).collect::<Vec<_>>())
    })?;
    concat_watched(parts, monitor)
}

fn patch(points: &Positions, members: &[u32], min_points: u32) -> Patch {
    if members.len() < min_points as usize {
        return Patch { residual: f64::INFINITY, ..Patch::default() };
    }
    let base = place(points, members[0]);
    let mut moments = Moments::default();
    for &i in members {
        let at = place(points, i);
        moments.add([at[0] - base[0], at[1] - base[1], at[2] - base[2]]);
    }
    let mean = moments.mean();
    let solved = Sym3::eigen(&moments.covariance());
    Patch { centre: [0, 1, 2].map(|a| base[a] + mean[a]), normal: solved.vectors[2], residual: solved.values[2].sqrt() }
}

/// Position of a point, metres.
pub(super) fn place(points: &Positions, i: u32) -> [f64; 3] {
    [&points.x, &points.y, &points.z].map(|axis| f64::from(axis[i as usize]))
}

/// The leaves that touch each leaf, at faces, edges or corners, ascending. O(m log m).
pub(super) struct Touching {
    offsets: Vec<usize>,
    others: Vec<u32>,
}

impl Touching {
    /// Each leaf searches the 26 cells around it for leaves of its own size or larger.
    pub(super) fn new(tree: &Octree, monitor: &Monitor) -> Result<Self> {
        let deepest = tree.leaves.iter().map(|l| l.depth).max().unwrap_or(0);
        let starts: Vec<u64> =
            tree.leaves.iter().map(|l| morton::encode(l.cell) << (3 * (deepest - l.depth))).collect();
        let codes = LeafCodes { tree, starts: &starts, deepest };
        let parts = map_ordered(starts.len().div_ceil(BLOCK), monitor, |block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(starts.len());
            let mut pairs = Vec::new();
            for l in range {
                codes.around(l, |other| {
                    pairs.extend([[l as u32, other], [other, l as u32]]);
                });
            }
            Ok(pairs)
        })?;
        let mut pairs: Vec<[u32; 2]> = concat_watched(parts, monitor)?;
        sort_watched(&mut pairs, monitor)?;
        pairs.dedup();
        let offset = |l: usize| pairs.partition_point(|p| (p[0] as usize) < l);
        let offsets = map_watched(starts.len() + 1, monitor, offset)?;
        Ok(Self { offsets, others: map_watched(pairs.len(), monitor, |i| pairs[i][1])? })
    }

    /// The leaves that touch a leaf.
    pub(super) fn of(&self, leaf: usize) -> &[u32] {
        &self.others[self.offsets[leaf]..self.offsets[leaf + 1]]
    }
}

/// The leaves of an octree by the Morton codes of their first cells on the deepest level.
struct LeafCodes<'a> {
    tree: &'a Octree,
    starts: &'a [u64],
    deepest: u32,
}

impl LeafCodes<'_> {
    /// Calls `found` for the leaves around leaf `l` that are at least as large.
    fn around(&self, l: usize, mut found: impl FnMut(u32)) {
        let Self { tree, starts, deepest } = *self;
        let Leaf { depth, cell } = tree.leaves[l];
        for step in (0..27).filter(|&s| s != 13) {
            let moved = |c: u32, by: u32| (c + by).checked_sub(1).filter(|&c| c < 1 << depth);
            let [Some(x), Some(y), Some(z)] =
                [(0, step % 3), (1, step / 3 % 3), (2, step / 9)].map(|(a, by)| moved(cell[a], by))
            else {
                continue;
            };
            let code = morton::encode([x, y, z]) << (3 * (deepest - depth));
            let Some(other) = starts.partition_point(|&s| s <= code).checked_sub(1) else { continue };
            let size = tree.leaves[other].depth;
            if size <= depth && other != l && code >> (3 * (deepest - size)) == starts[other] >> (3 * (deepest - size))
            {
                found(other as u32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::segmentation::{OctreeParams, StopRule, octree};

    fn scene(count: usize) -> Positions {
        let mut random = stream(1, 4);
        let mut points = Positions::default();
        for i in 0..count {
            let [a, b, c] = [0; 3].map(|_| random.uniform() as f32);
            let at = if i % 2 == 0 { [4.0 * a, 4.0 * b, 0.25 * a] } else { [3.0 + a, 3.0 + b, 1.0 + c] };
            points.push(at);
        }
        points
    }

    fn tree(points: &Positions) -> Octree {
        let params = OctreeParams { min_depth: 1, extra_depth: 3, min_points: 8, stop: StopRule::Sigma(0.05) };
        octree(points, &params, &Monitor::default()).unwrap()
    }

    #[test]
    fn leaves_touch_if_their_cubes_do() {
        let tree = tree(&scene(900));
        let touching = Touching::new(&tree, &Monitor::default()).unwrap();
        let ends = |leaf: &Leaf, a: usize| {
            let edge = 16 >> leaf.depth;
            (leaf.cell[a] * edge, (leaf.cell[a] + 1) * edge)
        };
        assert!((1..5).filter(|&d| tree.leaves.iter().any(|l| l.depth == d)).count() >= 3);
        for (l, leaf) in tree.leaves.iter().enumerate() {
            let meets = |other: &Leaf| {
                (0..3).all(|a| {
                    let ((low, high), (from, to)) = (ends(leaf, a), ends(other, a));
                    low <= to && from <= high
                })
            };
            let expected: Vec<u32> =
                (0..tree.leaves.len()).filter(|&o| o != l && meets(&tree.leaves[o])).map(|o| o as u32).collect();
            assert_eq!(touching.of(l), expected, "leaf {l}");
        }
    }

    #[test]
    fn patches_are_planes_with_their_residual() {
        let mut points = Positions::default();
        for (x, y, d) in [(0.0, 0.0, 1.0), (2.0, 0.0, -1.0), (2.0, 2.0, 1.0), (0.0, 2.0, -1.0)] {
            points.push([x, y, x + 0.1 * d]);
        }
        let found = patch(&points, &[0, 1, 2, 3], 3);
        let root = 0.5f64.sqrt();
        assert!((found.normal[0].abs() - root).abs() < 0.02 && (found.normal[2].abs() - root).abs() < 0.02);
        assert!((found.residual - 0.1 * root).abs() < 0.01, "{}", found.residual);
        assert!(found.distance(found.centre) < 1e-12);
        assert!(patch(&points, &[0, 1, 2, 3], 5).residual.is_infinite());
    }
}
