//! Trees in half the memory, and prediction of blocks of rows with them.
//!
//! A node takes 4 bytes. Every index within a piece of a tree fits into 16 bits, and every feature into 8, so that no
//! bounds check is needed during the descent.

use super::crown::{Crown, FindEnds};
use super::step::{LEAF, Step};
use crate::classification::nodes::{LEAF_CUT, Node, Trees};
use crate::classification::quantise::{CodeBlock, IN_STEP, ROW, SPARE, TILE};
use std::ops::Range;

/// Largest number of nodes of a piece.
pub(in crate::classification) const WINDOW: usize = 1 << 16;

/// The nodes of a piece, and those after it as far as a number of 16 bits can lead.
type Steps = [Step; WINDOW + 1];

/// The first levels are evaluated for all rows of the block together unless fewer than one in this many descends.
const FEW: usize = 6;

/// Flag: the number is not a row of probabilities but the piece in which the descent continues.
const ONWARD: u32 = 1 << 31;

/// Strides of rows are multiples of this.
const STRIDE: usize = 32;

/// Nodes in a cache line.
const LINE: usize = 16;

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

/// The ranges of a tree's pieces: the top, and those below it; and the first levels of the top.
#[derive(Clone, Debug, PartialEq)]
struct TreePieces {
    crown: Crown,
    top: Range<usize>,
    lower: Vec<Range<usize>>,
}

/// The rows of a block that descend; reused from tree to tree.
#[derive(Clone, Debug, Default)]
pub(in crate::classification) struct CompactWalk {
    /// The rows, ascending.
    pub(in crate::classification) rows: Vec<u16>,
    /// End of the crown that each row of the block reaches.
    ends: Vec<u8>,
    /// The rows that continue in each of the lower pieces.
    onward: Vec<Vec<Start>>,
}

/// A row, its place among those that descend, and the node where it begins.
#[derive(Clone, Copy, Debug)]
struct Start {
    place: usize,
    row: u16,
    at: u16,
}

/// The end of a crown that each row of a block reaches.
struct Ends<'a> {
    crown: &'a Crown,
    numbers: &'a [u8],
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
        compact.steps.reserve_exact(nodes.len() + WINDOW + 1);
        compact.rows.reserve_exact(nodes.len());
        let ends = roots.iter().skip(1).map(|&r| r as usize).chain([nodes.len()]);
        for (&root, end) in roots.iter().zip(ends) {
            let tree = Sized::new(nodes.get(root as usize..end)?, root);
            let mut below = Vec::new();
            let top = compact.piece(&tree, 0, if tree.nodes.len() > most { most } else { 0 }, &mut below);
            let lower = below.into_iter().map(|node| compact.piece(&tree, node, 0, &mut Vec::new())).collect();
            let crown = Crown::new(compact.steps.get(top.clone())?);
            compact.trees.push(TreePieces { crown, top, lower });
        }
        let pieces = || compact.trees.iter().flat_map(|tree| tree.lower.iter().chain([&tree.top]));
        if pieces().any(|piece| piece.len() > WINDOW) {
            return None;
        }
        compact.steps.resize(compact.steps.len() + WINDOW + 1, Step::default());
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
                self.steps[new] = Step::new(new - first, node.left.min(255), LEAF.into());
                self.rows[new] = if node.left < 255 { 0 } else { node.left };
            } else if old != start && tree.sizes[old] as usize <= cut {
                self.steps[new] = Step::new(new - first, 255, LEAF.into());
                self.rows[new] = ONWARD | below.len() as u32;
                below.push(old);
            } else {
                let next = self.steps.len();
                self.steps[new] = Step::new(next - first, node.feature.into(), node.cut);
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

    /// From one row of codes to the next in blocks for [`Compact::walk`].
    pub(in crate::classification) fn stride(width: usize) -> usize {
        width.next_multiple_of(STRIDE)
    }

    /// Writes for each of `walk.rows` the row of probabilities that it reaches in a tree. `codes` holds tiles and rows,
    /// the latter with [`Compact::stride`].
    pub(in crate::classification) fn walk(
        &self,
        tree: usize,
        codes: &CodeBlock<u8>,
        walk: &mut CompactWalk,
        leaves: &mut Vec<u32>,
    ) {
        let Some(TreePieces { crown, top, lower }) = self.trees.get(tree) else { return };
        let Some(piece) = self.open(top) else { return };
        let CompactWalk { rows, ends, onward } = walk;
        leaves.resize(rows.len(), 0);
        if rows.len() * FEW < codes.rows {
            let starts = rows.iter().enumerate().map(|(place, &row)| Start { place, row, at: 0 });
            piece.some(codes, starts, leaves);
        } else {
            // Whole tiles, and more for whole groups in step.
            ends.resize(codes.rows.next_multiple_of(TILE) + IN_STEP, 0);
            pulp::Arch::new().dispatch(FindEnds { crown, codes, ends });
            if rows.len() == codes.rows {
                leaves.resize(ends.len(), 0);
                piece.all(codes, &Ends { crown, numbers: ends }, leaves);
                leaves.truncate(codes.rows);
            } else {
                let end = |row: u16| ends.get(usize::from(row)).map_or(0, |&end| crown.end(end));
                let starts = rows.iter().enumerate().map(|(place, &row)| Start { place, row, at: end(row) });
                piece.some(codes, starts, leaves);
            }
        }
        onward.resize_with(lower.len().max(onward.len()), Vec::new);
        onward.iter_mut().for_each(Vec::clear);
        for (place, (&row, &leaf)) in rows.iter().zip(&*leaves).enumerate().filter(|_| !lower.is_empty()) {
            if let Some(starts) = onward.get_mut((leaf & !ONWARD) as usize).filter(|_| leaf & ONWARD != 0) {
                starts.push(Start { place, row, at: 0 });
            }
        }
        for (piece, starts) in lower.iter().zip(onward).filter(|(_, starts)| !starts.is_empty()) {
            let Some(piece) = self.open(piece) else { continue };
            piece.some(codes, starts.iter().copied(), leaves);
        }
    }
    /// The nodes of a piece, including those beyond its end that may be read ahead, and its rows of probabilities.
    fn open(&self, piece: &Range<usize>) -> Option<Piece<'_>> {
        let steps = self.steps.get(piece.start..)?.first_chunk()?;
        warm(steps.get(..piece.len())?);
        Some(Piece { steps, rows: self.rows.get(piece.clone())? })
    }
}

