//! Prediction: a block of rows is quantised once, then descends each tree.

use super::compact::{Compact, CompactWalk};
use super::descend::Walk;
use super::{Descent, Forest};
use crate::classification::learner::{PartCount, Predictor, argmax, check_lengths};
use crate::classification::nodes::{LEAF_CUT, Node};
use crate::classification::quantise::CodeBlock;
use crate::error::{Error, Result};
use rayon::prelude::*;

/// Rows of a block: enough to make up for loading each tree, few enough that their codes stay in the last cache.
const BLOCK: usize = 16_384;

/// Blocks are made smaller, so that every thread has some, but not smaller than this.
const LEAST: usize = 4096;

/// Scratch memory of a forest's prediction.
#[derive(Clone, Debug, Default)]
pub struct ForestScratch {
    pub(in crate::classification) narrow: CodeBlock<u8>,
    wide: CodeBlock<u16>,
    walk: Walk,
    pub(in crate::classification) compact_walk: CompactWalk,
    pub(in crate::classification) leaves: Vec<u32>,
}

impl Predictor for Forest {
    type Scratch = ForestScratch;

    fn classes(&self) -> usize {
        self.classes
    }

    fn width(&self) -> usize {
        self.binning.width()
    }

    fn parts(&self) -> Vec<PartCount> {
        vec![PartCount { kind: "trees", count: self.trees() }, PartCount { kind: "nodes", count: self.nodes() }]
    }

    /// Mean decrease in impurity (Breiman 2001): each feature's share in the total decrease.
    fn importance(&self) -> &[f64] {
        &self.importance
    }

    fn retain_used(mut self) -> (Self, Vec<usize>) {
        let mut used = self.used_features();
        if used.is_empty() {
            used.push(0);
        }
        let mut position = vec![0u16; self.width()];
        used.iter().enumerate().for_each(|(new, &old)| position[old] = new as u16);
        for node in self.nodes.iter_mut().filter(|n| n.cut != LEAF_CUT) {
            node.feature = position[usize::from(node.feature)];
        }
        self.binning = self.binning.select(&used);
        self.importance = used.iter().map(|&f| self.importance[f]).collect();
        self.prepare();
        (self, used)
    }

    fn predict_block(&self, rows: &[f32], scratch: &mut ForestScratch, out: &mut [f32]) -> Result<()> {
        check_lengths(self, rows, out)?;
        out.fill(0.0);
        for (rows, out) in rows.chunks(BLOCK * self.width()).zip(out.chunks_mut(BLOCK * self.classes)) {
            match &self.descent {
                Descent::Compact(trees) => self.add_compact(rows, trees, scratch, out),
                Descent::Large(nodes) if self.binning.fits_u8() => {
                    self.binning.bin_rows(rows, &mut scratch.narrow);
                    self.add_large(nodes, &scratch.narrow, &mut scratch.walk, out);
                }
                Descent::Large(nodes) => {
                    self.binning.bin_rows_wide(rows, &mut scratch.wide);
                    self.add_large(nodes, &scratch.wide, &mut scratch.walk, out);
                }
            }
            let trees = self.trees().max(1) as f32;
            out.iter_mut().for_each(|p| *p /= trees);
        }
        Ok(())
    }

    fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
        check_lengths(self, rows, out)?;
        let block = block(out.len() / self.classes.max(1));
        rows.par_chunks(block * self.width())
            .zip(out.par_chunks_mut(block * self.classes))
            .try_for_each_init(ForestScratch::default, |scratch, (rows, out)| self.predict_block(rows, scratch, out))
    }

    /// Faster than the probabilities: a row skips the remaining trees once they cannot change its class.
    fn predict(&self, rows: &[f32]) -> Result<Vec<u16>> {
        if self.width() == 0 || !rows.len().is_multiple_of(self.width()) {
            return Err(Error::ModelMismatch(format!(
                "{} values are not whole rows of {} features",
                rows.len(),
                self.width()
            )));
        }
        let mut labels = vec![0; rows.len() / self.width()];
        let block = block(labels.len());
        rows.par_chunks(block * self.width())
            .zip(labels.par_chunks_mut(block))
            .try_for_each_init(ForestScratch::default, |scratch, (rows, out)| self.label_rows(rows, scratch, out))?;
        Ok(labels)
    }
}

