//! The out-of-bag score: every sample is predicted by the trees that were not trained on it (Breiman 2001, section
//! 3.1).

use crate::classification::forest::Forest;
use crate::classification::learner::argmax;
use crate::classification::samples::Samples;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered};

const BLOCK: usize = 2048;

/// Out-of-bag results of the training.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitReport {
    /// Share of samples classified correctly by the trees that were not trained on them; `None` without bootstrap or if
    /// no sample was left out.
    pub oob_score: Option<f64>,
    /// Row-major `samples x classes`: mean over the trees that were not trained on the sample, NaN if all were. Empty
    /// without bootstrap.
    pub oob_probabilities: Vec<f32>,
}

/// The samples of one tree as a bit set.
pub(in crate::classification) struct BagSet(Vec<u64>);

impl BagSet {
    pub(in crate::classification) fn new(samples: usize, members: impl Iterator<Item = u32>) -> Self {
        let mut bits = vec![0u64; samples.div_ceil(64)];
        members.for_each(|i| bits[i as usize >> 6] |= 1 << (i & 63));
        Self(bits)
    }

    fn contains(&self, i: usize) -> bool {
        self.0[i >> 6] >> (i & 63) & 1 == 1
    }
}

pub(in crate::classification) fn report(
    forest: &Forest,
    samples: &Samples<'_>,
    bags: &[BagSet],
    monitor: &Monitor,
) -> Result<FitReport> {
    let classes = samples.classes;
    monitor.stage("out-of-bag score", samples.len() as u64);
    let blocks = map_ordered(samples.len().div_ceil(BLOCK), monitor, |b| {
        let rows = b * BLOCK..((b + 1) * BLOCK).min(samples.len());
        monitor.advance(rows.len() as u64);
        Ok(block(forest, samples, bags, rows))
    })?;
    let oob_probabilities = blocks.concat();
    let (mut judged, mut right) = (0u64, 0u64);
    for (i, row) in oob_probabilities.chunks_exact(classes).enumerate() {
        if samples.weight(i) > 0.0 && !row[0].is_nan() {
            judged += 1;
            right += u64::from(argmax(row) == usize::from(samples.labels[i]));
        }
    }
    Ok(FitReport { oob_score: (judged > 0).then(|| right as f64 / judged as f64), oob_probabilities })
}

fn block(forest: &Forest, samples: &Samples<'_>, bags: &[BagSet], rows: std::ops::Range<usize>) -> Vec<f32> {
    let (classes, width, first) = (samples.classes, samples.width, rows.start);
    let mut codes = vec![0u16; rows.len() * width];
    forest.binning().bin_wide(&samples.features[first * width..rows.end * width], &mut codes);
    let mut sums = vec![0.0f32; rows.len() * classes];
    let mut trees = vec![0u32; rows.len()];
    for (&root, bag) in forest.roots.iter().zip(bags) {
        for i in rows.clone().filter(|&i| !bag.contains(i)) {
            let codes = &codes[(i - first) * width..];
            let leaf = forest.leaf_of(root, |f| codes[f]);
            let sums = &mut sums[(i - first) * classes..(i - first + 1) * classes];
            sums.iter_mut().zip(leaf).for_each(|(s, l)| *s += l);
            trees[i - first] += 1;
        }
    }
    for (row, &n) in sums.chunks_exact_mut(classes).zip(&trees) {
        row.iter_mut().for_each(|s| *s = if n > 0 { *s / n as f32 } else { f32::NAN });
    }
    sums
}
