//! One tree: derivatives, growth, leaf values, new scores.

use crate::classification::boosting::growing::data::{BoostingData, CHUNK};
use crate::classification::boosting::growing::grow::{HistogramPool, LeafwiseGrower, LeafwiseTree};
use crate::classification::boosting::growing::histogram::{Cell, Scale};
use crate::classification::boosting::growing::split::{Split, SplitRules};
use crate::classification::nodes::GrownNode;
use crate::error::Result;
use crate::parallel::{map_each, map_watched};
use crate::random::stream;
use rayon::prelude::*;

/// One tree and the value of each of its leaves.
#[derive(Clone, Debug)]
pub(in crate::classification::boosting) struct GrownTree {
    pub(in crate::classification::boosting) nodes: Vec<GrownNode<Split>>,
    pub(in crate::classification::boosting) leaf_values: Vec<f32>,
}

/// First random stream for the draws of columns.
const COLUMNS: u64 = 1 << 41;

/// One tree to be grown.
pub(in crate::classification::boosting) struct TreeFit<'a> {
    pub(in crate::classification::boosting) data: &'a BoostingData<'a>,
    /// The score that the tree adds to.
    pub(in crate::classification::boosting) group: usize,
    /// Number of the tree, which selects its random stream.
    pub(in crate::classification::boosting) seed: u64,
    /// Log-sum-exp of the scores of every row.
    pub(in crate::classification::boosting) norms: &'a [f64],
}

impl TreeFit<'_> {
    /// Grows the tree and adds its leaf values to the scores of all rows.
    pub(in crate::classification::boosting) fn tree(
        &self,
        bag: &[u32],
        scores: &mut [f64],
        pool: &mut HistogramPool,
    ) -> Result<GrownTree> {
        let data = self.data;
        let derivatives = self.derivatives(bag, scores)?;
        let scale = Scale::of(&derivatives);
        let samples: Vec<Cell> = map_watched(derivatives.len(), data.monitor, |i| scale.cell(derivatives[i]))?;
        let allowed = self.columns();
        let rules = SplitRules { blocks: &data.blocks, params: data.params, scale, allowed: &allowed };
        let grower = LeafwiseGrower { rules, samples: &samples, monitor: data.monitor, pool };
        let tree = grower.grow(bag.to_vec())?;
        let leaf_values = self.leaf_values(&tree, &derivatives)?;
        self.add(&tree, &leaf_values, scores)?;
        Ok(GrownTree { nodes: tree.nodes, leaf_values })
    }

    /// Weighted first and second derivatives of every row of the table; 0 for rows outside the bag.
    fn derivatives(&self, bag: &[u32], scores: &[f64]) -> Result<Vec<[f32; 2]>> {
        let data = self.data;
        let of_row = |row: usize| {
            let class = usize::from(data.classes[row]);
            let (g, h) = data.loss.derivatives(scores[row] - self.norms[row], self.group, class);
            let w = f64::from(data.weights[row]);
            [(w * g) as f32, (w * h) as f32]
        };
        if bag.len() == scores.len() {
            return map_watched(scores.len(), data.monitor, of_row);
        }
        let own: Vec<[f32; 2]> = map_watched(bag.len(), data.monitor, |i| of_row(bag[i] as usize))?;
        let mut all = vec![[0.0; 2]; scores.len()];
        bag.iter().zip(own).for_each(|(&row, d)| all[row as usize] = d);
        Ok(all)
    }

    /// Value of every leaf: -G / (H + lambda) times the learning rate, from the exact derivatives.
    fn leaf_values(&self, tree: &LeafwiseTree, derivatives: &[[f32; 2]]) -> Result<Vec<f32>> {
        let params = self.data.params;
        let value = |leaf: &std::ops::Range<usize>| {
            let rows = tree.rows[leaf.clone()].iter();
            let [g, h] = rows.fold([0.0; 2], |[g, h], &row| {
                let d = derivatives[row as usize];
                [g + f64::from(d[0]), h + f64::from(d[1])]
            });
            let step = if h + params.lambda > 1e-30 { -g / (h + params.lambda) } else { 0.0 };
            (params.learning_rate * step) as f32
        };
        map_each(&tree.leaves, self.data.monitor, |leaf| Ok(value(leaf)))
    }

    fn add(&self, tree: &LeafwiseTree, leaf_values: &[f32], scores: &mut [f64]) -> Result<()> {
        let data = self.data;
        for (leaf, &value) in tree.leaves.iter().zip(leaf_values) {
            data.monitor.check()?;
            tree.rows[leaf.clone()].iter().for_each(|&row| scores[row as usize] += f64::from(value));
        }
        if tree.rows.len() == scores.len() {
            return Ok(());
        }
        let mut outside = vec![true; scores.len()];
        tree.rows.iter().for_each(|&row| outside[row as usize] = false);
        let others = scores.par_iter_mut().with_min_len(CHUNK).zip(&outside).enumerate().filter(|(_, (_, o))| **o);
        others.for_each(|(row, (score, _))| *score += f64::from(leaf_values[tree.leaf(&data.blocks, row as u32)]));
        data.monitor.check()
    }

    /// The features that the tree may split on.
    fn columns(&self) -> Vec<bool> {
        let (width, share) = (self.data.blocks.binning.width(), self.data.params.column_fraction);
        let wanted = ((share * width as f64).round() as usize).clamp(1, width);
        let mut allowed = vec![false; width];
        let picks = stream(self.data.params.seed, COLUMNS + self.seed).choose(width, wanted);
        picks.into_iter().for_each(|f| allowed[f as usize] = true);
        allowed
    }
}
