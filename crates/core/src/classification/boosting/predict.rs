//! Prediction: a block of rows is quantised once, then every tree adds its leaf values.

use super::model::Boosting;
use super::sweep::{NARROW, Sweep};
use crate::classification::forest::descend::Walk;
use crate::classification::learner::{PartCount, Predictor, check_lengths};
use crate::classification::nodes::LEAF_CUT;
use crate::classification::quantise::{CodeBlock, TILE};
use crate::error::Result;
use rayon::prelude::*;

/// Rows of a block, few enough that their codes and scores stay in the cache.
const BLOCK: usize = 2048;

/// Scratch memory of the prediction by boosted trees.
#[derive(Clone, Debug, Default)]
pub struct BoostingScratch {
    codes: CodeBlock<u8>,
    walk: Walk,
    /// Rows with twin columns.
    extended: Vec<f32>,
    scores: Vec<f32>,
}

/// Scores of a block of rows: a column of `stride` rows for each group of trees.
struct Scores<'a> {
    stride: usize,
    values: &'a [f32],
}

impl Predictor for Boosting {
    type Scratch = BoostingScratch;

    fn classes(&self) -> usize {
        self.classes
    }

    fn width(&self) -> usize {
        self.width
    }

    fn parts(&self) -> Vec<PartCount> {
        vec![PartCount { kind: "trees", count: self.trees() }, PartCount { kind: "nodes", count: self.nodes() }]
    }

    /// Each feature's share in the gain of all splits.
    fn importance(&self) -> &[f64] {
        &self.importance
    }

    fn retain_used(mut self) -> (Self, Vec<usize>) {
        let mut used = self.used_features();
        if used.is_empty() {
            used.push(0);
        }
        let columns: Vec<usize> = used.iter().copied().chain(self.width..self.binning.width()).collect();
        let position = |old: u16| columns.binary_search(&usize::from(old)).unwrap_or_default() as u16;
        for node in self.nodes.iter_mut().filter(|n| n.cut != LEAF_CUT) {
            node.feature = position(node.feature);
        }
        self.twins.iter_mut().for_each(|t| *t = position(*t));
        self.binning = self.binning.select(&columns);
        self.importance = used.iter().map(|&f| self.importance[f]).collect();
        self.width = used.len();
        (self, used)
    }

    fn predict_block(&self, rows: &[f32], scratch: &mut BoostingScratch, out: &mut [f32]) -> Result<()> {
        check_lengths(self, rows, out)?;
        for (rows, out) in rows.chunks(BLOCK * self.width).zip(out.chunks_mut(BLOCK * self.classes)) {
            self.block(rows, scratch, out);
        }
        Ok(())
    }

    fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()> {
        check_lengths(self, rows, out)?;
        rows.par_chunks(BLOCK * self.width)
            .zip(out.par_chunks_mut(BLOCK * self.classes))
            .for_each_init(BoostingScratch::default, |scratch, (rows, out)| self.block(rows, scratch, out));
        Ok(())
    }
}

impl Boosting {
    fn block(&self, rows: &[f32], scratch: &mut BoostingScratch, out: &mut [f32]) {
        let count = rows.len() / self.width;
        let stride = count.next_multiple_of(TILE);
        let BoostingScratch { codes, walk, extended, scores } = scratch;
        scores.clear();
        self.start.iter().for_each(|&s| scores.extend(std::iter::repeat_n(s, stride)));
        let rows = if self.twins.is_empty() { rows } else { self.extend(rows, extended) };
        if self.is_narrow() {
            self.binning.bin_tiles(rows, codes);
            pulp::Arch::new().dispatch(Sweep { model: self, codes, stride, scores });
        } else {
            self.binning.bin_rows(rows, codes);
            self.add_trees(codes, walk, scores);
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
