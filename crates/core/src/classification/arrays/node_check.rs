//! Validation of all indices of trees that are read from a file.

use super::Reader;
use crate::classification::nodes::{LEAF_CUT, Trees};
use crate::classification::params::MAX_DEPTH;
use crate::error::Result;

/// True if the leaf at an index may have this number in `left`.
type LeafRule<'a> = &'a dyn Fn(usize, usize) -> bool;

impl Reader<'_> {
    /// Checks roots and nodes of the trees of any classifier.
    pub(in crate::classification) fn check_trees(&self, trees: &Trees<'_>, leaf: LeafRule<'_>) -> Result<()> {
        let (roots, count) = (trees.roots, trees.nodes.len());
        let rising = roots.windows(2).all(|w| w[0] < w[1]);
        if roots.first() != Some(&0) || !rising || roots.last().is_none_or(|&r| r as usize >= count) {
            return Err(self.wrong(
                "roots",
                format!("{:?}", &roots[..roots.len().min(8)]),
                format!("rising from 0, below {count}"),
            ));
        }
        let ends = roots[1..].iter().map(|&r| r as usize).chain([count]);
        roots.iter().zip(ends).try_for_each(|(&root, end)| self.check_tree(trees, leaf, root as usize..end))
    }

    /// Checks that children come after their parent, inside the tree, and have one parent each: no cycles, no
    /// unreachable nodes.
    fn check_tree(&self, trees: &Trees<'_>, leaf: LeafRule<'_>, range: std::ops::Range<usize>) -> Result<()> {
        let mut depth = vec![0usize; range.len()];
        for i in range.clone() {
            let node = trees.nodes[i];
            self.check_node(trees, leaf, i, range.end)?;
            let own = depth[i - range.start];
            if own > MAX_DEPTH + 1 || (own == 0 && i > range.start) {
                let allowed = format!("one parent, depth up to {MAX_DEPTH}");
                return Err(self.wrong(
                    &format!("node_left at node {i}"),
                    format!("depth {}", own.wrapping_sub(1)),
                    allowed,
                ));
            }
            if node.cut != LEAF_CUT {
                for child in [node.left as usize - range.start, node.left as usize + 1 - range.start] {
                    if depth[child] != 0 {
                        return Err(self.wrong(
                            &format!("node_left at node {i}"),
                            node.left,
                            "children without another parent",
                        ));
                    }
                    depth[child] = own.max(1) + 1;
                }
            }
        }
        Ok(())
    }

    fn check_node(&self, trees: &Trees<'_>, leaf: LeafRule<'_>, i: usize, end: usize) -> Result<()> {
        let node = trees.nodes[i];
        let (feature, left) = (usize::from(node.feature), node.left as usize);
        let wrong = |field: &str, found: usize, allowed: String| {
            Err(self.wrong(&format!("{field} at node {i}"), found, allowed))
        };
        if feature >= trees.binning.width() {
            return wrong("node_feature", feature, format!("below {}", trees.binning.width()));
        }
        if node.cut == LEAF_CUT {
            return if leaf(i, left) { Ok(()) } else { wrong("node_left", left, "a leaf of the tree".into()) };
        }
        if left <= i || left + 1 >= end {
            return wrong("node_left", left, format!("above {i}, below {}", end - 1));
        }
        let cuts = trees.binning.cuts(feature).len();
        match usize::from(node.cut) < cuts {
            true => Ok(()),
            false => wrong("node_cut", usize::from(node.cut), format!("below {cuts}")),
        }
    }
}
