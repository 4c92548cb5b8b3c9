//! Trees in half the memory, and prediction of blocks of rows with them.
//!
//! A node takes 4 bytes. Every index within a piece of a tree fits into 16 bits, and every feature into 8, so that no
//! bounds check is needed during the descent.

use super::crown::{Crown, ENDS, FindEnds};
use super::step::{LEAF, Step};
use crate::classification::nodes::{LEAF_CUT, Node, Trees};
use crate::classification::quantise::{CodeBlock, ROW, TILE};
use std::ops::Range;

/// Largest number of nodes of a piece.
pub(in crate::classification) const WINDOW: usize = 1 << 16;

/// The nodes of a piece, and those after it as far as a number of 16 bits can lead.
type Steps = [Step; WINDOW + 1];

/// The first levels are evaluated for all rows of the block together unless fewer than one in this many descends.
const FEW: usize = 6;

/// Flag: the number is not a row of probabilities but the piece in which the descent continues.
const ONWARD: u32 = 1 << 31;

/// Levels that rows descend before those at a leaf leave.
const LEVELS: usize = 8;

/// Rows that descend in step.
const AT_ONCE: usize = 8;

/// Rows that descend a tree together; their codes stay in the cache.
const TOGETHER: usize = 256;

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

/// A row that descends, and the node where it is.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    row: u16,
    at: u16,
}

/// The rows of a block that descend; reused from tree to tree.
#[derive(Clone, Debug, Default)]
pub(in crate::classification) struct CompactWalk {
    /// The rows, ascending.
    pub(in crate::classification) rows: Vec<u16>,
    /// End of the crown that each row of the block reaches.
    ends: Vec<u8>,
    /// Where each row begins; those that begin at the same node follow each other.
    order: Vec<Place>,
    /// Rows that have not reached a leaf.
    moving: Vec<Place>,
    /// Where each row of the block is.
    at: Vec<u16>,
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

    /// Writes for each of `walk.rows` the row of probabilities that it reaches in a tree. `codes` holds tiles and rows;
    /// the latter end with [`ROW`] spare codes.
    pub(in crate::classification) fn walk(
        &self,
        tree: usize,
        codes: &CodeBlock<u8>,
        walk: &mut CompactWalk,
        leaves: &mut Vec<u32>,
    ) {
        let Some(TreePieces { crown, top, lower }) = self.trees.get(tree) else { return };
        let Some(piece) = self.open(top) else { return };
        walk.start(crown, codes);
        leaves.resize(codes.rows, 0);
        let CompactWalk { order, moving, at, .. } = walk;
        for own in order.chunks(TOGETHER) {
            moving.extend_from_slice(own);
            Rows { codes, at }.finish(piece.steps, moving);
            own.iter().for_each(|place| piece.read(at, place.row, leaves));
        }
        if !lower.is_empty() {
            self.go_on(lower, codes, walk, leaves);
        }
        if walk.rows.len() < codes.rows {
            // The rows ascend: none is overwritten before it is read.
            (0..walk.rows.len()).for_each(|i| leaves[i] = leaves[usize::from(walk.rows[i])]);
            leaves.truncate(walk.rows.len());
        }
    }

