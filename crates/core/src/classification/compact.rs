//! Trees of few nodes in half the memory, and the way of a block of rows through them.
//!
//! A node takes 4 bytes and says how far ahead its children stand, so that every place in a tree fits 16 bits and every
//! place in a row of codes 8: nothing has to be compared with a length on the way down.

use super::descend::Codes;
use super::forest::{LEAF_CUT, Node};

/// Most nodes of a tree.
const WINDOW: usize = 1 << 16;

/// Most features of a row.
pub(super) const WIDTH: usize = 256;

/// Levels that a row goes down before the next row is looked at: the processor works on several rows at once.
const LEVELS: usize = 4;

/// Nodes in a line of the cache.
const LINE: usize = 16;

/// Samples with code > `cut` go to `offset + 1` places ahead, others to `offset`. A leaf has offset 0 and cut 255, which no
/// code exceeds: rows stay there. Its `feature` is its row of probabilities, 255 if that is in [`Compact::rows`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Step {
    offset: u16,
    feature: u8,
    cut: u8,
}

/// All trees of a forest.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Compact {
    /// The trees behind one another, and a window of padding.
    steps: Vec<Step>,
    roots: Vec<usize>,
    /// Row of probabilities of every leaf whose number exceeds 254; 0 elsewhere.
    rows: Vec<u32>,
}

/// Where the rows of a block stand in a tree; reused from tree to tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    at: Vec<u16>,
    /// Rows that have not reached a leaf.
    moving: Vec<u16>,
}

impl Compact {
    /// `None` if a tree has too many nodes, or a row too many features or codes beyond 8 bits. Nodes stand behind their
    /// parents.
    pub(super) fn new(nodes: &[Node], roots: &[u32], (width, narrow): (usize, bool)) -> Option<Self> {
        let ends = roots.iter().skip(1).map(|&r| r as usize).chain([nodes.len()]);
        let trees: Vec<&[Node]> = roots.iter().zip(ends).filter_map(|(&r, end)| nodes.get(r as usize..end)).collect();
        if width > WIDTH || !narrow || trees.iter().any(|tree| tree.len() > WINDOW) {
            return None;
        }
        let mut compact = Self { steps: Vec::new(), roots: Vec::new(), rows: Vec::new() };
        compact.steps.reserve_exact(nodes.len() + WINDOW);
        compact.rows.reserve_exact(nodes.len());
        roots.iter().zip(trees).for_each(|(&root, tree)| compact.append(tree, root));
        compact.steps.resize(nodes.len() + WINDOW, Step::default());
        Some(compact)
    }

    /// Children of a node stand together; the smaller subtree follows at once, so that few nodes lie between.
    fn append(&mut self, tree: &[Node], root: u32) {
        let child = |node: &Node| (node.left - root) as usize;
        let mut sizes = vec![1u32; tree.len()];
        for (i, node) in tree.iter().enumerate().rev().filter(|(_, node)| node.cut != LEAF_CUT) {
            sizes[i] += sizes[child(node)] + sizes[child(node) + 1];
        }
        let first = self.steps.len();
        self.roots.push(first);
        self.steps.resize(first + tree.len(), Step::default());
        self.rows.resize(first + tree.len(), 0);
        let (mut next, mut open) = (1, vec![(0, 0)]);
        while let Some((old, new)) = open.pop() {
            let node = &tree[old];
            if node.cut == LEAF_CUT {
                self.steps[first + new] = Step { offset: 0, feature: node.left.min(255) as u8, cut: 255 };
                self.rows[first + new] = if node.left < 255 { 0 } else { node.left };
                continue;
            }
            let step = Step { offset: (next - new) as u16, feature: node.feature as u8, cut: node.cut as u8 };
            self.steps[first + new] = step;
            let mut children = [(child(node), next), (child(node) + 1, next + 1)];
            children.sort_by_key(|&(old, _)| std::cmp::Reverse(sizes[old]));
            open.extend(children);
            next += 2;
        }
    }

    /// Number of trees.
    pub(super) fn trees(&self) -> usize {
        self.roots.len()
    }

