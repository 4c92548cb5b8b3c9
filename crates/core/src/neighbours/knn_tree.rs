//! A balanced k-d tree over points: leaves of a few points in a row, a tight box around every node.
//!
//! Bentley, *Multidimensional binary search trees used for associative searching*, CACM 18, 1975. Nodes are split in the
//! middle of their points along the longest edge of their box, by (coordinate, index): equal coordinates do no harm. Of many
//! points in one place only the first few are kept: no other can be among the k nearest of anything.

use crate::cloud::Points;
use crate::error::{Error, Result};

/// Points of a leaf at most (but for a leaf whose points all stand in one place).
pub(super) const LEAF: usize = 16;
/// Below this many points a subtree is built by one thread.
const ALONE: usize = 20_000;

/// A point while the tree is built.
#[derive(Clone, Copy, Debug)]
struct Item {
    place: [f32; 3],
    index: u32,
}

/// A node; its first child is the next node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Smallest coordinates of its points.
    pub(super) low: [f32; 3],
    /// Largest coordinates of its points.
    pub(super) high: [f32; 3],
    /// First of its points in the order of the tree.
    pub(super) first: u32,
    /// Points of a leaf that can be neighbours; 0 at an inner node.
    pub(super) count: u32,
    /// Second child of an inner node, counted from this node; for a leaf all of its points.
    pub(super) skip: u32,
}

/// The points in the order of the leaves (and [`LEAF`] places of padding), and the nodes in depth-first order.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    pub(super) z: Vec<f32>,
    /// Position of each in the points that the tree was built from.
    pub(super) index: Vec<u32>,
    len: usize,
    pub(super) nodes: Vec<Node>,
    /// The leaves among the nodes.
    pub(super) leaves: Vec<u32>,
}

impl Tree {
    /// A tree that finds up to `k` neighbours of its points. O(n log n).
    ///
    /// # Errors
    /// If a coordinate is not finite.
    pub(super) fn new(points: &Points, k: usize) -> Result<Self> {
        check(points)?;
        let axes = points.x.iter().zip(&points.y).zip(&points.z).enumerate();
        let mut items: Vec<Item> = axes.map(|(i, ((&x, &y), &z))| Item { place: [x, y, z], index: i as u32 }).collect();
        let kept = k.saturating_add(1);
        let nodes = if items.is_empty() { Vec::new() } else { build(&mut items, 0, kept) };
        let is_leaf = |&i: &u32| nodes.get(i as usize).is_some_and(|n| n.count > 0);
        let leaves = (0..nodes.len() as u32).filter(is_leaf).collect();
        let axis = |a: usize| items.iter().map(|i| i.place[a]).chain([f32::INFINITY; LEAF]).collect();
        Ok(Self {
            x: axis(0),
            y: axis(1),
            z: axis(2),
            index: items.iter().map(|i| i.index).chain([u32::MAX; LEAF]).collect(),
            len: items.len(),
            nodes,
            leaves,
        })
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The node of a leaf.
    #[inline(always)]
    pub(super) fn leaf(&self, leaf: usize) -> &Node {
        &self.nodes[self.leaves[leaf] as usize]
    }

    /// The positions, in the order of the tree, of all points of the leaves.
    pub(super) fn points_of(&self, leaves: std::ops::Range<usize>) -> std::ops::Range<usize> {
        let first = |leaf: usize| {
            self.leaves.get(leaf).and_then(|&n| self.nodes.get(n as usize)).map_or(self.len(), |n| n.first as usize)
        };
        first(leaves.start)..first(leaves.end)
    }

    /// A point of the tree by its position in the order of the tree.
    #[inline(always)]
    pub(super) fn place(&self, position: usize) -> [f32; 3] {
        [self.x[position], self.y[position], self.z[position]]
    }
}

impl Node {
    /// Whether all its points stand in one place.
    fn is_one_place(&self) -> bool {
        self.low.iter().zip(&self.high).all(|(low, high)| low >= high)
    }

