//! A k-d tree for SIMD: leaves of 16 points, nodes of up to 16 boxes.
//!
//! The binary nodes of [`super::build`] are collapsed over several levels until a node has 16 children, as I. Wald,
//! C. Benthin and S. Boulos do for rays (*Getting rid of packets*, IEEE Symposium on Interactive Ray Tracing 2008).

use super::build::{Bounds, Item, Node, build};
use super::lanes::{LANES, larger};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, watched};

/// The points of a leaf that can be neighbours, axis by axis, padded with NaN.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    pub(in crate::neighbours) x: [f32; LANES],
    pub(in crate::neighbours) y: [f32; LANES],
    pub(in crate::neighbours) z: [f32; LANES],
    /// Index of each point in the input.
    pub(in crate::neighbours) index: [u32; LANES],
}

/// The range of a leaf's points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) bounds: Bounds,
    /// Index of its first point in the order of the tree.
    first: u32,
    /// Number of points that can be neighbours.
    pub(in crate::neighbours) count: u32,
}

/// Up to 16 boxes, padded with NaN.
#[derive(Clone, Debug)]
pub(super) struct Wide {
    pub(super) low: [[f32; LANES]; 3],
    pub(super) high: [[f32; LANES]; 3],
    /// Child of each box: a leaf or a node.
    pub(super) child: [u32; LANES],
    pub(in crate::neighbours) count: usize,
    pub(super) holds_leaves: bool,
}

/// The points in the order of the leaves, and the nodes; the first node is the root.
#[derive(Clone, Debug, Default)]
pub(in crate::neighbours) struct Tree {
    /// Index of every point in the input.
    pub(in crate::neighbours) index: Vec<u32>,
    pub(super) chunks: Vec<Chunk>,
    pub(super) leaves: Vec<Leaf>,
    pub(super) nodes: Vec<Wide>,
}

impl Tree {
    /// Builds a tree that finds up to `k` neighbours of its points. O(n log n).
    ///
    /// # Errors
    /// If a coordinate is not finite, or the work was cancelled.
    pub(in crate::neighbours) fn new(points: &Positions, k: usize, monitor: &Monitor) -> Result<Self> {
        check(points)?;
        let axes = points.x.iter().zip(&points.y).zip(&points.z).enumerate();
        let mut items: Vec<Item> = axes.map(|(i, ((&x, &y), &z))| Item { place: [x, y, z], index: i as u32 }).collect();
        let nodes = build(&mut items, k.saturating_add(1), monitor);
        monitor.check()?;
        let mut tree = Self { index: items.iter().map(|i| i.index).collect(), ..Self::default() };
        let mut first = 0;
        for piece in watched(nodes.len(), monitor) {
            for node in nodes[piece?].iter().filter(|n| n.count > 0) {
                tree.leaves.push(Leaf { bounds: node.bounds, first, count: node.count });
                tree.chunks.push(Chunk::of(&items[first as usize..(first + node.count) as usize]));
                first += node.skip;
            }
        }
        if !nodes.is_empty() {
            let leaves = leaves_below(&nodes);
            Joining { nodes: &nodes, leaves: &leaves, wide: &mut tree.nodes }.join(Part { node: 0, first: 0 });
        }
        Ok(tree)
    }

    /// The range, in the order of the tree, of all points of the leaves.
    pub(super) fn points_of(&self, leaves: std::ops::Range<usize>) -> std::ops::Range<usize> {
        let first = |leaf: usize| self.leaves.get(leaf).map_or(self.index.len(), |leaf| leaf.first as usize);
        first(leaves.start)..first(leaves.end)
    }
}

impl Chunk {
    fn of(items: &[Item]) -> Self {
        let nowhere = [f32::NAN; LANES];
        let mut chunk = Self { x: nowhere, y: nowhere, z: nowhere, index: [u32::MAX; LANES] };
        for (l, item) in items.iter().enumerate().take(LANES) {
            [chunk.x[l], chunk.y[l], chunk.z[l]] = item.place;
            chunk.index[l] = item.index;
        }
        chunk
    }