/// A piece in use.
#[derive(Clone, Copy)]
struct Piece<'a> {
    steps: &'a Steps,
    /// As [`Compact::rows`].
    rows: &'a [u32],
}

impl Piece<'_> {
    /// Moves all rows of a block from the ends of the crown to their leaves.
    fn all(self, codes: &CodeBlock<u8>, from: &Ends<'_>, leaves: &mut [u32]) {
        match codes.stride {
            32 => self.groups::<32>(codes, from, leaves),
            64 => self.groups::<64>(codes, from, leaves),
            96 => self.groups::<96>(codes, from, leaves),
            128 => self.groups::<128>(codes, from, leaves),
            160 => self.groups::<160>(codes, from, leaves),
            192 => self.groups::<192>(codes, from, leaves),
            224 => self.groups::<224>(codes, from, leaves),
            _ => self.groups::<ROW>(codes, from, leaves),
        }
    }

    /// As [`Piece::all`], for one stride: the codes of a group lie at distances that the compiler knows, so that one
    /// register leads to all of them.
    fn groups<const STRIDE: usize>(self, codes: &CodeBlock<u8>, from: &Ends<'_>, leaves: &mut [u32]) {
        let firsts = (0..codes.rows * STRIDE).step_by(IN_STEP * STRIDE);
        let groups = firsts.filter_map(|first| codes.by_row.get(first..)?.first_chunk::<SPARE>());
        let ends = from.numbers.as_chunks::<IN_STEP>().0;
        for ((rows, ends), leaves) in groups.zip(ends).zip(leaves.as_chunks_mut().0) {
            let mut starts = [0; IN_STEP];
            starts.iter_mut().zip(ends).for_each(|(start, &end)| *start = from.crown.end(end));
            *leaves = self.descend(starts, |i, feature| rows[i * STRIDE + usize::from(feature)]);
        }
    }

    /// Moves rows to their leaves from wherever they begin.
    fn some(self, codes: &CodeBlock<u8>, mut starts: impl Iterator<Item = Start>, leaves: &mut [u32]) {
        let codes_of = |row: u16| {
            let first = usize::from(row).wrapping_mul(codes.stride);
            codes.by_row.get(first..).and_then(|codes| codes.first_chunk()).unwrap_or(&[0; ROW])
        };
        while let Some(first) = starts.next() {
            let mut few = [first; IN_STEP];
            few.iter_mut().skip(1).zip(&mut starts).for_each(|(to, start)| *to = start);
            let codes: [&[u8; ROW]; IN_STEP] = few.map(|start| codes_of(start.row));
            let reached = self.descend(few.map(|start| start.at), |i, feature| codes[i][usize::from(feature)]);
            for (start, leaf) in few.iter().zip(reached) {
                if let Some(to) = leaves.get_mut(start.place) {
                    *to = leaf;
                }
            }
        }
    }

    /// Moves a few rows to their leaves, all of them a level before any of them the next one, so that the processor
    /// works on all at once. Returns their rows of probabilities, or the pieces in which they continue.
    #[inline(always)]
    fn descend(self, starts: [u16; IN_STEP], code: impl Fn(usize, u8) -> u8) -> [u32; IN_STEP] {
        let mut at = starts.map(usize::from);
        loop {
            let mut last = Step::leaf();
            for (i, at) in at.iter_mut().enumerate() {
                let step = self.steps[*at];
                let right = code(i, step.feature()) > step.cut();
                *at = usize::from(step.left()).wrapping_add(usize::from(right));
                last = last.and(step);
            }
            if last.is_leaf() {
                // `map` of an array would be a call here.
                let mut leaves = [0; IN_STEP];
                leaves.iter_mut().zip(at).for_each(|(leaf, at)| *leaf = self.leaf(at));
                return leaves;
            }
        }
    }

    /// The row of probabilities of a leaf, or the piece in which the descent continues.
    #[inline(always)]
    fn leaf(self, at: usize) -> u32 {
        match self.steps[at].feature() {
            255 => self.rows.get(at).copied().unwrap_or_default(),
            row => u32::from(row),
        }
    }
}