    /// Writes the row of probabilities that every row of codes reaches in a tree. `codes.by_row` has [`WIDTH`] codes to
    /// spare at its end.
    pub(super) fn walk(&self, tree: usize, codes: &Codes<u8>, places: &mut Places, leaves: &mut Vec<u32>) {
        let Some(&root) = self.roots.get(tree) else { return };
        let end = self.roots.get(tree + 1).copied().unwrap_or(self.rows.len());
        let Some(steps) = self.steps.get(root..).and_then(|s| s.first_chunk()) else { return };
        warm(steps.get(..end - root).unwrap_or_default());
        places.start(steps, codes);
        places.finish(steps, codes);
        let rows = self.rows.get(root..end).unwrap_or_default();
        leaves.clear();
        leaves.extend(places.at.iter().map(|&at| match steps[usize::from(at)].feature {
            255 => rows.get(usize::from(at)).copied().unwrap_or_default(),
            row => u32::from(row),
        }));
    }
}

/// Reads a tree from end to end: it comes from memory much faster than node by node.
fn warm(steps: &[Step]) {
    let sum = steps.iter().step_by(LINE).fold(0u16, |sum, step| sum.wrapping_add(step.offset));
    std::hint::black_box(sum);
}

impl Places {
    /// All rows from the root.
    fn start(&mut self, steps: &[Step; WINDOW], codes: &Codes<u8>) {
        self.at.resize(codes.rows, 0);
        self.moving.resize(codes.rows, 0);
        let mut kept = 0usize;
        for (row, at) in self.at.iter_mut().enumerate() {
            let Some(codes) = row_of(codes, row) else { break };
            *at = descend(steps, 0, codes);
            if let Some(slot) = self.moving.get_mut(kept) {
                *slot = row as u16;
            }
            kept = kept.wrapping_add(usize::from(steps[usize::from(*at)].offset != 0));
        }
        self.moving.truncate(kept);
    }

    /// The rows that move, until none does.
    fn finish(&mut self, steps: &[Step; WINDOW], codes: &Codes<u8>) {
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
fn row_of(codes: &Codes<u8>, row: usize) -> Option<&[u8; WIDTH]> {
    codes.by_row.get(row.wrapping_mul(codes.width)..).and_then(|codes| codes.first_chunk())
}

#[inline(always)]
fn descend(steps: &[Step; WINDOW], mut at: u16, codes: &[u8; WIDTH]) -> u16 {
    for _ in 0..LEVELS {
        let step = steps[usize::from(at)];
        let right = u16::from(codes[usize::from(step.feature)] > step.cut);
        at = at.wrapping_add(step.offset).wrapping_add(right);
    }
    at
}

#[cfg(test)]
mod tests {
    use super::super::testing::blobs;
    use super::super::{Forest, ForestParams};
    use super::*;
    use crate::parallel::Monitor;

    #[test]
    fn the_compact_walk_reaches_the_leaves_of_the_plain_one() {
        let data = blobs(4000, 9, 300, 0.0);
        let params = ForestParams { trees: 3, ..ForestParams::default() };
        let forest = Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap();
        let compact = Compact::new(&forest.nodes, &forest.roots, (9, true)).unwrap();
        let mut codes = Codes::default();
        forest.binning.bin_rows(&data.features, &mut codes);
        let (mut places, mut leaves) = (Places::default(), Vec::new());
        for (tree, &root) in forest.roots.iter().enumerate() {
            compact.walk(tree, &codes, &mut places, &mut leaves);
            for (row, &leaf) in leaves.iter().enumerate() {
                let wanted = forest.leaf_of(root, |f| u16::from(codes.by_row[row * 9 + f]));
                assert_eq!(&forest.leaves[leaf as usize * 300..][..300], wanted, "{row}");
            }
        }
        assert!(compact.rows.iter().any(|&r| r > 255) && compact.trees() == 3);
        assert!(Compact::new(&forest.nodes, &forest.roots, (300, true)).is_none());
        assert!(Compact::new(&forest.nodes, &forest.roots, (9, false)).is_none());
    }
}
