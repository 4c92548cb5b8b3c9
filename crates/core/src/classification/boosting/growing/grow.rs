//! Grows one tree leaf by leaf: the leaf with the largest gain is split next.
//!
//! H. Shi, *Best-first decision tree learning*, 2007; G. Ke et al., *LightGBM*, NIPS 2017. Only the histograms of the
//! smaller child are computed; those of the larger one are the parent's minus these.

use crate::classification::boosting::growing::blocks::{Blocks, LANES};
use crate::classification::boosting::growing::histogram::{Cell, Cells, accumulate, minus, plus, subtract};
use crate::classification::boosting::growing::split::{Split, SplitRules};
use crate::classification::boosting::params::BoostingParams;
use crate::classification::nodes::GrownNode;
use crate::error::Result;
use crate::parallel::{Looks, Monitor, watched};
use rayon::prelude::*;

/// A tree; the samples of each leaf are a range of `rows`.
#[derive(Clone, Debug, Default)]
pub(in crate::classification::boosting) struct LeafwiseTree {
    pub(in crate::classification::boosting) nodes: Vec<GrownNode<Split>>,
    pub(in crate::classification::boosting) leaves: Vec<std::ops::Range<usize>>,
    pub(in crate::classification::boosting) rows: Vec<u32>,
}

impl LeafwiseTree {
    /// The leaf that a sample reaches.
    pub(in crate::classification::boosting) fn leaf(&self, blocks: &Blocks, row: u32) -> usize {
        let mut at = 0;
        loop {
            match self.nodes[at] {
                GrownNode::Leaf(leaf) => return leaf as usize,
                GrownNode::Split(split, left) => {
                    at = left as usize + usize::from(split.goes_right(blocks.code(split.feature, row)));
                }
            }
        }
    }
}

/// Histograms of all blocks.
type Histogram = Vec<Cells>;

/// Histograms for reuse: a tree never holds more than `limit` at a time.
#[derive(Default)]
pub(in crate::classification::boosting) struct HistogramPool {
    free: Vec<Histogram>,
    held: usize,
}

/// Memory limit for the histograms of one tree, in bytes.
const POOL_BYTES: usize = 256 << 20;

impl HistogramPool {
    fn take(&mut self, blocks: usize) -> Histogram {
        self.held += 1;
        self.free.pop().unwrap_or_else(|| vec![[[[0; 2]; 256]; LANES]; blocks])
    }

    fn give(&mut self, histogram: Option<Histogram>) {
        if let Some(histogram) = histogram {
            self.held -= 1;
            self.free.push(histogram);
        }
    }

    fn is_full(&self, blocks: usize) -> bool {
        self.held * blocks * size_of::<Cells>() > POOL_BYTES
    }
}

/// A leaf that may still be split.
struct OpenLeaf {
    node: usize,
    rows: std::ops::Range<usize>,
    depth: usize,
    total: Cell,
    histogram: Option<Histogram>,
    split: Option<Split>,
}

/// Everything that growing a tree needs.
pub(in crate::classification::boosting) struct LeafwiseGrower<'a> {
    pub(in crate::classification::boosting) rules: SplitRules<'a>,
    /// Derivatives of every sample as a cell.
    pub(in crate::classification::boosting) samples: &'a [Cell],
    pub(in crate::classification::boosting) monitor: &'a Monitor,
    pub(in crate::classification::boosting) pool: &'a mut HistogramPool,
}

