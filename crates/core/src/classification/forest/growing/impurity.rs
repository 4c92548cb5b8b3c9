//! Search for the best split of a node: candidates come feature by feature, as groups of equal codes.
//!
//! For class weights `c` and their sum `n`, Gini scores a set by `sum c^2 / n`, entropy by `sum c ln c - n ln n`; both
//! are `-n x impurity` up to a constant of the node, so that the best split has the largest sum over its two children.

use crate::classification::params::Criterion;

/// Weight of samples: integer counts if possible, for speed.
pub(in crate::classification) trait Weight:
    Copy + Default + std::ops::AddAssign + Send + Sync
{
    fn get(self) -> f64;
}

impl Weight for u32 {
    #[inline]
    fn get(self) -> f64 {
        f64::from(self)
    }
}

impl Weight for f64 {
    #[inline]
    fn get(self) -> f64 {
        self
    }
}

/// One sample of a tree: its row of codes, its class and its weight.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::classification) struct Entry<W> {
    pub(in crate::classification) row: u32,
    pub(in crate::classification) class: u32,
    pub(in crate::classification) weight: W,
}

/// The best candidate so far: codes up to `low` go left, codes from `high` up go right; no code lies between.
#[derive(Clone, Copy, Debug)]
pub(in crate::classification) struct BestSplit<C> {
    pub(in crate::classification) feature: usize,
    pub(in crate::classification) low: C,
    pub(in crate::classification) high: C,
    pub(in crate::classification) score: f64,
}

/// Search over the candidates of one node.
pub(in crate::classification) struct SplitSearch<C> {
    criterion: Criterion,
    min_leaf: usize,
    /// Least weight of a child.
    pub(in crate::classification) min_weight: f64,
    totals: Vec<f64>,
    total: f64,
    rows: usize,
    left: Vec<f64>,
    left_total: f64,
    left_rows: usize,
    feature: usize,
    previous: Option<C>,
    varies: bool,
    pub(in crate::classification) best: Option<BestSplit<C>>,
}

impl<C: Copy> SplitSearch<C> {
    pub(in crate::classification) fn new(classes: usize, criterion: Criterion, min_leaf: usize) -> Self {
        Self {
            criterion,
            min_leaf,
            min_weight: 0.0,
            totals: vec![0.0; classes],
            total: 0.0,
            rows: 0,
            left: vec![0.0; classes],
            left_total: 0.0,
            left_rows: 0,
            feature: 0,
            previous: None,
            varies: false,
            best: None,
        }
    }

    /// Starts a node.
    pub(in crate::classification) fn open<W: Weight>(&mut self, entries: &[Entry<W>]) {
        self.totals.fill(0.0);
        entries.iter().for_each(|e| self.totals[e.class as usize] += e.weight.get());
        self.total = self.totals.iter().sum();
        self.rows = entries.len();
        self.best = None;
    }

    /// Weight of every class in the node.
    pub(in crate::classification) fn totals(&self) -> &[f64] {
        &self.totals
    }

    /// The only class of a pure node.
    pub(in crate::classification) fn only_class(&self) -> Option<usize> {
        let mut present = (0..self.totals.len()).filter(|&c| self.totals[c] > 0.0);
        present.next().filter(|_| present.next().is_none())
    }

    /// Score of the node itself; no split scores less.
    pub(in crate::classification) fn parent_score(&self) -> f64 {
        score(self.criterion, self.totals.iter().copied(), self.total)
    }

    /// Starts a feature.
    pub(in crate::classification) fn begin(&mut self, feature: usize) {
        self.left.fill(0.0);
        (self.left_total, self.left_rows) = (0.0, 0);
        self.feature = feature;
        self.previous = None;
        self.varies = false;
    }

    /// True if the feature had more than one code.
    pub(in crate::classification) fn varies(&self) -> bool {
        self.varies
    }

