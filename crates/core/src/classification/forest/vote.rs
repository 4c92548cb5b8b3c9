//! The most probable class of each row without evaluating all trees: a row is finished once the others cannot change
//! it.

use super::Forest;
use super::compact::Compact;
use super::predict::ForestScratch;
use crate::classification::learner::argmax;

/// A lead must exceed what the remaining trees can add by this much: more than the rounding of the sums.
const SLACK: f32 = 1e-3;

impl Forest {
    /// The classes of a block of rows, equal to those of the largest probabilities.
    ///
    /// A tree adds at most 1 to a class, so that a lead larger than the number of remaining trees cannot be lost.
    pub(in crate::classification) fn label_block(
        &self,
        rows: &[f32],
        trees: &Compact,
        scratch: &mut ForestScratch,
        out: &mut [u16],
    ) {
        self.begin(rows, scratch);
        // Those of the rows that descend.
        let mut sums = vec![0.0; out.len() * self.classes];
        let count = trees.trees();
        let majority = count / 2 + 1;
        for tree in 0..count {
            self.add_tree(trees, tree, scratch, &mut sums);
            let (done, left) = (tree + 1, count - tree - 1);
            if left > 0 && done >= majority && (done - majority).is_multiple_of((count / 16).max(1)) {
                self.settle(left as f32 + SLACK, &mut sums, scratch, out);
            }
            if scratch.compact_walk.rows.is_empty() {
                return;
            }
        }
        let trees = count.max(1) as f32;
        for (&row, sums) in scratch.compact_walk.rows.iter().zip(sums.chunks_exact_mut(self.classes)) {
            sums.iter_mut().for_each(|p| *p /= trees);
            out[usize::from(row)] = argmax(sums) as u16;
        }
    }

    fn add_tree(&self, trees: &Compact, tree: usize, scratch: &mut ForestScratch, sums: &mut [f32]) {
        let ForestScratch { narrow, compact_walk, leaves, .. } = scratch;
        trees.walk(tree, narrow, compact_walk, leaves);
        self.add_leaves(leaves, sums);
    }

    /// Writes the classes of rows whose lead exceeds `most`; the others are moved together.
    fn settle(&self, most: f32, sums: &mut Vec<f32>, scratch: &mut ForestScratch, out: &mut [u16]) {
        let (rows, classes) = (&mut scratch.compact_walk.rows, self.classes);
        let mut kept = 0;
        for i in 0..rows.len() {
            let own = &sums[i * classes..][..classes];
            let best = argmax(own);
            let second = (0..classes).filter(|&c| c != best).map(|c| own[c]).fold(0.0, f32::max);
            if own[best] - second > most {
                out[usize::from(rows[i])] = best as u16;
                continue;
            }
            rows[kept] = rows[i];
            sums.copy_within(i * classes..(i + 1) * classes, kept * classes);
            kept += 1;
        }
        rows.truncate(kept);
        sums.truncate(kept * classes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::forest::Descent;
    use crate::classification::testing::blobs;
    use crate::classification::{Forest, ForestParams, Predictor};
    use crate::parallel::Monitor;

    #[test]
    fn labels_are_those_of_the_largest_probabilities() {
        for (classes, noise) in [(2, 0.0), (5, 0.4), (12, 0.1)] {
            let data = blobs(6000, 7, classes, noise);
            for trees in [1, 2, 17, 50] {
                let params = ForestParams { trees, seed: trees as u64, ..ForestParams::default() };
                let forest = Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap();
                let mut all = vec![0.0; 6000 * classes];
                forest.predict_proba(&data.features, &mut all).unwrap();
                let expected: Vec<u16> = all.chunks_exact(classes).map(|row| argmax(row) as u16).collect();
                assert_eq!(forest.predict(&data.features).unwrap(), expected, "{classes} classes, {trees} trees");
            }
        }
    }

    #[test]
    fn settled_rows_leave_and_the_others_keep_their_codes() {
        let data = blobs(3000, 7, 3, 0.0);
        let params = ForestParams { trees: 20, ..ForestParams::default() };
        let forest = Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap();
        let mut scratch = ForestScratch::default();
        let mut labels = vec![0; 3000];
        let Descent::Compact(trees) = &forest.descent else { panic!("small trees are compact") };
        forest.label_block(&data.features, trees, &mut scratch, &mut labels);
        assert!(scratch.compact_walk.rows.len() < 3000, "no row was settled early");
    }
}
