//! The best split of a node from its histograms.
//!
//! With sums G and H of first and second derivatives the gain of a split is `GL^2 / (HL + lambda) + GR^2 / (HR +
//! lambda) - G^2 / (H + lambda)` (T. Chen, C. Guestrin, *XGBoost*, KDD 2016, eq. 7, without its factor 1/2 and with the
//! cost of a leaf as a threshold).
//!
//! `min_samples_leaf` applies twice, as in LightGBM (Ke et al. 2017): to the number of samples, and to their number as
//! estimated from the child's share of H. Without the second rule, twenty samples of a rare class with nearly no H
//! could form a leaf, and its value G / H would not be bounded.

use crate::classification::boosting::growing::blocks::{Blocks, LANES};
use crate::classification::boosting::growing::histogram::{Cell, Cells, Scale, count, minus, plus};
use crate::classification::boosting::params::BoostingParams;

/// Samples with a code above `cut` go right; those with code 0 as well if `missing_right`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::classification::boosting) struct Split {
    pub(in crate::classification::boosting) feature: usize,
    pub(in crate::classification::boosting) cut: u8,
    pub(in crate::classification::boosting) missing_right: bool,
    pub(in crate::classification::boosting) gain: f64,
}

impl Split {
    /// True if a sample with this code goes right.
    #[inline(always)]
    pub(in crate::classification::boosting) fn goes_right(&self, code: u8) -> bool {
        code > self.cut || (self.missing_right && code == 0)
    }

    /// The better of two splits, the first of equal ones.
    pub(in crate::classification::boosting) fn better(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        match (first, second) {
            (Some(a), Some(b)) => Some(if b.gain > a.gain { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

/// The constraints on a split.
pub(in crate::classification::boosting) struct SplitRules<'a> {
    pub(in crate::classification::boosting) blocks: &'a Blocks,
    pub(in crate::classification::boosting) params: &'a BoostingParams,
    pub(in crate::classification::boosting) scale: Scale,
    /// Features that the tree may split on.
    pub(in crate::classification::boosting) allowed: &'a [bool],
}

impl SplitRules<'_> {
    /// `G^2 / (H + lambda)` of a sum.
    #[inline(always)]
    fn score(&self, cell: Cell) -> f64 {
        let (g, h) = self.scale.sums(cell);
        g * g / (h + self.params.lambda).max(1e-30)
    }

    /// The best split of a block's features, of equal gains the one of the lowest feature and code.
    pub(in crate::classification::boosting) fn best(&self, block: usize, cells: &Cells, total: Cell) -> Option<Split> {
        let width = self.blocks.binning.width();
        let features = (block * LANES..((block + 1) * LANES).min(width)).zip(cells);
        let allowed = features.filter(|&(f, _)| self.allowed.get(f).copied().unwrap_or_default());
        allowed.fold(None, |best, (feature, cells)| Split::better(best, self.of_feature(feature, cells, total)))
    }

    fn of_feature(&self, feature: usize, cells: &[Cell; 256], total: Cell) -> Option<Split> {
        let codes = self.blocks.binning.cuts(feature).len() + 1;
        let cells = cells.get(..codes).unwrap_or_default();
        let missing = self.blocks.holds_missing(feature) && cells.first().is_some_and(|&c| count(c) > 0);
        let parent = self.score(total);
        let left = self.scan(cells, total, 0);
        let right = missing.then(|| self.scan(cells, total, 1)).flatten();
        let split = |(code, score): (usize, f64), missing_right| {
            let gain = score - parent;
            let after = cells.iter().skip(code + 1).position(|&c| count(c) > 0).unwrap_or(0);
            let cut = (code + after / 2) as u8;
            (gain > self.params.min_gain.max(1e-10 * parent)).then_some(Split { feature, cut, missing_right, gain })
        };
        Split::better(left.and_then(|l| split(l, false)), right.and_then(|r| split(r, true)))
    }

    /// Least sum of second derivatives of a child: [`BoostingParams::min_child_weight`], or the share of the node's sum
    /// that corresponds to `min_samples_leaf` of its samples.
    fn least_hessian(&self, total: Cell) -> f64 {
        let share = (self.params.min_samples_leaf as f64 - 0.5) / count(total).max(1) as f64;
        self.params.min_child_weight.max(share * self.scale.sums(total).1)
    }

    /// The last code on the left and the summed score of both sides; codes below `first` count to the right.
    fn scan(&self, cells: &[Cell], total: Cell, first: usize) -> Option<(usize, f64)> {
        let least = self.params.min_samples_leaf as u64;
        let least_hessian = self.least_hessian(total);
        let (mut left, mut best) = ([0; 2], None);
        for (code, &cell) in cells.iter().enumerate().skip(first).filter(|(_, c)| count(**c) > 0) {
            left = plus(left, cell);
            let right = minus(total, left);
            if count(right) < least {
                break;
            }
            if count(left) < least {
                continue;
            }
            let (hessian_left, hessian_right) = (self.scale.sums(left).1, self.scale.sums(right).1);
            if hessian_left.min(hessian_right) < least_hessian {
                continue;
            }
            let score = self.score(left) + self.score(right);
            if best.is_none_or(|(_, found)| score > found) {
                best = Some((code, score));
            }
        }
        best
    }
}
