//! A forest as named arrays; every index is checked when they are read.

use super::{Descent, Forest};
use crate::classification::arrays::{Array, Reader, array, cut_arrays, node_arrays};
use crate::classification::learner::Stored;
use crate::classification::nodes::Trees;
use crate::error::Result;

impl Stored for Forest {
    const TITLE: &'static str = "scansion forest";

    fn arrays(&self) -> Vec<Array> {
        let mut arrays = cut_arrays(&self.binning);
        arrays.extend(node_arrays(&self.nodes, &self.roots));
        arrays.push(array("leaves", self.leaves.iter().copied()));
        arrays.push(array("importance", self.importance.iter().copied()));
        arrays
    }

    fn from_arrays(reader: &Reader<'_>, width: usize, classes: usize) -> Result<Self> {
        let mut forest = Self {
            classes,
            binning: reader.binning(width)?,
            nodes: reader.nodes()?,
            descent: Descent::default(),
            roots: reader.read("roots", None)?,
            leaves: reader.read("leaves", None)?,
            importance: reader.importance(width)?,
        };
        reader.check_leaves(&forest)?;
        let trees = Trees { nodes: &forest.nodes, roots: &forest.roots, binning: &forest.binning };
        reader.check_trees(&trees, &|_, left| left < forest.leaves.len() / classes)?;
        forest.prepare();
        Ok(forest)
    }
}

impl Reader<'_> {
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
