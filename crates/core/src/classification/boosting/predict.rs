//! Prediction: a block of rows is quantised once, then every tree adds its leaf values.

use super::super::quantise::{CodeBlock, TILE};
use super::model::Boosting;
use super::sweep::{NARROW, Sweep};
use crate::classification::forest::descend::Walk;
use crate::classification::forest::predict::{PredictScratch, argmax};
use crate::error::{Error, Result};
use rayon::prelude::*;

/// Rows of a block, few enough that their codes and scores stay in the cache.
const BLOCK: usize = 2048;

/// Scores of a block of rows: a column of `stride` rows for each group of trees.
struct Scores<'a> {
    stride: usize,
    values: &'a [f32],
}

impl Boosting {
    /// Class probabilities of `rows` (row-major, [`Boosting::width`] values a row), written row-major to `out`
    /// ([`Boosting::classes`] values a row). Runs on the calling thread; for callers that parallelise over blocks.
    ///
    /// # Errors
    /// If a length does not fit.
    pub fn predict_block(&self, rows: &[f32], scratch: &mut PredictScratch, out: &mut [f32]) -> Result<()> {
        self.check_lengths(rows, out)?;
        for (rows, out) in rows.chunks(BLOCK * self.width).zip(out.chunks_mut(BLOCK * self.classes)) {
            self.block(rows, scratch, out);
        }
        Ok(())
    }

    /// As [`Boosting::predict_block`], in parallel over blocks.
    ///
    /// # Errors
    /// If a length does not fit.
    pub fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
        self.check_lengths(rows, out)?;
        rows.par_chunks(BLOCK * self.width)
            .zip(out.par_chunks_mut(BLOCK * self.classes))
            .for_each_init(PredictScratch::default, |scratch, (rows, out)| self.block(rows, scratch, out));
        Ok(())
    }

    /// The most probable class of every row; the smaller class in a tie.
    ///
    /// # Errors
    /// If the length does not fit.
    pub fn predict(&self, rows: &[f32]) -> Result<Vec<u16>> {
        let mut probabilities = vec![0.0; rows.len() / self.width * self.classes];
        self.predict_proba(rows, &mut probabilities)?;
        Ok(probabilities.chunks_exact(self.classes).map(|row| argmax(row) as u16).collect())
    }

    fn check_lengths(&self, rows: &[f32], out: &[f32]) -> Result<()> {
        let count = rows.len() / self.width;
        if count * self.width == rows.len() && count * self.classes == out.len() {
            return Ok(());
        }
        Err(Error::ModelMismatch(format!(
            "{} feature values and {} probabilities do not make whole rows of {} features and {} classes",
            rows.len(),
            out.len(),
            self.width,
            self.classes
        )))
    }

    fn block(&self, rows: &[f32], scratch: &mut PredictScratch, out: &mut [f32]) {
        let count = rows.len() / self.width;
        let stride = count.next_multiple_of(TILE);
        let PredictScratch { narrow, walk, extended, scores, .. } = scratch;
        scores.clear();
        self.start.iter().for_each(|&s| scores.extend(std::iter::repeat_n(s, stride)));
        let rows = if self.twins.is_empty() { rows } else { self.extend(rows, extended) };
        if self.is_narrow() {
            self.binning.bin_tiles(rows, narrow);
            pulp::Arch::new().dispatch(Sweep { model: self, codes: narrow, stride, scores });
        } else {
            self.binning.bin_rows(rows, narrow);
            self.add_trees(narrow, walk, scores);
        }
        self.probabilities(&Scores { stride, values: scores }, out);
    }

    /// The rows extended by the twin columns, in which missing values exceed every threshold.
    fn extend<'a>(&self, rows: &[f32], to: &'a mut Vec<f32>) -> &'a [f32] {
        to.clear();
        for row in rows.chunks_exact(self.width) {
            to.extend_from_slice(row);
            let twins = self.twins.iter().map(|&t| row[usize::from(t)]);
            to.extend(twins.map(|x| if x.is_nan() { f32::INFINITY } else { x }));
        }
        to
    }

    fn is_narrow(&self) -> bool {
        let ends = self.roots.iter().skip(1).copied().chain([self.nodes.len() as u32]);
        self.roots.iter().zip(ends).all(|(&root, end)| (end - root) as usize <= NARROW)
    }

    fn add_trees(&self, codes: &CodeBlock<u8>, walk: &mut Walk, scores: &mut [f32]) {
        let stride = codes.rows.next_multiple_of(TILE);
        for (tree, &root) in self.roots.iter().enumerate() {
            let column = tree % self.groups() * stride;
            walk.tree(&self.nodes, root, codes);
            let scores = scores[column..].iter_mut();
            scores.zip(&walk.at).for_each(|(score, &leaf)| *score += self.leaf_values[leaf as usize]);
        }
    }

    /// Softmax or logistic function of the scores.
    fn probabilities(&self, scores: &Scores<'_>, out: &mut [f32]) {
        let Scores { stride, values: scores } = *scores;
        out.fill(0.0);
        let class = |i: usize| usize::from(self.present[i]);
        for (row, out) in out.chunks_exact_mut(self.classes).enumerate() {
            match self.present.len() {
                1 => out[class(0)] = 1.0,
                2 => {
                    let p = 1.0 / (1.0 + (-scores[row]).exp());
                    (out[class(0)], out[class(1)]) = (1.0 - p, p);
                }
                groups => {
                    let score = |g: usize| scores[g * stride + row];
                    let top = (0..groups).map(score).fold(f32::NEG_INFINITY, f32::max);
                    let mut sum = 0.0;
                    for g in 0..groups {
                        let e = (score(g) - top).exp();
                        out[class(g)] = e;
                        sum += e;
                    }
                    out.iter_mut().for_each(|p| *p /= sum);
                }
            }
        }
    }
}
