//! The leaves of a k-d tree that may hold neighbours of the queries of one leaf.

use super::build::Bounds;
use super::lanes::{LANES, Selection, append, bits};
use super::tree::{Tree, Wide, gaps};
use pulp::{Simd, bytemuck};

/// With more leaves than this no list is made: every query walks the tree by itself.
const MOST: usize = 512;

/// Leaves that may hold neighbours of a leaf's queries, and their bounding boxes axis by axis.
#[derive(Clone, Debug, Default)]
pub(super) struct List {
    leaf: Vec<u32>,
    /// Bit patterns of the lowest coordinates of the boxes, then of the highest.
    corners: [Vec<u32>; 6],
    len: usize,
    stack: Vec<u32>,
}

impl List {
    /// Lists the leaves whose squared distance from a box is at most `limit`; false if there are more than [`MOST`].
    #[inline(always)]
    pub(super) fn fill<S: Simd>(&mut self, simd: S, tree: &Tree, bounds: &Bounds, limit: f32) -> bool {
        self.len = 0;
        self.stack.resize(self.stack.len().max(1), 0);
        self.stack[0] = 0;
        let mut open = usize::from(!tree.nodes.is_empty());
        while open > 0 {
            open -= 1;
            let node = &tree.nodes[self.stack[open] as usize];
            let gaps = node.gaps(bounds);
            if node.holds_leaves {
                self.push(simd, node, &gaps, limit);
                if self.len > MOST {
                    return false;
                }
            } else {
                let near = Selection { values: &gaps, limit, column: &node.child };
                open += append(simd, near, &mut self.stack, open);
            }
        }
        self.pad();
        true
    }

    #[inline(always)]
    fn push<S: Simd>(&mut self, simd: S, node: &Wide, gaps: &[f32; LANES], limit: f32) {
        let of = |column| Selection { values: gaps, limit, column };
        let [x, y, z, u, v, w] = &mut self.corners;
        for (axis, table) in node.low.iter().zip([x, y, z]).chain(node.high.iter().zip([u, v, w])) {
            append(simd, of(bits(axis)), table, self.len);
        }
        self.len += append(simd, of(&node.child), &mut self.leaf, self.len);
    }

    /// Pads the list to whole vectors with boxes of NaN.
    #[inline(always)]
    fn pad(&mut self) {
        for table in &mut self.corners {
            if table.len() < self.len + LANES {
                table.resize(self.len + LANES, 0);
            }
            table[self.len..self.len + LANES].fill(f32::NAN.to_bits());
        }
        self.leaf.resize(self.leaf.len().max(self.len + LANES), 0);
    }

    /// Writes which of the leaves lie within the limit of a position; returns their number.
    #[inline(always)]
    pub(in crate::neighbours) fn within<S: Simd>(
        &self,
        simd: S,
        at: [f32; 3],
        limit: f32,
        found: &mut Vec<u32>,
    ) -> usize {
        let place = Bounds { low: at, high: at };
        let [x, y, z, u, v, w] = &self.corners;
        let [x, y, z, u, v, w] = [groups(x), groups(y), groups(z), groups(u), groups(v), groups(w)];
        let boxes = x.iter().zip(y).zip(z).zip(u).zip(v).zip(w);
        let mut count = 0;
        for (leaf, (((((x, y), z), u), v), w)) in
            self.leaf.as_chunks::<LANES>().0.iter().zip(boxes).take(self.len.div_ceil(LANES))
        {
            let gaps = gaps([x, y, z], [u, v, w], &place);
            count += append(simd, Selection { values: &gaps, limit, column: leaf }, found, count);
        }
        count
    }
}

/// Bit patterns of coordinates, 16 at a time.
#[inline(always)]
fn groups(table: &[u32]) -> &[[f32; LANES]] {
    bytemuck::cast_slice::<u32, f32>(table).as_chunks::<LANES>().0
}