    /// Continues the descent in the lower pieces, for the rows that have reached the end of the top.
    fn go_on(&self, lower: &[Range<usize>], codes: &CodeBlock<u8>, walk: &mut CompactWalk, leaves: &mut [u32]) {
        let CompactWalk { rows, moving, at, onward, .. } = walk;
        onward.resize_with(lower.len().max(onward.len()), Vec::new);
        onward.iter_mut().for_each(Vec::clear);
        for &row in rows.iter() {
            let leaf = leaves[usize::from(row)];
            if let Some(rows) = onward.get_mut((leaf & !ONWARD) as usize).filter(|_| leaf & ONWARD != 0) {
                rows.push(row);
            }
        }
        for (piece, own) in lower.iter().zip(onward).filter(|(_, own)| !own.is_empty()) {
            let Some(piece) = self.open(piece) else { continue };
            moving.extend(own.iter().map(|&row| Place { row, at: 0 }));
            Rows { codes, at }.finish(piece.steps, moving);
            own.iter().for_each(|&row| piece.read(at, row, leaves));
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
    /// Writes the row of probabilities that a row of the block has reached, or the piece in which it continues.
    #[inline(always)]
    fn read(self, at: &[u16], row: u16, leaves: &mut [u32]) {
        let row = usize::from(row);
        let (Some(&at), Some(to)) = (at.get(row), leaves.get_mut(row)) else { return };
        *to = match self.steps[usize::from(at)].feature() {
            255 => self.rows.get(usize::from(at)).copied().unwrap_or_default(),
            row => u32::from(row),
        };
    }
}

/// Reads a tree sequentially, which loads it from memory much faster than node by node.
fn warm(steps: &[Step]) {
    let sum = steps.iter().step_by(LINE).fold(0, |sum, step| sum ^ step.bits());
    std::hint::black_box(sum);
}

impl CompactWalk {
    /// Places the rows where they leave the first levels; at the root if there are few.
    fn start(&mut self, crown: &Crown, codes: &CodeBlock<u8>) {
        self.at.resize(codes.rows, 0);
        if self.rows.len() * FEW < codes.rows {
            self.order.clear();
            self.order.extend(self.rows.iter().map(|&row| Place { row, at: 0 }));
            return;
        }
        self.ends.resize(codes.rows.next_multiple_of(TILE), 0);
        pulp::Arch::new().dispatch(FindEnds { crown, codes, ends: &mut self.ends });
        self.sort(crown);
    }

    /// Orders the rows by their ends, so that those in the same part of the tree follow each other.
    fn sort(&mut self, crown: &Crown) {
        let Self { rows, ends, order, .. } = self;
        let end = |row: u16| ends.get(usize::from(row)).copied().unwrap_or_default() % ENDS as u8;
        let mut places = [0u16; ENDS];
        for &row in rows.iter() {
            let count = &mut places[usize::from(end(row))];
            *count = count.wrapping_add(1);
        }
        let mut next = 0u16;
        for place in &mut places {
            (*place, next) = (next, next.wrapping_add(*place));
        }
        order.resize(rows.len(), Place::default());
        for &row in rows.iter() {
            let end = end(row);
            let place = &mut places[usize::from(end)];
            if let Some(to) = order.get_mut(usize::from(*place)) {
                *to = Place { row, at: crown.end(end) };
            }
            *place = place.wrapping_add(1);
        }
    }
}

/// The rows of a block during a descent: their codes, and where they are.
struct Rows<'a> {
    codes: &'a CodeBlock<u8>,
    at: &'a mut [u16],
}

impl Rows<'_> {
    /// Moves rows until all have reached a leaf.
    fn finish(&mut self, steps: &Steps, moving: &mut Vec<Place>) {
        while !moving.is_empty() {
            let (mut kept, mut next) = (0usize, 0usize);
            while let Some(&few) = moving.get(next..).and_then(|rest| rest.first_chunk::<AT_ONCE>()) {
                next = next.wrapping_add(AT_ONCE);
                kept = keep(moving, kept, self.descend(steps, few));
            }
            while let Some(&one) = moving.get(next) {
                next = next.wrapping_add(1);
                kept = keep(moving, kept, self.descend(steps, [one]));
            }
            moving.truncate(kept);
        }
    }

    /// Moves a few rows some levels down, all of them a level before any of them the next one, so that the processor
    /// works on all at once. Returns where they are, and whether they are not at a leaf.
    #[inline(always)]
    fn descend<const N: usize>(&mut self, steps: &Steps, few: [Place; N]) -> [(Place, bool); N] {
        let codes = few.map(|place| self.codes_of(place.row));
        let mut at = few.map(|place| usize::from(place.at));
        for _ in 0..LEVELS {
            for (at, codes) in at.iter_mut().zip(codes) {
                let step = steps[*at];
                let right = codes[usize::from(step.feature())] > step.cut();
                *at = usize::from(step.left()).wrapping_add(usize::from(right));
            }
        }
        std::array::from_fn(|i| {
            let place = Place { row: few[i].row, at: at[i] as u16 };
            if let Some(to) = self.at.get_mut(usize::from(place.row)) {
                *to = place.at;
            }
            (place, !steps[at[i]].is_leaf())
        })
    }

    #[inline(always)]
    fn codes_of(&self, row: u16) -> &[u8; ROW] {
        let first = usize::from(row).wrapping_mul(self.codes.width);
        self.codes.by_row.get(first..).and_then(|codes| codes.first_chunk()).unwrap_or(&[0; ROW])
    }
}

/// Appends those rows that go on to the first `kept` of a list; returns how many these then are.
#[inline(always)]
fn keep<const N: usize>(moving: &mut [Place], mut kept: usize, few: [(Place, bool); N]) -> usize {
    for (place, goes_on) in few {
        if let Some(to) = moving.get_mut(kept) {
            *to = place;
        }
        kept = kept.wrapping_add(usize::from(goes_on));
    }
    kept
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
        forest.binning.bin_both(&data.features, &mut codes);
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
                        let wanted = forest.leaf_of(root, |f| u16::from(codes.by_row[usize::from(row) * 9 + f]));
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
}
