//! Partition of nodes into segments.

use crate::csr::Csr;
use crate::error::Result;
use crate::parallel::{Monitor, sort_watched, watched};

/// Every node in exactly one segment; segments are numbered in the order of their smallest node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Partition {
    segment: Vec<u32>,
    groups: Csr,
}

const UNSEEN: u32 = u32::MAX;

impl Partition {
    /// From any labels: nodes of equal label form a segment, and labels are renumbered. O(n), or O(n log n) if a label
    /// is larger than 4 n.
    ///
    /// # Errors
    /// Never for fewer than 2^32 nodes.
    pub fn from_labels(labels: &[u32]) -> Result<Self> {
        Self::from_labels_watched(labels, &Monitor::default())
    }

    /// As [`Partition::from_labels`], for many nodes.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn from_labels_watched(labels: &[u32], monitor: &Monitor) -> Result<Self> {
        let largest = labels.iter().copied().max().unwrap_or(0) as usize;
        if largest / 4 <= labels.len() {
            return Self::from_small_labels(labels, largest, monitor);
        }
        let mut distinct = labels.to_vec();
        sort_watched(&mut distinct, monitor)?;
        distinct.dedup();
        let mut ranks = Vec::with_capacity(labels.len());
        for piece in watched(labels.len(), monitor) {
            ranks.extend(labels[piece?].iter().map(|l| distinct.partition_point(|d| d < l) as u32));
        }
        Self::from_small_labels(&ranks, distinct.len(), monitor)
    }

    fn from_small_labels(labels: &[u32], largest: usize, monitor: &Monitor) -> Result<Self> {
        let mut number = vec![UNSEEN; largest + 1];
        let mut count = 0;
        let mut segment = Vec::with_capacity(labels.len());
        for piece in watched(labels.len(), monitor) {
            segment.extend(labels[piece?].iter().map(|&label| {
                let slot = &mut number[label as usize];
                if *slot == UNSEEN {
                    *slot = count;
                    count += 1;
                }
                *slot
            }));
        }
        let groups = Csr::group_by(&segment, count as usize, monitor)?;
        Ok(Self { segment, groups })
    }

    /// The partition of the nodes if the segments are grouped as in `segments`, a partition of these segments.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn coarser(&self, segments: &Self, monitor: &Monitor) -> Result<Self> {
        let mut labels = Vec::with_capacity(self.nodes());
        for piece in watched(self.nodes(), monitor) {
            labels.extend(self.segment[piece?].iter().map(|&s| segments.segment[s as usize]));
        }
        Self::from_labels_watched(&labels, monitor)
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

    /// The members of all segments in order.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.groups.groups()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_numbered_by_their_smallest_node() {
        for large in [7, 4_000_000_000] {
            let partition = Partition::from_labels(&[large, 3, large, 0, 3]).unwrap();
            assert_eq!(partition.segments(), [0, 1, 0, 2, 1]);
            assert_eq!(partition.members(1), [1, 4]);
            assert_eq!((partition.len(), partition.nodes()), (3, 5));
            assert_eq!(partition.iter().map(<[u32]>::len).sum::<usize>(), 5);
        }
    }

    #[test]
    fn no_nodes_make_no_segments() {
        assert!(Partition::from_labels(&[]).unwrap().is_empty());
    }
}