/// Reads a tree sequentially, which loads it from memory much faster than node by node.
fn warm(steps: &[Step]) {
    let sum = steps.iter().step_by(LINE).fold(0, |sum, step| sum ^ step.bits());
    std::hint::black_box(sum);
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
        forest.binning.bin_both(&data.features, Compact::stride(9), &mut codes);
        let (mut walk, mut leaves) = (CompactWalk::default(), Vec::new());
        for most in [WINDOW, 1000, 50, 3] {
            let compact = Compact::new(trees, most).unwrap();
            // All rows; some; so few that they begin at the root.
            for step in [1, 3, 100] {
                walk.rows = (0..4000).step_by(step).collect();
                for (tree, &root) in forest.roots.iter().enumerate() {
                    compact.walk(tree, &codes, &mut walk, &mut leaves);
                    assert_eq!(leaves.len(), walk.rows.len());
                    for (&row, &leaf) in walk.rows.iter().zip(&leaves) {
                        let wanted =
                            forest.leaf_of(root, |f| u16::from(codes.by_row[usize::from(row) * codes.stride + f]));
                        assert_eq!(&forest.leaves[leaf as usize * 300..][..300], wanted, "{row}, {most}, {step}");
                    }
                }
            }
            assert!(compact.rows.iter().any(|&r| r > 255) && compact.trees() == 3);
            assert!(compact.trees.iter().all(|tree| tree.lower.is_empty() == (most == WINDOW)));
        }
        assert!(Compact::new(Trees { binning: &wide, ..trees }, WINDOW).is_none());
        assert!(Compact::new(Trees { binning: &fine, ..trees }, WINDOW).is_none());
    }

    #[test]
    fn rows_of_any_width_reach_their_leaves() {
        for width in [1, 32, 33, 65, 97, 129, 161, 193, 225, 256] {
            let data = blobs(700, width, 5, 0.3);
            let params = ForestParams { trees: 2, ..ForestParams::default() };
            let forest = Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap();
            let trees = Trees { nodes: &forest.nodes, roots: &forest.roots, binning: &forest.binning };
            let compact = Compact::new(trees, WINDOW).unwrap();
            let (mut codes, mut walk, mut leaves) = (CodeBlock::default(), CompactWalk::default(), Vec::new());
            // A larger block before: what is left of it must not matter.
            for rows in [700, 13, 500] {
                forest.binning.bin_both(&data.features[..rows * width], Compact::stride(width), &mut codes);
                walk.rows = (0..rows as u16).collect();
                for (tree, &root) in forest.roots.iter().enumerate() {
                    compact.walk(tree, &codes, &mut walk, &mut leaves);
                    assert_eq!(leaves.len(), rows);
                    for (row, &leaf) in data.features.chunks_exact(width).zip(&leaves) {
                        let wanted = forest.leaf_of(root, |f| forest.binning.code(f, row[f]));
                        assert_eq!(&forest.leaves[leaf as usize * 5..][..5], wanted, "{width} {rows}");
                    }
                }
            }
        }
    }
}
