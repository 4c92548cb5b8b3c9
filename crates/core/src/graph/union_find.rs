//! Disjoint sets of nodes (union-find) with path halving, in which the root is always the smallest member.
//!
//! R. E. Tarjan, J. van Leeuwen, *Worst-case analysis of set union algorithms*, Journal of the ACM 31(2), 1984. The
//! smallest member as root makes the numbering of the sets independent of the order of the unions.

use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Disjoint sets of `0..len`; O(log len) an operation on average.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// Every node in a set of its own.
    pub(crate) fn new(len: usize) -> Self {
        Self { parent: (0..len as u32).collect() }
    }

    /// As new, in the same memory.
    pub(crate) fn reset(&mut self, len: usize) {
        self.parent.clear();
        self.parent.extend(0..len as u32);
    }

    /// Smallest member of the set of `node`; halves the path on its way.
    #[inline]
    pub(crate) fn root(&mut self, mut node: u32) -> u32 {
        loop {
            let parent = self.parent[node as usize];
            if parent == node {
                return node;
            }
            let grand = self.parent[parent as usize];
            self.parent[node as usize] = grand;
            node = grand;
        }
    }

    /// Merges two sets; returns the roots as (kept, absorbed), or nothing if they are one set already.
    #[inline]
    pub(crate) fn unite(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return None;
        }
        let (kept, gone) = (a.min(b), a.max(b));
        self.parent[gone as usize] = kept;
        Some((kept, gone))
    }

    /// Root of every node.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(crate) fn roots(&mut self, monitor: &Monitor) -> Result<Vec<u32>> {
        let mut roots = Vec::with_capacity(self.parent.len());
        for piece in watched(self.parent.len(), monitor) {
            roots.extend(piece?.map(|node| self.root(node as u32)));
        }
        Ok(roots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn united_sets_have_their_smallest_member_as_root() {
        let mut sets = UnionFind::new(5);
        assert_eq!([sets.unite(0, 4), sets.unite(2, 4), sets.unite(0, 2)], [Some((0, 4)), Some((0, 2)), None]);
        assert_eq!(sets.roots(&Monitor::default()).unwrap(), [0, 1, 0, 3, 0]);
        sets.reset(2);
        assert_eq!(sets.roots(&Monitor::default()).unwrap(), [0, 1]);
    }
}
