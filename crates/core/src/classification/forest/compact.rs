//! Trees in half the memory, and prediction of blocks of rows with them.
//!
//! A node takes 4 bytes and stores the offset to its children. Every index within a piece of a tree fits into 16 bits,
//! and every index within a row of codes into 8, so that no bounds check is needed during the descent.

use crate::classification::nodes::{LEAF_CUT, Node, Trees};
use crate::classification::quantise::{CodeBlock, ROW};
use std::ops::Range;

/// Largest number of nodes of a piece.
pub(in crate::classification) const WINDOW: usize = 1 << 16;

/// Flag: the number is not a row of probabilities but the piece in which the descent continues.
const ONWARD: u32 = 1 << 31;

/// Levels that a row descends before the next row is processed, so that the processor works on several rows at once.
const LEVELS: usize = 3;

/// Rows that descend a tree together; their codes stay in the first-level cache.
const TOGETHER: usize = 256;

/// Nodes in a cache line.
const LINE: usize = 16;

/// Samples with a code above `cut` move `offset + 1` nodes ahead, others `offset`. A leaf has offset 0 and cut 255,
/// which no code exceeds: rows stay there. Its `feature` is its row of probabilities; 255 if that is stored in
/// [`Compact::rows`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Step {
    offset: u16,
    feature: u8,
    cut: u8,
}

/// All trees of a forest, each in pieces of at most [`WINDOW`] nodes.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::classification) struct Compact {
    /// The pieces, one after the other, and a window of padding.
    steps: Vec<Step>,
    /// Row of probabilities of every leaf whose number exceeds 254; [`ONWARD`] and the number of a piece where the
    /// descent continues in another piece; 0 elsewhere.
    rows: Vec<u32>,
    trees: Vec<TreePieces>,
}

/// The ranges of a tree's pieces: the top, and those below it.
#[derive(Clone, Debug, PartialEq)]
struct TreePieces {
    top: Range<usize>,
    lower: Vec<Range<usize>>,
}

/// Current node of each row of a block; reused from tree to tree.
#[derive(Clone, Debug, Default)]
pub(in crate::classification) struct CompactWalk {
    at: Vec<u16>,
    /// Rows that have not reached a leaf.
    moving: Vec<u16>,
    /// Rows that continue in each of the lower pieces.
    onward: Vec<Vec<u16>>,
}

/// A tree, and the number of nodes below each node, itself included.
struct Sized<'a> {
    nodes: &'a [Node],
    root: u32,
    sizes: Vec<u32>,
}

impl<'a> Sized<'a> {
    fn new(nodes: &'a [Node], root: u32) -> Self {
        let mut tree = Self { nodes, root, sizes: vec![1; nodes.len()] };
        for (i, node) in nodes.iter().enumerate().rev().filter(|(_, node)| node.cut != LEAF_CUT) {
            let left = tree.child(node);
            tree.sizes[i] += tree.sizes[left] + tree.sizes[left + 1];
        }
        tree
    }

    fn child(&self, node: &Node) -> usize {
        (node.left - self.root) as usize
    }
}

impl Compact {
    /// Cuts trees of more than `most` nodes (up to [`WINDOW`]) into pieces. `None` if a row has too many features,
    /// codes need more than 8 bits, or a tree has too many pieces.
    pub(in crate::classification) fn new(Trees { nodes, roots, binning }: Trees<'_>, most: usize) -> Option<Self> {
        if binning.width() > ROW || !binning.fits_u8() {
            return None;
        }
        let mut compact = Self { steps: Vec::new(), rows: Vec::new(), trees: Vec::new() };
        compact.steps.reserve_exact(nodes.len() + WINDOW);
        compact.rows.reserve_exact(nodes.len());
        let ends = roots.iter().skip(1).map(|&r| r as usize).chain([nodes.len()]);
        for (&root, end) in roots.iter().zip(ends) {
            let tree = Sized::new(nodes.get(root as usize..end)?, root);
            let mut below = Vec::new();
            let top = compact.piece(&tree, 0, if tree.nodes.len() > most { most } else { 0 }, &mut below);
            let lower = below.into_iter().map(|node| compact.piece(&tree, node, 0, &mut Vec::new())).collect();
            compact.trees.push(TreePieces { top, lower });
        }
        let pieces = || compact.trees.iter().flat_map(|tree| tree.lower.iter().chain([&tree.top]));
        if pieces().any(|piece| piece.len() > WINDOW) {
            return None;
        }
        compact.steps.resize(compact.steps.len() + WINDOW, Step::default());
        Some(compact)
    }

