//! Construction of a k-d tree: the points in the order of its leaves, and its nodes.
//!
//! J. L. Bentley, *Multidimensional binary search trees used for associative searching*, CACM 18, 1975. Nodes are split
//! at the median along the longest edge of their bounding box, by (coordinate, index), so that equal coordinates are no
//! problem. Of many coincident points only the first few are kept: no other can be among the k nearest of any point.

use super::lanes::LANES;
use crate::parallel::Monitor;

/// Subtrees of fewer points are built by a single thread.
const ALONE: usize = 20_000;

/// A point during the construction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) place: [f32; 3],
    pub(super) index: u32,
}

impl Item {
    /// Order by (coordinate, index).
    #[inline(always)]
    fn key(&self, axis: usize) -> u64 {
        let bits = self.place[axis].to_bits();
        let ordered = bits ^ (((bits as i32 >> 31) as u32) | 1 << 31);
        u64::from(ordered) << 32 | u64::from(self.index)
    }
}

/// A box around points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: [f32; 3],
    pub(super) high: [f32; 3],
}

impl Bounds {
    fn around(items: &[Item]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for item in items {
            for ((low, high), &v) in low.iter_mut().zip(&mut high).zip(&item.place) {
                *low = if v < *low { v } else { *low };
                *high = if v > *high { v } else { *high };
            }
        }
        Self { low, high }
    }

    fn is_one_place(&self) -> bool {
        self.low.iter().zip(&self.high).all(|(low, high)| low >= high)
    }

    fn longest(&self) -> usize {
        let edge = [0, 1, 2].map(|a| self.high[a] - self.low[a]);
        (1..3).fold(0, |best, a| if edge[a] > edge[best] { a } else { best })
    }
}

/// A node; its first child is the next node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) bounds: Bounds,
    /// Number of points of a leaf that can be neighbours, at most [`LANES`]; 0 for an inner node.
    pub(super) count: u32,
    /// Offset to the second child of an inner node; for a leaf the number of all of its points.
    pub(super) skip: u32,
}

/// Sorts the items leaf by leaf and returns the nodes in depth-first order. Of coincident items only `kept` can be
/// neighbours. After cancellation the nodes must not be used.
pub(super) fn build(items: &mut [Item], kept: usize, monitor: &Monitor) -> Vec<Node> {
    let mut nodes = Vec::new();
    if monitor.is_cancelled() {
        return nodes;
    }
    if items.len() < ALONE {
        if !items.is_empty() {
            build_alone(items, kept, &mut nodes);
        }
        return nodes;
    }
    let bounds = Bounds::around(items);
    if bounds.is_one_place() {
        build_place(items, bounds, kept, &mut nodes);
        return nodes;
    }
    let (left, right) = halve(items, &bounds);
    let (left, right) = rayon::join(|| build(left, kept, monitor), || build(right, kept, monitor));
    nodes.push(Node { bounds, count: 0, skip: 1 + left.len() as u32 });
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

fn build_alone(items: &mut [Item], kept: usize, nodes: &mut Vec<Node>) {
    let bounds = Bounds::around(items);
    if bounds.is_one_place() {
        build_place(items, bounds, kept, nodes);
        return;
    }
    if items.len() <= LANES {
        nodes.push(Node { bounds, count: items.len() as u32, skip: items.len() as u32 });
        return;
    }
    let (left, right) = halve(items, &bounds);
    let parent = nodes.len();
    nodes.push(Node { bounds, count: 0, skip: 0 });
    build_alone(left, kept, nodes);
    nodes[parent].skip = (nodes.len() - parent) as u32;
    build_alone(right, kept, nodes);
}

/// The subtree of coincident points; those that are not kept belong to its last leaf.
fn build_place(items: &mut [Item], bounds: Bounds, kept: usize, nodes: &mut Vec<Node>) {
    items.sort_unstable_by_key(|i| i.index);
    Pile { all: items.len(), kept: kept.min(items.len()) }.divide(bounds, nodes);
}

/// Numbers of coincident points: of all, and of those that can be neighbours.
#[derive(Clone, Copy, Debug)]
struct Pile {
    all: usize,
    kept: usize,
}

impl Pile {
    fn divide(self, bounds: Bounds, nodes: &mut Vec<Node>) {
        let Self { all, kept } = self;
        if kept <= LANES {
            nodes.push(Node { bounds, count: kept as u32, skip: all as u32 });
            return;
        }
        let middle = kept.div_ceil(LANES).div_ceil(2) * LANES;
        let parent = nodes.len();
        nodes.push(Node { bounds, count: 0, skip: 0 });
        Self { all: middle, kept: middle }.divide(bounds, nodes);
        nodes[parent].skip = (nodes.len() - parent) as u32;
        Self { all: all - middle, kept: kept - middle }.divide(bounds, nodes);
    }
}

/// Splits the items at the median along the longest edge of the box; the first half fills whole leaves.
fn halve<'a>(items: &'a mut [Item], bounds: &Bounds) -> (&'a mut [Item], &'a mut [Item]) {
    let axis = bounds.longest();
    let middle = items.len().div_ceil(LANES).div_ceil(2) * LANES;
    match axis {
        0 => items.select_nth_unstable_by_key(middle, |i| i.key(0)),
        1 => items.select_nth_unstable_by_key(middle, |i| i.key(1)),
        _ => items.select_nth_unstable_by_key(middle, |i| i.key(2)),
    };
    items.split_at_mut(middle)
}
