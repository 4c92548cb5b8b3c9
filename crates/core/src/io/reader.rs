//! Reading in blocks, whatever the format.

use crate::cloud::Cloud;
use crate::error::Result;

/// A file that is read in blocks.
pub(super) trait BlockReader: std::fmt::Debug + Send + Sync {
    /// The next points, at most this many; an empty cloud at the end.
    fn take(&mut self, points: usize) -> Result<Cloud>;
}

/// A cloud that was read as a whole and is returned in blocks.
#[derive(Debug)]
pub(super) struct Whole {
    cloud: Cloud,
    /// Index of the first point that was not returned yet.
    first: usize,
}

impl Whole {
    pub(super) fn new(cloud: Cloud) -> Self {
        Self { cloud, first: 0 }
    }
}

impl BlockReader for Whole {
    fn take(&mut self, points: usize) -> Result<Cloud> {
        let end = self.first.saturating_add(points).min(self.cloud.len());
        let indices: Vec<u32> = (self.first as u32..end as u32).collect();
        self.first = end;
        Ok(self.cloud.select(&indices))
    }
}
