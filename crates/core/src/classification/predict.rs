//! Prediction: a block of rows is quantised once, then every tree takes the whole block down.

use super::descend::{Codes, Walk};
use super::forest::{Forest, LEAF_CUT, Node};
use crate::error::{Error, Result};
use rayon::prelude::*;

/// Rows of a block: enough that a tree is worth loading, few enough that the codes stay in the cache.
const BLOCK: usize = 8192;

/// Working memory of [`Forest::predict_block`], to be used again for the next block.
#[derive(Clone, Debug, Default)]
pub struct PredictScratch {
    pub(super) narrow: Codes<u8>,
    wide: Codes<u16>,
    pub(super) walk: Walk,
    /// Rows with additional columns, and scores, of boosted trees.
    pub(super) extended: Vec<f32>,
    pub(super) scores: Vec<f32>,
}

impl Forest {
    /// Class probabilities of `rows` (row-major, [`Forest::width`] values a row), written row-major to `out`
    /// ([`Forest::classes`] values a row). Serial; for callers that are parallel by block.
    ///
    /// # Errors
    /// Lengths that do not fit.
    pub fn predict_block(&self, rows: &[f32], scratch: &mut PredictScratch, out: &mut [f32]) -> Result<()> {
        self.check_lengths(rows, out)?;
        out.fill(0.0);
        for (rows, out) in rows.chunks(BLOCK * self.width()).zip(out.chunks_mut(BLOCK * self.classes)) {
            if self.binning.fits_u8() {
                self.binning.bin_codes(rows, &mut scratch.narrow);
                self.add_trees(&scratch.narrow, &mut scratch.walk, out);
            } else {
                self.binning.bin_codes_wide(rows, &mut scratch.wide);
                self.add_trees(&scratch.wide, &mut scratch.walk, out);
            }
            let trees = self.trees().max(1) as f32;
            out.iter_mut().for_each(|p| *p /= trees);
        }
        Ok(())
    }

    /// As [`Forest::predict_block`], in parallel over blocks.
    pub fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
        self.check_lengths(rows, out)?;
        rows.par_chunks(BLOCK * self.width())
            .zip(out.par_chunks_mut(BLOCK * self.classes))
            .try_for_each_init(PredictScratch::default, |scratch, (rows, out)| self.predict_block(rows, scratch, out))
    }

    /// The most probable class of every row; the smaller class where two are equal.
    ///
    /// # Errors
    /// A length that does not fit.
    pub fn predict(&self, rows: &[f32]) -> Result<Vec<u16>> {
        if self.width() == 0 || !rows.len().is_multiple_of(self.width()) {
            return Err(Error::ModelMismatch(format!(
                "{} values are not whole rows of {} features",
                rows.len(),
                self.width()
            )));
        }
        let mut probabilities = vec![0.0; rows.len() / self.width() * self.classes];
        self.predict_proba(rows, &mut probabilities)?;
        Ok(probabilities.chunks_exact(self.classes).map(|row| largest(row) as u16).collect())
    }

    fn check_lengths(&self, rows: &[f32], out: &[f32]) -> Result<()> {
        let count = rows.len() / self.width().max(1);
        if count * self.width() == rows.len() && count * self.classes == out.len() {
            return Ok(());
        }
        Err(Error::ModelMismatch(format!(
            "{} feature values and {} probabilities do not make whole rows of {} features and {} classes",
            rows.len(),
            out.len(),
            self.width(),
            self.classes
        )))
    }

    fn add_trees<C: Copy + Default + Into<u16>>(&self, codes: &Codes<C>, walk: &mut Walk, out: &mut [f32]) {
        let classes = self.classes;
        for &root in &self.roots {
            walk.tree(&self.nodes, root, codes, |rows, leaf| {
                let leaf = leaf as usize;
                if leaf < classes {
                    rows.iter().for_each(|&row| out[usize::from(row) * classes + leaf] += 1.0);
                    return;
                }
                let shares = &self.leaves[leaf * classes..(leaf + 1) * classes];
                for &row in rows {
                    let out = &mut out[usize::from(row) * classes..][..classes];
                    out.iter_mut().zip(shares).for_each(|(p, &share)| *p += share);
                }
            });
        }
    }

    #[inline]
    pub(super) fn node(&self, at: u32) -> Node {
        self.nodes[at as usize]
    }

    /// The leaf row that one row of codes falls into.
    pub(super) fn leaf_of(&self, root: u32, code: impl Fn(usize) -> u16) -> &[f32] {
        let mut node = self.node(root);
        while node.cut != LEAF_CUT {
            node = self.node(node.left + u32::from(code(usize::from(node.feature)) > node.cut));
        }
        let row = node.left as usize * self.classes;
        &self.leaves[row..row + self.classes]
    }
}

/// Index of the largest value, the first of equals.
pub(super) fn largest(row: &[f32]) -> usize {
    (1..row.len()).fold(0, |best, c| if row[c] > row[best] { c } else { best })
}
