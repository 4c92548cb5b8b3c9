//! Boosted trees: quantisation, trees and leaf values.

use super::growing::data::BoostingData;
use super::growing::split::Split;
use super::growing::tree::GrownTree;
use super::loss::Loss;
use crate::classification::binning::Binning;
use crate::classification::nodes::{GrownNode, LEAF_CUT, Node};
use crate::error::{Error, Result};

/// Gradient-boosted trees on quantised features.
///
/// Every tree adds a leaf value to the score of one class; the probabilities are the softmax of the scores. Two classes
/// share one score, that of the second class, through the logistic function. A sample goes right at a node if its value
/// exceeds the threshold; missing values (NaN) go to the side of larger gain, or left if the feature was never missing
/// in training.
#[derive(Clone, Debug, PartialEq)]
pub struct Boosting {
    pub(in super::super) classes: usize,
    pub(in super::super) width: usize,
    /// Classes with a probability above 0, ascending: those of the training samples.
    pub(in super::super) present: Vec<u16>,
    /// Score before the first tree, one for each group of trees.
    pub(in super::super) start: Vec<f32>,
    /// Features whose missing values go right at some node. Each has a twin column after the `width` features.
    pub(in super::super) twins: Vec<u16>,
    /// Thresholds of the `width` features and the twins.
    pub(in super::super) binning: Binning,
    /// All trees, one after the other; children come after their parents; a leaf has its own index in `left`.
    pub(in super::super) nodes: Vec<Node>,
    /// First node of every tree; tree `t` adds to the score of group `t % groups`.
    pub(in super::super) roots: Vec<u32>,
    /// Value of a leaf; 0 at splits.
    pub(in super::super) leaf_values: Vec<f32>,
    pub(in super::super) importance: Vec<f64>,
}

impl Boosting {
    /// Number of trees.
    pub fn trees(&self) -> usize {
        self.roots.len()
    }

    /// Number of nodes of all trees, leaves included.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Features that occur in at least one split, ascending.
    pub fn used_features(&self) -> Vec<usize> {
        let twin = |f: usize| self.twins.iter().any(|&t| usize::from(t) == f);
        (0..self.width).filter(|&f| !self.binning.cuts(f).is_empty() || twin(f)).collect()
    }

    /// Number of scores of a sample.
    pub(in super::super) fn groups(&self) -> usize {
        self.loss().groups()
    }

    pub(super) fn loss(&self) -> Loss {
        Loss { classes: self.present.len() }
    }

    /// Assembles grown trees: the thresholds that occur become the quantisation.
    pub(super) fn assemble(data: &BoostingData<'_>, trees: &[GrownTree]) -> Result<Self> {
        let learned = &data.blocks.binning;
        let width = learned.width();
        let split = |node: &GrownNode<Split>| if let GrownNode::Split(s, _) = node { Some(*s) } else { None };
        let splits = || trees.iter().flat_map(|tree| &tree.nodes).filter_map(split);
        let twins: std::collections::BTreeSet<u16> =
            splits().filter(|s| s.missing_right).map(|s| s.feature as u16).collect();
        let twins: Vec<u16> = twins.into_iter().collect();
        if width + twins.len() > 65_534 {
            return Err(Error::input(format!("{width} features, {} with missing values; too many", twins.len())));
        }
        let column = |s: &Split| match s.missing_right {
            true => width + twins.binary_search(&(s.feature as u16)).unwrap_or_default(),
            false => s.feature,
        };
        let mut cuts = vec![Vec::new(); width + twins.len()];
        let mut importance = vec![0.0; width];
        for split in splits() {
            cuts[column(&split)].push(learned.cuts(split.feature)[usize::from(split.cut)]);
            importance[split.feature] += split.gain;
        }
        for cuts in &mut cuts {
            cuts.sort_unstable_by(f32::total_cmp);
            cuts.dedup();
        }
        let total: f64 = importance.iter().sum();
        importance.iter_mut().filter(|_| total > 0.0).for_each(|i| *i /= total);
        let start = data.start.iter().map(|&s| s as f32).collect();
        let mut model = Self {
            classes: data.all_classes,
            width,
            present: data.present.clone(),
            start,
            binning: Binning::new(cuts)?,
            nodes: Vec::new(),
            roots: Vec::new(),
            leaf_values: Vec::new(),
            importance,
            twins: twins.clone(),
        };
        trees.iter().for_each(|tree| model.append(tree, learned, column));
        Ok(model)
    }

    fn append(&mut self, tree: &GrownTree, learned: &Binning, column: impl Fn(&Split) -> usize) {
        let first = self.nodes.len() as u32;
        self.roots.push(first);
        for node in &tree.nodes {
            let (node, value) = match node {
                GrownNode::Leaf(leaf) => {
                    let node = Node { left: self.nodes.len() as u32, feature: 0, cut: LEAF_CUT };
                    (node, tree.leaf_values[*leaf as usize])
                }
                GrownNode::Split(split, left) => {
                    let column = column(split);
                    let threshold = learned.cuts(split.feature)[usize::from(split.cut)];
                    let cut = self.binning.cuts(column).partition_point(|&t| t < threshold) as u16;
                    (Node { left: first + left, feature: column as u16, cut }, 0.0)
                }
            };
            self.nodes.push(node);
            self.leaf_values.push(value);
        }
    }
}
