//! Trees as nodes, splits and leaves: what a forest and boosted trees have in common.

use super::binning::Binning;

/// One node of a finished tree in 8 bytes. Samples with a code above `cut` go to `left + 1`, others to `left`; a leaf
/// has `cut` [`LEAF_CUT`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Node {
    /// The left child; of a leaf of a forest its row of probabilities, of a leaf of boosted trees its own index.
    pub(crate) left: u32,
    pub(crate) feature: u16,
    pub(crate) cut: u16,
}

/// Cut of a leaf.
pub(super) const LEAF_CUT: u16 = u16::MAX;

/// A node of a tree that is being grown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum GrownNode<S> {
    /// A split, and the index of the left child; the right one follows it.
    Split(S, u32),
    /// The number of the leaf.
    Leaf(u32),
}

/// All trees of a classifier, one after the other; children come after their parents.
#[derive(Clone, Copy)]
pub(super) struct Trees<'a> {
    pub(super) nodes: &'a [Node],
    /// First node of every tree.
    pub(super) roots: &'a [u32],
    /// Cut points that the nodes refer to.
    pub(super) binning: &'a Binning,
}
