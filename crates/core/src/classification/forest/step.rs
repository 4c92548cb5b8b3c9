//! A node of a compact tree in 4 bytes.

/// Cut of a leaf.
pub(super) const LEAF: u8 = 255;

/// A node: its left child (16 bits), feature (8 bits) and cut (8 bits), from the highest bit down. Rows with a code above
/// the cut move to the node after the left child, others to the left child. A leaf has itself as left child and cut 255,
/// which no code exceeds: rows stay there. Its feature is its row of probabilities; 255 if that is stored in
/// [`Compact`](super::compact::Compact)'s rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Step(u32);

impl Step {
    pub(super) fn new(left: usize, feature: u32, cut: u16) -> Self {
        Self(((left as u32) << 16) | (feature << 8) | u32::from(cut))
    }

    /// A leaf with all bits set: [`Step::and`] of it and a node is that node.
    pub(super) fn leaf() -> Self {
        Self(u32::MAX)
    }

    #[inline(always)]
    pub(super) fn left(self) -> u16 {
        (self.0 >> 16) as u16
    }

    #[inline(always)]
    pub(super) fn feature(self) -> u8 {
        (self.0 >> 8) as u8
    }

    #[inline(always)]
    pub(super) fn cut(self) -> u8 {
        self.0 as u8
    }

    /// The bits that two nodes share: a leaf if both are leaves, and only then.
    #[inline(always)]
    pub(super) fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// All of the node, to touch its memory.
    pub(super) fn bits(self) -> u32 {
        self.0
    }

    /// The node of rows above the cut; a leaf itself.
    pub(super) fn right(self) -> u16 {
        self.left().wrapping_add(u16::from(!self.is_leaf()))
    }

    /// Feature and cut.
    pub(super) fn split(self) -> (u8, u8) {
        (self.feature(), self.cut())
    }

    #[inline(always)]
    pub(super) fn is_leaf(self) -> bool {
        self.cut() == LEAF
    }
}
