//! One tree: derivatives, growth, leaf values, new scores.

use super::fit::{CHUNK, Course};
use super::grow::{Grower, Pool, Tree};
use super::histogram::{Cell, Scale};
use super::model::Grown;
use super::split::Rules;
use crate::error::Result;
use crate::random::stream;
use rayon::prelude::*;

/// First random stream for the draws of columns.
const COLUMNS: u64 = 1 << 41;

/// One tree to be grown.
pub(super) struct Lesson<'a> {
    pub(super) course: &'a Course<'a>,
    pub(super) group: usize,
    pub(super) seed: u64,
    pub(super) norms: &'a [f64],
}

impl Lesson<'_> {
    /// Grows the tree and adds its leaf values to the scores of all rows.
    pub(super) fn tree(&self, bag: &[u32], scores: &mut [f64], pool: &mut Pool) -> Result<Grown> {
        let course = self.course;
        let derivatives = self.derivatives(bag, scores);
        let scale = Scale::of(&derivatives);
        let samples: Vec<Cell> = derivatives.par_iter().with_min_len(CHUNK).map(|&d| scale.cell(d)).collect();
        let allowed = self.columns();
        let rules = Rules { blocks: &course.blocks, params: course.params, scale, allowed: &allowed };
        let grower = Grower { rules, samples: &samples, monitor: course.monitor, pool };
        let tree = grower.grow(bag.to_vec())?;
        let answers = self.answers(&tree, &derivatives);
        self.add(&tree, &answers, scores);
        Ok(Grown { twigs: tree.twigs, answers })
    }

    /// Weighted first and second derivatives of every row of the table; 0 for rows outside the bag.
    fn derivatives(&self, bag: &[u32], scores: &[f64]) -> Vec<[f32; 2]> {
        let course = self.course;
        let of_row = |row: usize| {
            let at = (scores[row], self.norms[row]);
            let (g, h) = course.loss.derivatives(at, self.group, usize::from(course.classes[row]));
            let w = f64::from(course.weights[row]);
            [(w * g) as f32, (w * h) as f32]
        };
        if bag.len() == scores.len() {
            return (0..scores.len()).into_par_iter().with_min_len(CHUNK).map(of_row).collect();
        }
        let own: Vec<[f32; 2]> = bag.par_iter().with_min_len(CHUNK).map(|&r| of_row(r as usize)).collect();
        let mut all = vec![[0.0; 2]; scores.len()];
        bag.iter().zip(own).for_each(|(&row, d)| all[row as usize] = d);
        all
    }

    /// Value of every leaf: -G / (H + lambda) times the learning rate, from the exact derivatives.
    fn answers(&self, tree: &Tree, derivatives: &[[f32; 2]]) -> Vec<f32> {
        let params = self.course.params;
        let answer = |leaf: &std::ops::Range<usize>| {
            let rows = tree.rows[leaf.clone()].iter();
            let [g, h] = rows.fold([0.0; 2], |[g, h], &row| {
                let d = derivatives[row as usize];
                [g + f64::from(d[0]), h + f64::from(d[1])]
            });
            let step = if h + params.lambda > 1e-30 { -g / (h + params.lambda) } else { 0.0 };
            (params.learning_rate * step) as f32
        };
        tree.leaves.iter().map(answer).collect()
    }

    fn add(&self, tree: &Tree, answers: &[f32], scores: &mut [f64]) {
        let course = self.course;
        for (leaf, &answer) in tree.leaves.iter().zip(answers) {
            tree.rows[leaf.clone()].iter().for_each(|&row| scores[row as usize] += f64::from(answer));
        }
        if tree.rows.len() == scores.len() {
            return;
        }
        let mut outside = vec![true; scores.len()];
        tree.rows.iter().for_each(|&row| outside[row as usize] = false);
        let others = scores.par_iter_mut().with_min_len(CHUNK).zip(&outside).enumerate().filter(|(_, (_, o))| **o);
        others.for_each(|(row, (score, _))| *score += f64::from(answers[tree.leaf(&course.blocks, row as u32)]));
    }

    /// The features that the tree may split on.
    fn columns(&self) -> Vec<bool> {
        let (width, share) = (self.course.blocks.binning.width(), self.course.params.column_fraction);
        let wanted = ((share * width as f64).round() as usize).clamp(1, width);
        let mut allowed = vec![false; width];
        let picks = stream(self.course.params.seed, COLUMNS + self.seed).choose(width, wanted);
        picks.into_iter().for_each(|f| allowed[f as usize] = true);
        allowed
    }
}
