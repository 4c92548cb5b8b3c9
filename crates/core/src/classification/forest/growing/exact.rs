//! Ranks among the distinct raw values: the slow reference for the histogram splitter.

use super::impurity::{BestSplit, Entry, SplitSearch, Weight};
use super::splitter::{CodeTable, Scan};
use crate::classification::binning::middle;
use crate::classification::samples::Samples;
use rayon::prelude::*;

/// Rank of every value among the distinct values of its feature; missing values come first.
pub(in crate::classification) struct Ranks {
    distinct: Vec<Vec<f32>>,
    columns: Vec<u32>,
}

impl Ranks {
    pub(in crate::classification) fn new(samples: &Samples<'_>) -> Self {
        let key = |v: f32| if v.is_nan() { f32::NEG_INFINITY } else { v.clamp(f32::MIN, f32::MAX) + 0.0 };
        let column =
            |f: usize| -> Vec<f32> { samples.features[f..].iter().step_by(samples.width).map(|&v| key(v)).collect() };
        let ranked = (0..samples.width).into_par_iter().map(|f| {
            let values = column(f);
            let mut distinct = values.clone();
            distinct.sort_unstable_by(f32::total_cmp);
            distinct.dedup();
            let ranks = values.iter().map(|&v| distinct.partition_point(|&d| d < v) as u32).collect::<Vec<u32>>();
            (distinct, ranks)
        });
        let (distinct, columns): (Vec<_>, Vec<_>) = ranked.unzip();
        Self { distinct, columns: columns.concat() }
    }
}

impl CodeTable for Ranks {
    type Code = u32;

    fn width(&self) -> usize {
        self.distinct.len()
    }

    fn columns(&self) -> &[u32] {
        &self.columns
    }

    fn row(&self, _: usize) -> Option<&[u32]> {
        None
    }

    fn threshold(&self, split: &BestSplit<u32>, draw: Option<f64>) -> (u32, f32) {
        let distinct = &self.distinct[split.feature];
        let (a, b) = (distinct[split.low as usize], distinct[split.high as usize]);
        let drawn = |u: f64| (f64::from(a) + u * (f64::from(b) - f64::from(a))) as f32;
        let threshold = match draw {
            _ if a.is_infinite() => f32::MIN,
            None => middle(a, b),
            Some(u) => {
                if drawn(u) < b {
                    drawn(u).max(a)
                } else {
                    a
                }
            }
        };
        // The threshold may lie above other values of the feature that do not occur in this node.
        let cut = distinct.partition_point(|&d| d <= threshold).saturating_sub(1);
        (cut as u32, threshold)
    }
}

/// Sorts the samples by rank and passes the groups of equal ranks to the search.
pub(in crate::classification) struct Sorter<W> {
    order: Vec<(u32, u32)>,
    weights: Vec<W>,
}

impl<W: Weight> Sorter<W> {
    pub(in crate::classification) fn new(classes: usize) -> Self {
        Self { order: Vec::new(), weights: vec![W::default(); classes] }
    }
}

impl<W: Weight> Scan<u32, W> for Sorter<W> {
    fn scan(&mut self, column: &[u32], entries: &[Entry<W>], search: &mut SplitSearch<u32>) {
        self.order.clear();
        self.order.extend(entries.iter().enumerate().map(|(i, e)| (column[e.row as usize], i as u32)));
        self.order.sort_unstable();
        for group in self.order.chunk_by(|a, b| a.0 == b.0) {
            self.weights.fill(W::default());
            for &(_, i) in group {
                let entry = &entries[i as usize];
                self.weights[entry.class as usize] += entry.weight;
            }
            search.group(group[0].0, &self.weights, group.len());
        }
    }
}