    /// Lays out the nodes from `start` down; subtrees of at most `cut` nodes are left out and appended to `below`. The
    /// children of a node are adjacent; the larger subtree, which more rows reach, follows immediately.
    fn piece(&mut self, tree: &Sized<'_>, start: usize, cut: usize, below: &mut Vec<usize>) -> Range<usize> {
        let first = self.steps.len();
        self.steps.push(Step::default());
        let mut open = vec![(start, first)];
        while let Some((old, new)) = open.pop() {
            let node = tree.nodes[old];
            self.rows.resize(self.steps.len(), 0);
            if node.cut == LEAF_CUT {
                self.steps[new] = Step { offset: 0, feature: node.left.min(255) as u8, cut: 255 };
                self.rows[new] = if node.left < 255 { 0 } else { node.left };
            } else if old != start && tree.sizes[old] as usize <= cut {
                self.steps[new] = Step { offset: 0, feature: 255, cut: 255 };
                self.rows[new] = ONWARD | below.len() as u32;
                below.push(old);
            } else {
                let next = self.steps.len();
                let offset = (next - new) as u16;
                self.steps[new] = Step { offset, feature: node.feature as u8, cut: node.cut as u8 };
                self.steps.extend([Step::default(); 2]);
                let left = tree.child(&node);
                let mut children = [(left, next), (left + 1, next + 1)];
                children.sort_by_key(|&(old, _)| tree.sizes[old]);
                open.extend(children);
            }
        }
        self.rows.resize(self.steps.len(), 0);
        first..self.steps.len()
    }

    /// Number of trees.
    pub(in crate::classification) fn trees(&self) -> usize {
        self.trees.len()
    }

    /// Writes for every row of codes the row of probabilities that it reaches in a tree. `codes.by_row` ends with
    /// [`ROW`] spare codes.
    pub(in crate::classification) fn walk(
        &self,
        tree: usize,
        codes: &CodeBlock<u8>,
        walk: &mut CompactWalk,
        leaves: &mut Vec<u32>,
    ) {
        let Some(TreePieces { top, lower }) = self.trees.get(tree) else { return };
        let Some((steps, rows)) = self.open(top) else { return };
        walk.at.resize(codes.rows, 0);
        leaves.clear();
        for first in (0..codes.rows).step_by(TOGETHER) {
            let own = first..codes.rows.min(first + TOGETHER);
            walk.start(steps, codes, own.clone());
            walk.finish(steps, codes);
            leaves.extend(walk.at.get(own).unwrap_or_default().iter().map(|&at| leaf(steps, rows, at)));
        }
        if !lower.is_empty() {
            self.go_on(lower, codes, walk, leaves);
        }
    }

    /// Continues the descent in the lower pieces, for the rows that have reached the end of the top.
    fn go_on(&self, lower: &[Range<usize>], codes: &CodeBlock<u8>, walk: &mut CompactWalk, leaves: &mut [u32]) {
        let mut onward = std::mem::take(&mut walk.onward);
        onward.resize_with(lower.len().max(onward.len()), Vec::new);
        onward.iter_mut().for_each(Vec::clear);
        for (row, &leaf) in leaves.iter().enumerate().filter(|(_, leaf)| **leaf & ONWARD != 0) {
            if let Some(rows) = onward.get_mut((leaf & !ONWARD) as usize) {
                rows.push(row as u16);
            }
        }
        for (piece, own) in lower.iter().zip(&onward).filter(|(_, own)| !own.is_empty()) {
            let Some((steps, rows)) = self.open(piece) else { continue };
            own.iter().for_each(|&row| walk.at[usize::from(row)] = 0);
            walk.moving.extend_from_slice(own);
            walk.finish(steps, codes);
            own.iter().map(|&row| usize::from(row)).for_each(|row| leaves[row] = leaf(steps, rows, walk.at[row]));
        }
        walk.onward = onward;
    }

    /// The nodes of a piece, including those beyond its end that may be read ahead, and its rows of probabilities.
    fn open(&self, piece: &Range<usize>) -> Option<(&[Step; WINDOW], &[u32])> {
        let steps = self.steps.get(piece.start..)?.first_chunk()?;
        warm(steps.get(..piece.len())?);
        Some((steps, self.rows.get(piece.clone())?))
    }
}

