//! Convolution and pooling of whole grids: the dense twins of the sparse layers, and the last levels of networks, which have
//! few cells.
//!
//! Values lie cell after cell, the last axis running fastest, with the channels of a cell side by side.

mod convolution;
mod pooling;

pub use convolution::{DenseConvolution, DenseGradient};
pub use pooling::{DensePooled, max_pool};

use crate::error::{Error, Result};

/// Samples of the same extent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Number of samples.
    pub samples: usize,
    /// Cells along each axis, 1 to 4 axes.
    pub extent: Vec<usize>,
}

impl Grid {
    /// A grid with at least one cell.
    ///
    /// # Errors
    /// If there are no axes or more than 4, a length is 0, or the number of cells overflows.
    pub fn new(samples: usize, extent: &[usize]) -> Result<Self> {
        let cells = extent.iter().try_fold(samples.max(1), |product, &length| product.checked_mul(length));
        match (1..=4).contains(&extent.len()) && cells.is_some_and(|cells| cells > 0) {
            true => Ok(Self { samples, extent: extent.to_vec() }),
            false => Err(Error::input(format!("a grid of {extent:?} cells (allowed: 1 to 4 axes, no length 0)"))),
        }
    }

    /// Cells of a sample.
    pub fn cells(&self) -> usize {
        self.extent.iter().product()
    }

    /// Cells of all samples.
    pub fn rows(&self) -> usize {
        self.samples * self.cells()
    }
}