    /// Adds the next group of equal codes, in ascending order: weight of every class in it, and its number of rows.
    #[inline]
    pub(in crate::classification) fn group<W: Weight>(&mut self, code: C, weights: &[W], rows: usize) {
        if let Some(low) = self.previous {
            self.varies = true;
            let (rows, weight) = (self.rows - self.left_rows, self.total - self.left_total);
            if self.left_rows.min(rows) >= self.min_leaf && self.left_total.min(weight) >= self.min_weight {
                self.evaluate(low, code);
            }
        }
        for (left, w) in self.left.iter_mut().zip(weights) {
            let w = w.get();
            *left += w;
            self.left_total += w;
        }
        self.left_rows += rows;
        self.previous = Some(code);
    }

    #[inline]
    fn evaluate(&mut self, low: C, high: C) {
        let right_total = self.total - self.left_total;
        let score = match self.criterion {
            Criterion::Gini => {
                let (mut l, mut r) = (0.0, 0.0);
                for (&left, &all) in self.left.iter().zip(&self.totals) {
                    let right = all - left;
                    l += left * left;
                    r += right * right;
                }
                l / self.left_total + r / right_total
            }
            Criterion::Entropy => {
                let right = self.left.iter().zip(&self.totals).map(|(l, all)| (all - l).max(0.0));
                score(Criterion::Entropy, self.left.iter().copied(), self.left_total)
                    + score(Criterion::Entropy, right, right_total)
            }
        };
        if self.best.as_ref().is_none_or(|best| score > best.score) && score.is_finite() {
            self.best = Some(BestSplit { feature: self.feature, low, high, score });
        }
    }
}

fn score(criterion: Criterion, counts: impl Iterator<Item = f64>, total: f64) -> f64 {
    let xlnx = |x: f64| if x > 0.0 { x * x.ln() } else { 0.0 };
    match criterion {
        Criterion::Gini => counts.map(|c| c * c).sum::<f64>() / total,
        Criterion::Entropy => counts.map(xlnx).sum::<f64>() - xlnx(total),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n x impurity by its definition.
    fn impurity(criterion: Criterion, counts: &[f64]) -> f64 {
        let n: f64 = counts.iter().sum();
        let p = counts.iter().map(|c| c / n).filter(|&p| p > 0.0);
        n * match criterion {
            Criterion::Gini => p.map(|p| p * (1.0 - p)).sum::<f64>(),
            Criterion::Entropy => p.map(|p| -p * p.ln()).sum::<f64>(),
        }
    }

    #[test]
    fn scores_are_the_impurity_removed_and_never_negative() {
        let groups: [[u32; 3]; 4] = [[3, 1, 0], [0, 2, 2], [5, 0, 1], [0, 0, 4]];
        for criterion in [Criterion::Gini, Criterion::Entropy] {
            let entries: Vec<Entry<u32>> =
                groups.iter().flat_map(|g| (0..3).map(|c| Entry { row: 0, class: c, weight: g[c as usize] })).collect();
            let mut search = SplitSearch::new(3, criterion, 1);
            search.open(&entries);
            search.begin(0);
            groups.iter().enumerate().for_each(|(i, g)| search.group(i, g, 3));
            let sum = |groups: &[[u32; 3]]| -> Vec<f64> {
                (0..3).map(|c| groups.iter().map(|g| f64::from(g[c])).sum()).collect()
            };
            let removed = |k: usize| {
                impurity(criterion, &sum(&groups))
                    - impurity(criterion, &sum(&groups[..k]))
                    - impurity(criterion, &sum(&groups[k..]))
            };
            let best = (1..4).max_by(|&a, &b| removed(a).total_cmp(&removed(b))).unwrap();
            let found = search.best.unwrap();
            assert_eq!((found.low, found.high), (best - 1, best));
            assert!((found.score - search.parent_score() - removed(best)).abs() < 1e-12);
            assert!(removed(best) >= 0.0);
        }
    }
}
