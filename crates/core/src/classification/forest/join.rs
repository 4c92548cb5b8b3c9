//! Several forests as one.

use super::{Descent, Forest, one_hot};
use crate::classification::Predictor;
use crate::classification::binning::Binning;
use crate::classification::nodes::{LEAF_CUT, Node};
use crate::error::{Error, Result};

impl Forest {
    /// The forest of the trees of both: its probabilities are the means of theirs, weighted by their numbers of trees.
    ///
    /// # Errors
    /// If they have different features or classes, or too many nodes together.
    pub fn joined(&self, other: &Self) -> Result<Self> {
        if (self.width(), self.classes) != (other.width(), other.classes) {
            let (found, expected) = ((other.width(), other.classes), (self.width(), self.classes));
            return Err(Error::ModelMismatch(format!(
                "a forest of {} features and {} classes, to be joined with one of {} and {}",
                found.0, found.1, expected.0, expected.1
            )));
        }
        if self.nodes.len() + other.nodes.len() > u32::MAX as usize {
            return Err(Error::input("the forests have more than 2^32 nodes together"));
        }
        let mut joined = Self {
            classes: self.classes,
            binning: self.binning.united(&other.binning)?,
            nodes: Vec::with_capacity(self.nodes.len() + other.nodes.len()),
            descent: Descent::default(),
            roots: Vec::with_capacity(self.roots.len() + other.roots.len()),
            leaves: one_hot(self.classes),
            importance: vec![0.0; self.width()],
        };
        let trees = (self.trees() + other.trees()) as f64;
        for forest in [self, other] {
            joined.take(forest);
            let share = forest.trees() as f64 / trees;
            joined.importance.iter_mut().zip(&forest.importance).for_each(|(sum, i)| *sum += share * i);
        }
        joined.prepare();
        Ok(joined)
    }

    /// Appends the trees of a forest whose thresholds are among those of this one.
    fn take(&mut self, forest: &Self) {
        let first = self.nodes.len() as u32;
        // The rows of pure leaves are there already.
        let rows = (self.leaves.len() / self.classes - self.classes) as u32;
        let row_of = |row: u32| if (row as usize) < self.classes { row } else { row + rows };
        let node = |node: &Node| match node.cut {
            LEAF_CUT => Node { left: row_of(node.left), ..*node },
            cut => {
                let feature = usize::from(node.feature);
                let threshold = forest.binning.cuts(feature)[usize::from(cut)];
                let cut = self.binning.cuts(feature).partition_point(|&t| t < threshold) as u16;
                Node { left: node.left + first, feature: node.feature, cut }
            }
        };
        let nodes: Vec<Node> = forest.nodes.iter().map(node).collect();
        self.nodes.extend(nodes);
        self.roots.extend(forest.roots.iter().map(|root| root + first));
        self.leaves.extend_from_slice(&forest.leaves[self.classes * self.classes..]);
    }
}

impl Binning {
    /// The cut points of both.
    fn united(&self, other: &Self) -> Result<Self> {
        let cuts = (0..self.width()).map(|f| {
            let mut cuts = [self.cuts(f), other.cuts(f)].concat();
            cuts.sort_unstable_by(f32::total_cmp);
            cuts.dedup();
            cuts
        });
        Self::new(cuts.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::testing::blobs;
    use crate::classification::{ForestParams, ForestPart};
    use crate::parallel::Monitor;

    #[test]
    fn the_joined_forest_gives_the_mean_and_keeps_it_in_a_file() {
        let data = blobs(1500, 6, 3, 0.1);
        let fit = |seed, trees| {
            let params = ForestParams { trees, seed, max_depth: Some(7), ..ForestParams::default() };
            Forest::fit(&data.samples(), &params, &Monitor::default()).unwrap()
        };
        let (a, b) = (fit(1, 6), fit(2, 3));
        let joined = a.joined(&b).unwrap();
        assert_eq!((joined.trees(), joined.nodes()), (9, a.nodes() + b.nodes()));
        let of = |forest: &Forest| {
            let mut out = vec![0.0; 1500 * 3];
            forest.predict_proba(&data.features, &mut out).unwrap();
            out
        };
        for ((a, b), j) in of(&a).into_iter().zip(of(&b)).zip(of(&joined)) {
            assert!(((6.0 * a + 3.0 * b) / 9.0 - j).abs() < 1e-5);
        }
        assert!((joined.importance().iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let narrow = blobs(200, 5, 3, 0.0);
        let narrow = Forest::fit(&narrow.samples(), &ForestParams::default(), &Monitor::default()).unwrap();
        assert!(a.joined(&narrow).is_err());
    }

    #[test]
    fn forests_of_parts_are_joined_without_more_thresholds() {
        let data = blobs(4000, 4, 3, 0.0);
        let part = |fold: usize| ForestPart {
            weights: (0..4000).map(|i| if i % 2 == fold { 1.0 } else { 0.0 }).collect(),
            params: ForestParams { trees: 8, seed: fold as u64, ..ForestParams::default() },
        };
        let forests = Forest::fit_parts(&data.samples(), &[part(0), part(1)], &Monitor::default()).unwrap();
        let joined = forests[0].joined(&forests[1]).unwrap();
        assert!((0..4).all(|f| joined.binning().cuts(f).len() < 255));
        assert!(matches!(joined.descent, Descent::Compact(_)));
        let right = joined.predict(&data.features).unwrap().iter().zip(&data.labels).filter(|(a, b)| a == b).count();
        assert!(right > 3000, "{right}");
        assert!(Forest::fit_parts(&data.samples(), &[], &Monitor::default()).unwrap().is_empty());
    }
}
