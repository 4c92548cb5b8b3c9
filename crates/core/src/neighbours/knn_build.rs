//! The points of a k-d tree in the order of its leaves, and its nodes.
//!
//! Bentley, *Multidimensional binary search trees used for associative searching*, CACM 18, 1975. Nodes are split in the
//! middle of their points along the longest edge of their box, by (coordinate, index): equal coordinates do no harm. Of many
//! points in one place only the first few are kept: no other can be among the k nearest of anything.

use super::knn_lanes::LANES;
use crate::parallel::Monitor;

/// Below this many points a subtree is built by one thread.
const ALONE: usize = 20_000;

/// A point while the tree is built.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) place: [f32; 3],
    pub(super) index: u32,
}

impl Item {
    /// Ascends by (coordinate, index).
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
    /// Points of a leaf that can be neighbours, at most [`LANES`]; 0 at an inner node.
    pub(super) count: u32,
    /// Second child of an inner node, counted from this node; for a leaf all of its points.
    pub(super) skip: u32,
}

/// Orders the items leaf by leaf and returns the nodes in depth-first order. Of items in one place `kept` can be neighbours.
/// Once the work is cancelled the nodes are of no use.
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
        build_place(items, (bounds, kept), &mut nodes);
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
        build_place(items, (bounds, kept), nodes);
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

/// The subtree of points in one place; those that are not kept belong to its last leaf.
fn build_place(items: &mut [Item], (bounds, kept): (Bounds, usize), nodes: &mut Vec<Node>) {
    items.sort_unstable_by_key(|i| i.index);
    divide_place((items.len(), kept.min(items.len())), bounds, nodes);
}

fn divide_place((all, kept): (usize, usize), bounds: Bounds, nodes: &mut Vec<Node>) {
    if kept <= LANES {
        nodes.push(Node { bounds, count: kept as u32, skip: all as u32 });
        return;
    }
    let middle = kept.div_ceil(LANES).div_ceil(2) * LANES;
    let parent = nodes.len();
    nodes.push(Node { bounds, count: 0, skip: 0 });
    divide_place((middle, middle), bounds, nodes);
    nodes[parent].skip = (nodes.len() - parent) as u32;
    divide_place((all - middle, kept - middle), bounds, nodes);
}

/// Parts the items in the middle along the longest edge of the box; the first part fills whole leaves.
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
