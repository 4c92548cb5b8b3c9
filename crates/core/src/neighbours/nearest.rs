//! The k nearest neighbours of every point, the type that the searches of this module return.

use crate::error::{Error, Result};

/// The `k` nearest other points of each point, ascending by (squared distance, index); the point itself is not among
/// them. Every point has the same number: `k` is at most one less than the number of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Neighbours {
    k: usize,
    index: Vec<u32>,
    squared_distance: Vec<f32>,
}

impl Neighbours {
    /// From rows of `k` indices and squared distances (m²), one row a point.
    ///
    /// # Errors
    /// If lengths do not fit `k` or an index is not that of another point.
    pub fn new(k: usize, index: Vec<u32>, squared_distance: Vec<f32>) -> Result<Self> {
        if index.len() != squared_distance.len()
            || (k == 0 && !index.is_empty())
            || !index.len().is_multiple_of(k.max(1))
        {
            return Err(Error::input(format!(
                "{} indices and {} distances are not rows of {k}",
                index.len(),
                squared_distance.len()
            )));
        }
        let points = index.len().checked_div(k).unwrap_or(0);
        for (i, row) in index.chunks(k.max(1)).enumerate() {
            if let Some(j) = row.iter().find(|&&j| j as usize >= points || j as usize == i) {
                return Err(Error::input(format!("neighbour {j} of point {i} is not another of the {points} points")));
            }
        }
        Ok(Self { k, index, squared_distance })
    }

    /// From rows of this module's own searches, without checks.
    pub(super) fn trusted(k: usize, index: Vec<u32>, squared_distance: Vec<f32>) -> Self {
        Self { k, index, squared_distance }
    }

    /// Number of neighbours of each point.
    pub fn k(&self) -> usize {
        self.k
    }

    /// Number of points; 0 if `k` is 0.
    pub fn len(&self) -> usize {
        self.index.len().checked_div(self.k).unwrap_or(0)
    }

    /// True if there is no neighbour at all.
    pub fn is_empty(&self) -> bool {
        self.index.is_empty()
    }

    /// Neighbours of point `i`, the nearest first.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.index[i * self.k..(i + 1) * self.k]
    }

    /// Squared distances of [`Neighbours::of`], m².
    pub fn squared_distances(&self, i: usize) -> &[f32] {
        &self.squared_distance[i * self.k..(i + 1) * self.k]
    }

    /// All indices, row after row.
    pub fn indices(&self) -> &[u32] {
        &self.index
    }
}
