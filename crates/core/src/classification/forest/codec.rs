//! A forest as named arrays; every index is checked when they are read.

use super::{Descent, Forest};
use crate::classification::arrays::{Array, Reader, array, cut_arrays, node_arrays};
use crate::classification::nodes::Trees;
use crate::error::Result;

/// The arrays of a forest.
pub(in crate::classification) fn encode(forest: &Forest) -> Vec<Array> {
    let mut arrays = cut_arrays(&forest.binning);
    arrays.extend(node_arrays(&forest.nodes, &forest.roots));
    arrays.push(array("leaves", forest.leaves.iter().copied()));
    arrays.push(array("importance", forest.importance.iter().copied()));
    arrays
}

impl Reader<'_> {
    /// The forest of `width` features and `classes` classes, every index checked.
    pub(in crate::classification) fn forest(&self, width: usize, classes: usize) -> Result<Forest> {
        let mut forest = Forest {
            classes,
            binning: self.binning(width)?,
            nodes: self.nodes()?,
            descent: Descent::default(),
            roots: self.read("roots", None)?,
            leaves: self.read("leaves", None)?,
            importance: self.importance(width)?,
        };
        self.check_leaves(&forest)?;
        let trees = Trees { nodes: &forest.nodes, roots: &forest.roots, binning: &forest.binning };
        self.check_trees(&trees, &|_, left| left < forest.leaves.len() / classes)?;
        forest.prepare();
        Ok(forest)
    }

    fn check_leaves(&self, forest: &Forest) -> Result<()> {
        let rows = forest.leaves.chunks_exact(forest.classes);
        if !rows.remainder().is_empty() || rows.len() < forest.classes {
            return Err(self.wrong("leaves", forest.leaves.len(), format!("whole rows of {} classes", forest.classes)));
        }
        let fine =
            |row: &[f32]| row.iter().all(|p| (0.0..=1.0).contains(p)) && (row.iter().sum::<f32>() - 1.0).abs() < 1e-3;
        match rows.enumerate().find(|(_, row)| !fine(row)) {
            Some((i, row)) => {
                Err(self.wrong(&format!("leaves at row {i}"), format!("{row:?}"), "0 to 1, summing to 1"))
            }
            None => Ok(()),
        }
    }
}
