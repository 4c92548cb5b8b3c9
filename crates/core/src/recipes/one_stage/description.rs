//! The features of the points of a cloud: a table, or computed as they are asked for.

use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::features::{FeatureTable, Spheres};
use crate::parallel::Monitor;

/// The features of the points of a cloud.
pub(in crate::recipes) struct Description {
    /// The points, in an order in which neighbours in space stand close together.
    pub(in crate::recipes) points: Points,
    /// Features that are computed as they are asked for; they are the first columns.
    pub(in crate::recipes) spheres: Option<Spheres>,
    /// Features of all points, one row a point; without columns if there are none.
    pub(in crate::recipes) table: FeatureTable,
    /// What was found in the cloud, for the report; empty if nothing.
    pub(in crate::recipes) found: String,
}

impl Description {
    /// Names of the columns.
    pub(in crate::recipes) fn names(&self) -> Vec<String> {
        let spheres = self.spheres.as_ref().map(Spheres::names).unwrap_or_default();
        spheres.into_iter().chain(self.table.names.iter().cloned()).collect()
    }

    /// The features of the points in these rows, row-major.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn rows(&self, rows: &[u32], monitor: &Monitor) -> Result<Vec<f32>> {
        let Some(spheres) = &self.spheres else { return Ok(self.table.select(rows).values) };
        let names = spheres.names();
        let values = spheres.describe(&self.points.positions.select(rows, monitor)?, monitor)?;
        let first = FeatureTable { names, values };
        Ok(if self.table.names.is_empty() { first } else { first.beside(&self.table.select(rows)) }.values)
    }

    /// The columns of these names.
    ///
    /// # Errors
    /// If a name is unknown.
    pub(in crate::recipes) fn columns(&self, wanted: &[String]) -> Result<Vec<usize>> {
        let names = self.names();
        let column = |name: &String| {
            let unknown = || {
                let count = names.len();
                Error::ModelMismatch(format!("it needs the feature {name}; its recipe gives {count} others"))
            };
            names.iter().position(|other| other == name).ok_or_else(unknown)
        };
        wanted.iter().map(column).collect()
    }
}
