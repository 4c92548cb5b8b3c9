//! What belongs together: partitions of a cloud into segments.

use crate::csr::Csr;
use crate::error::Result;

/// Every node in exactly one segment; segments are numbered in the order of their smallest node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Partition {
    segment: Vec<u32>,
    groups: Csr,
}

impl Partition {
    /// From any labels: nodes of equal label form a segment; labels are renumbered. O(n).
    ///
    /// # Errors
    /// Never for fewer than 2^32 nodes.
    pub fn from_labels(labels: &[u32]) -> Result<Self> {
        let mut number = std::collections::HashMap::new();
        let segment: Vec<u32> = labels
            .iter()
            .map(|label| {
                let next = number.len() as u32;
                *number.entry(*label).or_insert(next)
            })
            .collect();
        let groups = Csr::group_by(&segment, number.len())?;
        Ok(Self { segment, groups })
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// True if there is no segment.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.segment.len()
    }

    /// Segment of each node.
    pub fn segments(&self) -> &[u32] {
        &self.segment
    }

    /// Nodes of a segment, ascending.
    pub fn members(&self, segment: usize) -> &[u32] {
        self.groups.group(segment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_numbered_by_their_smallest_node() {
        let partition = Partition::from_labels(&[7, 3, 7, 0, 3]).unwrap();
        assert_eq!(partition.segments(), [0, 1, 0, 2, 1]);
        assert_eq!(partition.members(1), [1, 4]);
        assert_eq!((partition.len(), partition.nodes()), (3, 5));
    }
}
