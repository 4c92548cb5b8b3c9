//! The forest: quantisation, trees and leaves.

pub(in crate::classification) mod bagging;
pub(in crate::classification) mod codec;
pub(in crate::classification) mod compact;
mod crown;
pub(in crate::classification) mod descend;
pub(in crate::classification) mod growing;
pub(in crate::classification) mod importance;
mod join;
pub(in crate::classification) mod predict;
mod step;
pub(in crate::classification) mod vote;

use self::compact::{Compact, WINDOW};
use self::growing::tree::{ForestTree, ThresholdSplit};
use crate::classification::Predictor;
use crate::classification::binning::Binning;
use crate::classification::nodes::{GrownNode, LEAF_CUT, Node, Trees};
use crate::error::{Error, Result};

/// The trees in the layout that [`Forest::predict_block`] uses.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::classification) enum Descent {
    Compact(Compact),
    /// The nodes, where a leaf has its own index in `left`.
    Large(Vec<Node>),
}

impl Default for Descent {
    fn default() -> Self {
        Self::Large(Vec::new())
    }
}

/// A random forest on quantised features.
///
/// L. Breiman, *Random forests*, Machine Learning 45, 2001, doi:10.1023/A:1010933404324. The probabilities of a sample
/// are the mean over the trees of the class shares in the leaves it reaches. A sample goes right at a node if its value
/// exceeds the threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct Forest {
    pub(in crate::classification) classes: usize,
    pub(in crate::classification) binning: Binning,
    /// All trees, one after the other; children come after their parents.
    pub(crate) nodes: Vec<Node>,
    /// The same trees in the layout for prediction.
    pub(in crate::classification) descent: Descent,
    /// First node of every tree.
    pub(crate) roots: Vec<u32>,
    /// Rows of `classes` probabilities; the first `classes` rows are those of pure leaves.
    pub(crate) leaves: Vec<f32>,
    pub(crate) importance: Vec<f64>,
}

impl Forest {
    /// Number of trees.
    pub fn trees(&self) -> usize {
        self.roots.len()
    }

    /// Number of nodes of all trees, leaves included.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The quantisation: the thresholds of all trees.
    pub fn binning(&self) -> &Binning {
        &self.binning
    }

    /// Features that occur in at least one split, ascending.
    pub fn used_features(&self) -> Vec<usize> {
        (0..self.width()).filter(|&f| !self.binning.cuts(f).is_empty()).collect()
    }

    /// Assembles trained trees: the thresholds that occur become the quantisation.
    pub(in crate::classification) fn assemble(trees: &[ForestTree], width: usize, classes: usize) -> Result<Self> {
        let binning = thresholds(trees, width)?;
        let total: usize = trees.iter().map(|t| t.nodes.len()).sum();
        if total > u32::MAX as usize {
            return Err(Error::input(format!("the forest has {total} nodes; at most 2^32 are possible")));
        }
        let mut forest = Self {
            classes,
            binning,
            nodes: Vec::with_capacity(total),
            descent: Descent::default(),
            roots: Vec::with_capacity(trees.len()),
            leaves: one_hot(classes),
            importance: mean_importance(trees, width),
        };
        trees.iter().for_each(|tree| forest.append(tree));
        forest.prepare();
        Ok(forest)
    }

    /// Builds the layout for prediction; to be called when nodes or features have changed.
    pub(in crate::classification) fn prepare(&mut self) {
        let trees = Trees { nodes: &self.nodes, roots: &self.roots, binning: &self.binning };
        let own = |(i, node): (usize, &Node)| match node.cut {
            LEAF_CUT => Node { left: i as u32, ..*node },
            _ => *node,
        };
        self.descent = match Compact::new(trees, WINDOW) {
            Some(trees) => Descent::Compact(trees),
            None => Descent::Large(self.nodes.iter().enumerate().map(own).collect()),
        };
    }

    fn append(&mut self, tree: &ForestTree) {
        let first = self.nodes.len() as u32;
        let own_rows = (self.leaves.len() / self.classes - self.classes) as u32;
        self.roots.push(first);
        for node in &tree.nodes {
            self.nodes.push(match *node {
                GrownNode::Leaf(row) if (row as usize) < self.classes => Node { left: row, feature: 0, cut: LEAF_CUT },
                GrownNode::Leaf(row) => Node { left: row + own_rows, feature: 0, cut: LEAF_CUT },
                GrownNode::Split(ThresholdSplit { feature, threshold }, left) => {
                    let cut = self.binning.cuts(usize::from(feature)).partition_point(|&t| t < threshold);
                    Node { left: left + first, feature, cut: cut as u16 }
                }
            });
        }
        self.leaves.extend_from_slice(&tree.leaves);
    }
}

fn one_hot(classes: usize) -> Vec<f32> {
    (0..classes * classes).map(|i| f32::from(u8::from(i % (classes + 1) == 0))).collect()
}

