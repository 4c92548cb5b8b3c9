//! Statistics of a whole cloud, which are needed to classify a part of it.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Statistics of a cloud: those of its parts, added together, are those of the whole.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloudStatistics {
    /// Number of points whose most probable class is each class of the model; empty if the model needs none.
    pub class_counts: Vec<u64>,
}

impl CloudStatistics {
    /// The statistics of both parts together.
    ///
    /// # Errors
    /// If they are of models with different numbers of classes.
    pub fn with(mut self, other: &Self) -> Result<Self> {
        if self.class_counts.len() != other.class_counts.len() {
            let (found, expected) = (other.class_counts.len(), self.class_counts.len());
            return Err(Error::parameter("statistics", format!("{found} classes"), format!("{expected} classes")));
        }
        self.class_counts.iter_mut().zip(&other.class_counts).for_each(|(sum, count)| *sum += count);
        Ok(self)
    }
}
