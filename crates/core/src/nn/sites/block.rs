//! Pairs of sites, block by block.

/// Output sites of a block.
pub(super) const BLOCK: usize = 256;

/// Pairs of a block of [`BLOCK`] output sites, weight after weight, output sites ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Block {
    /// End of the pairs of each weight.
    pub(super) ends: Vec<u32>,
    /// Output site of each pair, counted from the first of the block.
    pub(super) outputs: Vec<u8>,
    /// Input site of each pair.
    pub(super) inputs: Vec<u32>,
}

/// The pairs of one weight in a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pairs<'a> {
    pub(crate) outputs: &'a [u8],
    pub(crate) inputs: &'a [u32],
}

impl Block {
    /// The pairs of a weight.
    #[inline]
    pub(super) fn pairs(&self, weight: usize) -> Pairs<'_> {
        let first = if weight == 0 { 0 } else { self.ends[weight - 1] as usize };
        let range = first..self.ends[weight] as usize;
        Pairs { outputs: &self.outputs[range.clone()], inputs: &self.inputs[range] }
    }

    /// A block with room for so many pairs of each weight.
    pub(super) fn with_room(counts: &[u32]) -> Self {
        let ends: Vec<u32> = counts
            .iter()
            .scan(0, |end, &count| {
                *end += count;
                Some(*end)
            })
            .collect();
        let pairs = ends.last().map_or(0, |&end| end as usize);
        Self { ends, outputs: vec![0; pairs], inputs: vec![0; pairs] }
    }
}