    #[inline(always)]
    pub(in crate::neighbours) fn place(&self, lane: usize) -> [f32; 3] {
        [self.x[lane], self.y[lane], self.z[lane]]
    }
}

impl Wide {
    /// Squared distance of each box to a box. Rounding is monotone, so that it is never above the computed distance of
    /// a point in the box.
    #[inline(always)]
    pub(super) fn gaps(&self, other: &Bounds) -> [f32; LANES] {
        gaps([&self.low[0], &self.low[1], &self.low[2]], [&self.high[0], &self.high[1], &self.high[2]], other)
    }
}

/// Squared distance of 16 boxes to a box; NaN for padding.
#[inline(always)]
pub(super) fn gaps(low: [&[f32; LANES]; 3], high: [&[f32; LANES]; 3], other: &Bounds) -> [f32; LANES] {
    let mut sum = [0.0; LANES];
    for a in 0..3 {
        for l in 0..LANES {
            let apart = larger(larger(low[a][l] - other.high[a], other.low[a] - high[a][l]), 0.0);
            sum[l] += apart * apart;
        }
    }
    sum
}

/// Number of leaves below each node.
fn leaves_below(nodes: &[Node]) -> Vec<u32> {
    let mut leaves = vec![1; nodes.len()];
    for (n, node) in nodes.iter().enumerate().rev().filter(|(_, node)| node.count == 0) {
        leaves[n] = leaves[n + 1] + leaves[n + node.skip as usize];
    }
    leaves
}

/// A binary node and the first leaf below it.
#[derive(Clone, Copy, Debug)]
struct Part {
    node: usize,
    first: u32,
}

/// Conversion of binary nodes to nodes of 16 children.
struct Joining<'a> {
    nodes: &'a [Node],
    leaves: &'a [u32],
    wide: &'a mut Vec<Wide>,
}

impl Joining<'_> {
    /// Converts what is below a node; returns the new node.
    fn join(&mut self, part: Part) -> u32 {
        let node = part.node;
        let holds_leaves = self.leaves[node] <= LANES as u32;
        // All nodes but the upper ones are filled.
        let mut most = 1;
        while !holds_leaves && most * (LANES as u32) < self.leaves[node] {
            most *= LANES as u32;
        }
        let parts = self.divide(part, most);
        let nowhere = [[f32::NAN; LANES]; 3];
        let (low, high, child) = (nowhere, nowhere, [0; LANES]);
        let id = self.wide.len();
        self.wide.push(Wide { low, high, child, count: parts.len(), holds_leaves });
        for (l, part) in parts.into_iter().enumerate() {
            let child = if holds_leaves { part.first } else { self.join(part) };
            let (wide, bounds) = (&mut self.wide[id], self.nodes[part.node].bounds);
            wide.child[l] = child;
            for a in 0..3 {
                (wide.low[a][l], wide.high[a][l]) = (bounds.low[a], bounds.high[a]);
            }
        }
        id as u32
    }

    /// Up to 16 nodes below one, of at most `most` leaves each if possible.
    fn divide(&self, root: Part, most: u32) -> Vec<Part> {
        let mut parts = vec![root];
        while parts.len() < LANES {
            let large = |&p: &usize| (self.leaves[parts[p].node], std::cmp::Reverse(p));
            let Some(p) = (0..parts.len()).max_by_key(large) else { break };
            let Part { node, first } = parts[p];
            if self.leaves[node] <= most {
                break;
            }
            let second = node + self.nodes[node].skip as usize;
            parts[p] = Part { node: node + 1, first };
            parts.insert(p + 1, Part { node: second, first: first + self.leaves[node + 1] });
        }
        parts
    }
}

/// Checks that all axes have the same length and all coordinates are finite.
pub(in crate::neighbours) fn check(points: &Positions) -> Result<()> {
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