fn thresholds(trees: &[ForestTree], width: usize) -> Result<Binning> {
    let mut cuts = vec![Vec::new(); width];
    for node in trees.iter().flat_map(|t| &t.nodes) {
        if let GrownNode::Split(split, _) = node {
            cuts[usize::from(split.feature)].push(split.threshold);
        }
    }
    for cuts in &mut cuts {
        cuts.sort_unstable_by(f32::total_cmp);
        cuts.dedup();
    }
    Binning::new(cuts)
}

fn mean_importance(trees: &[ForestTree], width: usize) -> Vec<f64> {
    let mut mean = vec![0.0; width];
    for tree in trees {
        let sum: f64 = tree.importance.iter().sum();
        if sum > 0.0 {
            mean.iter_mut().zip(&tree.importance).for_each(|(m, i)| *m += i / sum);
        }
    }
    let sum: f64 = mean.iter().sum();
    if sum > 0.0 {
        mean.iter_mut().for_each(|m| *m /= sum);
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::testing::blobs;
    use crate::classification::{
        Bootstrap, ClassWeight, Criterion, ForestParams, MaxFeatures, Predictor, Samples, Splitter, Trainer,
    };
    use crate::parallel::Monitor;
    use crate::random::stream;

    fn fit(samples: &Samples<'_>, params: &ForestParams) -> Forest {
        Forest::fit(samples, params, &Monitor::default()).unwrap()
    }

    fn single(splitter: Splitter) -> ForestParams {
        ForestParams { trees: 1, bootstrap: Bootstrap::None, splitter, ..ForestParams::breiman() }
    }

    fn probabilities(forest: &Forest, rows: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; rows.len() / forest.width() * forest.classes()];
        forest.predict_proba(rows, &mut out).unwrap();
        out
    }

    #[test]
    fn an_unpruned_tree_reproduces_the_labels_of_distinct_samples() {
        let mut random = stream(5, 0);
        let features: Vec<f32> = (0..3 * 2000).map(|_| random.uniform() as f32).collect();
        let labels: Vec<u16> = (0..2000).map(|_| random.below(4) as u16).collect();
        let samples = Samples { features: &features, width: 3, labels: &labels, weights: None, classes: 4 };
        for trainer in [Trainer::Breiman, Trainer::Ethz] {
            let params = ForestParams { trainer, max_features: MaxFeatures::All, ..single(Splitter::Exact) };
            assert_eq!(fit(&samples, &params).predict(&features).unwrap(), labels);
        }
    }

    #[test]
    fn histograms_agree_with_the_exact_splitter_while_every_value_has_its_bin() {
        let data = blobs(3000, 6, 4, 0.125);
        for criterion in [Criterion::Gini, Criterion::Entropy] {
            for min_samples_leaf in [1, 7] {
                let params = |s| ForestParams { trees: 3, criterion, min_samples_leaf, ..single(s) };
                let exact = fit(&data.samples(), &params(Splitter::Exact));
                let binned = fit(&data.samples(), &params(Splitter::Histogram));
                assert_eq!(exact.nodes(), binned.nodes());
                assert!(probabilities(&exact, &data.features) == probabilities(&binned, &data.features));
            }
        }
    }

    #[test]
    fn strictly_rising_transforms_change_no_prediction() {
        let data = blobs(2000, 5, 3, 0.0);
        let warped: Vec<f32> = data.features.iter().map(|v| v.powi(3) * 10.0 + v).collect();
        let samples = data.samples();
        let plain = fit(&samples, &single(Splitter::Exact));
        let other = fit(&Samples { features: &warped, ..samples }, &single(Splitter::Exact));
        assert_eq!(probabilities(&plain, &data.features), probabilities(&other, &warped));
    }

    #[test]
    fn probabilities_sum_to_one_and_name_most_samples_right() {
        let data = blobs(6000, 8, 5, 0.0);
        let (train, test) = data.features.split_at(4000 * 8);
        let samples = Samples { features: train, labels: &data.labels[..4000], ..data.samples() };
        for params in [ForestParams::ethz(), ForestParams { trees: 30, ..ForestParams::breiman() }] {
            let (forest, report) = Forest::fit_with_report(&samples, &params, &Monitor::default()).unwrap();
            let rows = probabilities(&forest, test);
            assert!(rows.chunks(5).all(|r| (r.iter().sum::<f32>() - 1.0).abs() < 1e-5));
            let named = forest.predict(test).unwrap();
            let right = named.iter().zip(&data.labels[4000..]).filter(|(a, b)| a == b).count() as f64 / 2000.0;
            let oob = report.oob_score.unwrap();
            assert!(right > 0.6 && (right - oob).abs() < 0.04, "{right} {oob}");
            let informative: f64 = forest.importance().iter().step_by(2).sum();
            assert!((forest.importance().iter().sum::<f64>() - 1.0).abs() < 1e-9 && informative > 0.5);
        }
    }

    #[test]
    fn every_number_of_threads_gives_the_same_forest() {
        let data = blobs(9000, 7, 4, 0.0);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let forest = fit(&data.samples(), &ForestParams { trees: 7, ..ForestParams::default() });
                let rows = probabilities(&forest, &data.features);
                (forest, rows)
            })
        };
        let one = run(1);
        assert!([2, 3, 8].into_iter().all(|threads| run(threads) == one));
    }

    #[test]
    fn unused_features_can_go_without_changing_an_answer() {
        let mut data = blobs(500, 40, 3, 0.0);
        data.features.chunks_mut(40).for_each(|row| row[4] = 1.5);
        let params = ForestParams { trees: 2, max_depth: Some(3), ..ForestParams::default() };
        let forest = fit(&data.samples(), &params);
        let (small, used) = forest.clone().retain_used();
        assert!(used.len() < 40 && !used.contains(&4) && used == forest.used_features());
        let kept: Vec<f32> = data.features.chunks(40).flat_map(|row| used.iter().map(|&f| row[f])).collect();
        assert_eq!(probabilities(&forest, &data.features), probabilities(&small, &kept));
    }

    #[test]
    fn samples_of_weight_zero_count_as_absent() {
        let data = blobs(800, 4, 3, 0.0);
        let weights: Vec<f32> = (0..800).map(|i| f32::from(u8::from(i < 600))).collect();
        let samples = data.samples();
        let kept = Samples { features: &data.features[..2400], labels: &data.labels[..600], ..samples };
        let params = ForestParams { trees: 5, ..ForestParams::default() };
        assert_eq!(fit(&Samples { weights: Some(&weights), ..samples }, &params), fit(&kept, &params));
    }

    #[test]
    fn one_class_one_sample_and_missing_classes_have_defined_answers() {
        let samples = Samples { features: &[1.0, 2.0], width: 2, labels: &[1], weights: None, classes: 3 };
        for params in [ForestParams::ethz(), ForestParams::breiman(), single(Splitter::Exact)] {
            let forest = fit(&samples, &params);
            assert_eq!(probabilities(&forest, &[9.0, f32::NAN, 0.0, 1.0]), [0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
            assert!(probabilities(&forest, &[]).is_empty());
            assert_eq!(forest.retain_used().1, [0]);
        }
    }

    #[test]
    fn class_weights_move_the_answer_of_a_mixed_leaf() {
        let samples = Samples { features: &[0.0; 4], width: 1, labels: &[0, 0, 0, 1], weights: None, classes: 2 };
        let with = |class_weight| {
            probabilities(&fit(&samples, &ForestParams { class_weight, ..single(Splitter::Histogram) }), &[0.0])
        };
        assert_eq!(with(ClassWeight::None), [0.75, 0.25]);
        assert_eq!(with(ClassWeight::Balanced), [0.5, 0.5]);
        assert_eq!(with(ClassWeight::PerClass(vec![1.0, 9.0])), [0.25, 0.75]);
        // Neither 0.1 nor 0.7 is a number of 32 bits.
        let by_class = ClassWeight::PerClass(vec![0.1, 0.7]);
        let weights = growing::weights(&samples, &[0, 1, 2, 3], &by_class).unwrap();
        assert_eq!(weights.unwrap(), [0.1, 0.1, 0.1, 0.7]);
    }

    #[test]
    fn missing_values_go_left_in_training_and_prediction() {
        let features = [f32::NAN, 1.0, f32::NAN, 2.0, 3.0, f32::NAN];
        let samples = Samples { features: &features, width: 1, labels: &[0, 1, 0, 1, 1, 0], weights: None, classes: 2 };
        for splitter in [Splitter::Histogram, Splitter::Exact] {
            let forest = fit(&samples, &single(splitter));
            assert_eq!(forest.predict(&features).unwrap(), samples.labels);
            assert_eq!(forest.predict(&[-1e30]).unwrap(), [1]);
        }
    }

    #[test]
    fn rows_of_another_width_are_refused() {
        let data = blobs(50, 4, 2, 0.0);
        let forest = fit(&data.samples(), &ForestParams { trees: 1, ..ForestParams::default() });
        assert!(forest.predict(&[0.0; 5]).is_err());
        assert!(forest.predict_proba(&[0.0; 8], &mut [0.0; 3]).is_err());
    }

    #[test]
    fn learning_stops_when_cancelled() {
        let data = blobs(50, 4, 2, 0.0);
        let monitor = Monitor::default();
        monitor.cancel();
        let result = Forest::fit(&data.samples(), &ForestParams::default(), &monitor);
        assert!(matches!(result, Err(Error::Interrupted)));
    }
}
