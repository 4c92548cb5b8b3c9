//! What a splitter consists of: the codes of the samples by feature, and the groups of equal codes in ascending order.

use super::impurity::{BestSplit, Entry, SplitSearch};

/// The samples' codes, feature-major: `columns()[f * samples + i]`.
pub(in crate::classification) trait CodeTable: Sync {
    type Code: Copy + Default + Ord + Send;
    fn width(&self) -> usize;
    fn columns(&self) -> &[Self::Code];
    /// Codes of one sample, if they are kept by row too.
    fn row(&self, row: usize) -> Option<&[Self::Code]>;
    /// The code and the value above which samples go right, between the codes `low` and `high` of the split; `draw` is
    /// the position between them.
    fn threshold(&self, split: &BestSplit<Self::Code>, draw: Option<f64>) -> (Self::Code, f32);
}

/// Passes the groups of equal codes of one column to the search, in ascending order.
pub(in crate::classification) trait Scan<C, W> {
    fn scan(&mut self, column: &[C], entries: &[Entry<W>], search: &mut SplitSearch<C>);
}