    /// Lower bound of the squared distance to its points. Rounding is monotone: a bound above the computed distance of a
    /// point of the node cannot occur.
    #[inline(always)]
    pub(super) fn bound(&self, at: [f32; 3]) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|a| (self.low[a] - at[a]).max(at[a] - self.high[a]).max(0.0));
        x * x + y * y + z * z
    }

    /// Squared distance between the boxes.
    #[inline(always)]
    pub(super) fn gap(&self, other: &Self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|a| (self.low[a] - other.high[a]).max(other.low[a] - self.high[a]).max(0.0));
        x * x + y * y + z * z
    }
}

/// Whether there are as many coordinates on each axis and all are finite.
pub(super) fn check(points: &Points) -> Result<()> {
    let lengths = [points.y.len(), points.z.len()];
    if lengths != [points.x.len(); 2] || points.len() > (u32::MAX / 2) as usize {
        return Err(Error::input(format!(
            "{} x, {} y, {} z coordinates (allowed: as many each, at most 2^31)",
            points.x.len(),
            points.y.len(),
            points.z.len()
        )));
    }
    for (name, axis) in [("x", &points.x), ("y", &points.y), ("z", &points.z)] {
        if let Some(i) = axis.iter().position(|v| !v.is_finite()) {
            return Err(Error::input(format!("{name} of point {i} is {} (allowed: finite coordinates)", axis[i])));
        }
    }
    Ok(())
}

/// Orders the items leaf by leaf and returns the nodes of their subtree.
fn build(items: &mut [Item], first: usize, kept: usize) -> Vec<Node> {
    let mut nodes = Vec::new();
    if items.len() < ALONE {
        build_alone(items, first, kept, &mut nodes);
        return nodes;
    }
    let node = node(items, first);
    if is_leaf(items.len(), &node) {
        nodes.push(leaf(items, node, kept));
        return nodes;
    }
    let (left, right) = halve(items, &node);
    let middle = first + left.len();
    let (left, right) = rayon::join(|| build(left, first, kept), || build(right, middle, kept));
    nodes.push(Node { skip: 1 + left.len() as u32, ..node });
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

fn build_alone(items: &mut [Item], first: usize, kept: usize, nodes: &mut Vec<Node>) {
    let node = node(items, first);
    if is_leaf(items.len(), &node) {
        nodes.push(leaf(items, node, kept));
        return;
    }
    let (left, right) = halve(items, &node);
    let (parent, middle) = (nodes.len(), first + left.len());
    nodes.push(node);
    build_alone(left, first, kept, nodes);
    nodes[parent].skip = (nodes.len() - parent) as u32;
    build_alone(right, middle, kept, nodes);
}

fn node(items: &[Item], first: usize) -> Node {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for item in items {
        for a in 0..3 {
            low[a] = low[a].min(item.place[a]);
            high[a] = high[a].max(item.place[a]);
        }
    }
    Node { low, high, first: first as u32, count: 0, skip: 0 }
}

fn is_leaf(items: usize, node: &Node) -> bool {
    items <= LEAF || node.is_one_place()
}

fn leaf(items: &mut [Item], node: Node, kept: usize) -> Node {
    items.sort_unstable_by_key(|i| i.index);
    let count = if node.is_one_place() { items.len().min(kept) } else { items.len() };
    Node { count: count as u32, skip: items.len() as u32, ..node }
}

/// Parts the items in the middle along the longest edge of the box; the first part fills whole leaves.
fn halve<'a>(items: &'a mut [Item], node: &Node) -> (&'a mut [Item], &'a mut [Item]) {
    let edge = [0, 1, 2].map(|a| node.high[a] - node.low[a]);
    let axis = (1..3).fold(0, |best, a| if edge[a] > edge[best] { a } else { best });
    let middle = items.len().div_ceil(LEAF).div_ceil(2) * LEAF;
    let order = |a: &Item, b: &Item| a.place[axis].total_cmp(&b.place[axis]).then(a.index.cmp(&b.index));
    items.select_nth_unstable_by(middle, order);
    items.split_at_mut(middle)
}
