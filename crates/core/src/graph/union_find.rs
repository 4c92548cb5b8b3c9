//! Disjoint sets of nodes: union by size with path halving.
//!
//! R. E. Tarjan, J. van Leeuwen, *Worst-case analysis of set union algorithms*, Journal of the ACM 31(2), 1984.

/// Disjoint sets of `0..len`; almost constant time an operation.
#[derive(Clone, Debug, Default)]
pub(super) struct UnionFind {
    parent: Vec<u32>,
    size: Vec<u32>,
}

impl UnionFind {
    /// Every node in a set of its own.
    pub(super) fn new(len: usize) -> Self {
        Self { parent: (0..len as u32).collect(), size: vec![1; len] }
    }

    /// The representative of the set of `node`.
    pub(super) fn find(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            let above = self.parent[self.parent[node as usize] as usize];
            self.parent[node as usize] = above;
            node = above;
        }
        node
    }

    /// Merges two sets; false if they are one set already.
    pub(super) fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        if a == b {
            return false;
        }
        let (large, small) = if self.size[a as usize] >= self.size[b as usize] { (a, b) } else { (b, a) };
        self.parent[small as usize] = large;
        self.size[large as usize] += self.size[small as usize];
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_sets_have_one_name() {
        let mut sets = UnionFind::new(5);
        assert!(sets.join(0, 4) && sets.join(2, 4) && !sets.join(0, 2));
        assert_eq!(sets.find(0), sets.find(2));
        assert_ne!(sets.find(0), sets.find(1));
    }
}