/// The row of probabilities of a leaf, or the piece in which the descent continues.
#[inline(always)]
fn leaf(steps: &[Step; WINDOW], rows: &[u32], at: u16) -> u32 {
    match steps[usize::from(at)].feature {
        255 => rows.get(usize::from(at)).copied().unwrap_or_default(),
        row => u32::from(row),
    }
}

/// Reads a tree sequentially, which loads it from memory much faster than node by node.
fn warm(steps: &[Step]) {
    let sum = steps.iter().step_by(LINE).fold(0u16, |sum, step| sum.wrapping_add(step.offset));
    std::hint::black_box(sum);
}

impl CompactWalk {
    /// Starts some rows at the root.
    fn start(&mut self, steps: &[Step; WINDOW], codes: &CodeBlock<u8>, rows: Range<usize>) {
        self.moving.resize(rows.len(), 0);
        let mut kept = 0usize;
        for row in rows {
            let (Some(at), Some(codes)) = (self.at.get_mut(row), row_of(codes, row)) else { break };
            *at = descend(steps, 0, codes);
            if let Some(slot) = self.moving.get_mut(kept) {
                *slot = row as u16;
            }
            kept = kept.wrapping_add(usize::from(steps[usize::from(*at)].offset != 0));
        }
        self.moving.truncate(kept);
    }

    /// Moves the rows until all have reached a leaf.
    fn finish(&mut self, steps: &[Step; WINDOW], codes: &CodeBlock<u8>) {
        while !self.moving.is_empty() {
            let mut kept = 0usize;
            for i in 0..self.moving.len() {
                let Some(&row) = self.moving.get(i) else { break };
                let Some(at) = self.at.get_mut(usize::from(row)) else { break };
                let Some(codes) = row_of(codes, usize::from(row)) else { break };
                *at = descend(steps, *at, codes);
                if let Some(slot) = self.moving.get_mut(kept) {
                    *slot = row;
                }
                kept = kept.wrapping_add(usize::from(steps[usize::from(*at)].offset != 0));
            }
            self.moving.truncate(kept);
        }
    }
}

#[inline(always)]
fn row_of(codes: &CodeBlock<u8>, row: usize) -> Option<&[u8; ROW]> {
    codes.by_row.get(row.wrapping_mul(codes.width)..).and_then(|codes| codes.first_chunk())
}

#[inline(always)]
fn descend(steps: &[Step; WINDOW], mut at: u16, codes: &[u8; ROW]) -> u16 {
    for _ in 0..LEVELS {
        let step = steps[usize::from(at)];
        let right = u16::from(codes[usize::from(step.feature)] > step.cut);
        at = at.wrapping_add(step.offset).wrapping_add(right);
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::binning::Binning;
    use crate::classification::testing::blobs;
    use crate::classification::{Forest, ForestParams};
    use crate::parallel::Monitor;

    #[test]
    fn the_compact_walk_reaches_the_leaves_of_the_plain_one() {
        let data = blobs(4000, 9, 300, 0.0);
        let params = ForestParams { trees: 3, ..ForestParams::default() };
        let forest = Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap();
        let trees = Trees { nodes: &forest.nodes, roots: &forest.roots, binning: &forest.binning };
        let wide = Binning::new(vec![Vec::new(); 300]).unwrap();
        let fine = Binning::new(vec![(0..300).map(|cut| cut as f32).collect(); 9]).unwrap();
        let mut codes = CodeBlock::default();
        forest.binning.bin_rows(&data.features, &mut codes);
        let (mut walk, mut leaves) = (CompactWalk::default(), Vec::new());
        for most in [WINDOW, 1000, 50, 3] {
            let compact = Compact::new(trees, most).unwrap();
            for (tree, &root) in forest.roots.iter().enumerate() {
                compact.walk(tree, &codes, &mut walk, &mut leaves);
                for (row, &leaf) in leaves.iter().enumerate() {
                    let wanted = forest.leaf_of(root, |f| u16::from(codes.by_row[row * 9 + f]));
                    assert_eq!(&forest.leaves[leaf as usize * 300..][..300], wanted, "{row}, {most}");
                }
            }
            assert!(compact.rows.iter().any(|&r| r > 255) && compact.trees() == 3);
            assert!(compact.trees.iter().all(|tree| tree.lower.is_empty() == (most == WINDOW)));
        }
        assert!(Compact::new(Trees { binning: &wide, ..trees }, WINDOW).is_none());
        assert!(Compact::new(Trees { binning: &fine, ..trees }, WINDOW).is_none());
    }
}