/// Rows of a block when so many are divided among the threads. The results do not depend on it.
fn block(rows: usize) -> usize {
    (rows / (4 * rayon::current_num_threads())).clamp(LEAST, BLOCK)
}

impl Forest {
    fn label_rows(&self, rows: &[f32], scratch: &mut ForestScratch, out: &mut [u16]) -> Result<()> {
        if let Descent::Compact(trees) = &self.descent {
            self.label_block(rows, trees, scratch, out);
            return Ok(());
        }
        let mut shares = vec![0.0; out.len() * self.classes];
        self.predict_block(rows, scratch, &mut shares)?;
        let best = shares.chunks_exact(self.classes).map(|row| argmax(row) as u16);
        out.iter_mut().zip(best).for_each(|(label, best)| *label = best);
        Ok(())
    }

    /// Quantises rows; all of them will descend.
    pub(in crate::classification) fn begin(&self, rows: &[f32], scratch: &mut ForestScratch) {
        let ForestScratch { narrow, compact_walk, .. } = scratch;
        self.binning.bin_both(rows, Compact::stride(self.width()), narrow);
        compact_walk.rows.clear();
        compact_walk.rows.extend(0..narrow.rows as u16);
    }

    fn add_compact(&self, rows: &[f32], trees: &Compact, scratch: &mut ForestScratch, out: &mut [f32]) {
        self.begin(rows, scratch);
        let ForestScratch { narrow, compact_walk, leaves, .. } = scratch;
        for tree in 0..trees.trees() {
            trees.walk(tree, narrow, compact_walk, leaves);
            self.add_leaves(leaves, out);
        }
    }

    fn add_large<C: Copy + Default + Into<u16>>(
        &self,
        nodes: &[Node],
        codes: &CodeBlock<C>,
        walk: &mut Walk,
        out: &mut [f32],
    ) {
        for &root in &self.roots {
            walk.tree(nodes, root, codes);
            walk.at.iter_mut().for_each(|at| *at = self.node(*at).left);
            self.add_leaves(&walk.at, out);
        }
    }

    /// Adds the class shares of each row's leaf; compiled for every small number of classes.
    pub(in crate::classification) fn add_leaves(&self, leaves: &[u32], out: &mut [f32]) {
        match self.classes {
            2 => self.add::<2>(leaves, out),
            3 => self.add::<3>(leaves, out),
            4 => self.add::<4>(leaves, out),
            5 => self.add::<5>(leaves, out),
            6 => self.add::<6>(leaves, out),
            7 => self.add::<7>(leaves, out),
            8 => self.add::<8>(leaves, out),
            classes => {
                for (out, &leaf) in out.chunks_exact_mut(classes).zip(leaves) {
                    let first = leaf as usize * classes;
                    let shares = &self.leaves[first..first + classes];
                    out.iter_mut().zip(shares).for_each(|(p, &share)| *p += share);
                }
            }
        }
    }

    fn add<const N: usize>(&self, leaves: &[u32], out: &mut [f32]) {
        for (out, &leaf) in out.as_chunks_mut::<N>().0.iter_mut().zip(leaves) {
            let first = (leaf as usize).wrapping_mul(N);
            let Some(shares) = self.leaves.get(first..).and_then(|s| s.first_chunk::<N>()) else { continue };
            out.iter_mut().zip(shares).for_each(|(p, &share)| *p += share);
        }
    }

    #[inline]
    pub(in crate::classification) fn node(&self, at: u32) -> Node {
        self.nodes[at as usize]
    }

    /// The leaf row that one row of codes reaches.
    pub(in crate::classification) fn leaf_of(&self, root: u32, code: impl Fn(usize) -> u16) -> &[f32] {
        let mut node = self.node(root);
        while node.cut != LEAF_CUT {
            node = self.node(node.left + u32::from(code(usize::from(node.feature)) > node.cut));
        }
        let row = node.left as usize * self.classes;
        &self.leaves[row..row + self.classes]
    }
}