impl LeafwiseGrower<'_> {
    fn params(&self) -> &BoostingParams {
        self.rules.params
    }

    /// Grows the tree on these samples.
    pub(in crate::classification::boosting) fn grow(mut self, rows: Vec<u32>) -> Result<LeafwiseTree> {
        let mut tree = LeafwiseTree { nodes: vec![GrownNode::Leaf(0)], leaves: Vec::new(), rows };
        let mut total = [0; 2];
        for piece in watched(tree.rows.len(), self.monitor) {
            total = tree.rows[piece?].iter().fold(total, |sum, &r| plus(sum, self.samples[r as usize]));
        }
        let all = 0..tree.rows.len();
        let mut root = OpenLeaf { node: 0, rows: all, depth: 0, total, histogram: None, split: None };
        if self.worth(&root) {
            let mut histogram = self.pool.take(self.rules.blocks.len());
            root.split = self.sum(&tree.rows, &mut histogram, total)?;
            root.histogram = Some(histogram);
        }
        let mut open = vec![root];
        while open.len() < self.params().max_leaves {
            let Some(next) = largest_gain(&open) else { break };
            let leaf = open.swap_remove(next);
            let room = open.len() + 2 < self.params().max_leaves;
            open.extend(self.divide(&mut tree, leaf, room)?);
        }
        for leaf in open {
            self.pool.give(leaf.histogram);
            tree.nodes[leaf.node] = GrownNode::Leaf(tree.leaves.len() as u32);
            tree.leaves.push(leaf.rows);
        }
        Ok(tree)
    }

    /// True if the leaf may be split by the limits on depth and samples.
    fn worth(&self, leaf: &OpenLeaf) -> bool {
        leaf.depth < self.params().depth_limit() && leaf.rows.len() >= self.params().min_samples_leaf.saturating_mul(2)
    }

    /// Splits a leaf; the best splits of its children are searched only if there is `room` for more leaves.
    fn divide(&mut self, tree: &mut LeafwiseTree, leaf: OpenLeaf, room: bool) -> Result<[OpenLeaf; 2]> {
        let OpenLeaf { node, rows, depth, total, histogram, split } = leaf;
        let child =
            |at: usize, rows| OpenLeaf { node: at, rows, depth: depth + 1, total, histogram: None, split: None };
        let first = tree.nodes.len();
        let Some(split) = split else { return Ok([child(first, rows.clone()), child(first + 1, rows)]) };
        tree.nodes[node] = GrownNode::Split(split, first as u32);
        tree.nodes.extend([GrownNode::Leaf(0); 2]);
        let here = &mut tree.rows[rows.clone()];
        let (middle, left) = self.partition(here, split)?;
        let middle = rows.start + middle;
        let mut children = [child(first, rows.start..middle), child(first + 1, middle..rows.end)];
        children[0].total = left;
        children[1].total = minus(total, left);
        if room && children.iter().any(|c| self.worth(c)) {
            self.search(&tree.rows, &mut children, histogram)?;
        } else {
            self.pool.give(histogram);
        }
        Ok(children)
    }

    /// Moves the samples that go left to the front, keeping the order on both sides; returns their number and sum.
    fn partition(&self, rows: &mut [u32], split: Split) -> Result<(usize, Cell)> {
        let codes = self.rules.blocks.block(split.feature / LANES);
        let lane = split.feature % LANES;
        let mut spare = Vec::with_capacity(rows.len());
        let (mut left, mut sum) = (0, [0; 2]);
        let mut looks = Looks::at(self.monitor);
        for i in 0..rows.len() {
            looks.step()?;
            let row = rows[i];
            if split.goes_right(codes[row as usize][lane]) {
                spare.push(row);
            } else {
                sum = plus(sum, self.samples[row as usize]);
                rows[left] = row;
                left += 1;
            }
        }
        rows[left..].copy_from_slice(&spare);
        Ok((left, sum))
    }

    /// Computes histograms and best splits of two siblings.
    fn search(&mut self, rows: &[u32], children: &mut [OpenLeaf; 2], parent: Option<Histogram>) -> Result<()> {
        let [a, b] = children;
        let (small, large) = if a.rows.len() <= b.rows.len() { (a, b) } else { (b, a) };
        let mut own = self.pool.take(self.rules.blocks.len());
        small.split = self.sum(&rows[small.rows.clone()], &mut own, small.total)?;
        match parent {
            Some(mut other) => {
                large.split = self.difference(&mut other, &own, large.total)?;
                large.histogram = Some(other);
            }
            None => {
                let mut other = self.pool.take(self.rules.blocks.len());
                large.split = self.sum(&rows[large.rows.clone()], &mut other, large.total)?;
                large.histogram = Some(other);
            }
        }
        small.histogram = Some(own);
        for child in [small, large] {
            child.split = child.split.filter(|_| child.depth < self.params().depth_limit());
            if child.split.is_none() || self.pool.is_full(self.rules.blocks.len()) {
                self.pool.give(child.histogram.take());
            }
        }
        Ok(())
    }

    /// Computes the histograms of these samples; returns their best split.
    fn sum(&self, rows: &[u32], histogram: &mut Histogram, total: Cell) -> Result<Option<Split>> {
        let mut samples: Vec<Cell> = Vec::with_capacity(rows.len());
        for piece in watched(rows.len(), self.monitor) {
            samples.extend(rows[piece?].iter().map(|&row| self.samples[row as usize]));
        }
        let block = |(b, cells): (usize, &mut Cells)| {
            self.monitor.check()?;
            cells.as_flattened_mut().fill([0; 2]);
            for piece in watched(rows.len(), self.monitor) {
                let piece = piece?;
                accumulate(cells, self.rules.blocks.block(b), &rows[piece.clone()], &samples[piece]);
            }
            Ok(self.rules.best(b, cells, total))
        };
        best(histogram.par_iter_mut().enumerate().map(block).collect())
    }

    /// Subtracts a child's histograms from its parent's, which gives its sibling's; returns the sibling's best split.
    fn difference(&self, parent: &mut Histogram, child: &Histogram, total: Cell) -> Result<Option<Split>> {
        let block = |(b, (parent, child)): (usize, (&mut Cells, &Cells))| {
            self.monitor.check()?;
            subtract(parent, child);
            Ok(self.rules.best(b, parent, total))
        };
        best(parent.par_iter_mut().zip(child).enumerate().map(block).collect())
    }
}

/// The best split over all blocks, in their order.
fn best(blocks: Vec<Result<Option<Split>>>) -> Result<Option<Split>> {
    blocks.into_iter().try_fold(None, |best, split| Ok(Split::better(best, split?)))
}

/// The leaf with the largest gain, the first of equal ones.
fn largest_gain(open: &[OpenLeaf]) -> Option<usize> {
    let gains = open.iter().enumerate().filter_map(|(i, leaf)| leaf.split.map(|s| (s.gain, leaf.node, i)));
    gains.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map(|(_, _, i)| i)
}
