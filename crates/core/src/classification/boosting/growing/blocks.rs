//! The samples' codes in blocks of eight features: a row of a block is a single load, and its histograms fit into the
//! first-level cache.

use crate::classification::binning::Binning;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered, watched};
use rayon::prelude::*;

/// Features of a block.
pub(in crate::classification::boosting) const LANES: usize = 8;

/// Number of rows quantised at a time.
const CHUNK: usize = 4096;

/// Quantised samples.
pub(in crate::classification::boosting) struct Blocks {
    pub(in crate::classification::boosting) binning: Binning,
    blocks: Vec<Vec<[u8; LANES]>>,
}

impl Blocks {
    /// Quantises several row-major tables, one after the other.
    ///
    /// # Errors
    /// If a table has no whole rows, or the work was cancelled.
    pub(in crate::classification::boosting) fn new(
        tables: &[&[f32]],
        binning: Binning,
        monitor: &Monitor,
    ) -> Result<Self> {
        let width = binning.width().max(1);
        let mut codes = vec![0u8; tables.iter().map(|t| t.len()).sum()];
        let mut rest = codes.as_mut_slice();
        for table in tables {
            let (own, after) = rest.split_at_mut(table.len());
            own.par_chunks_mut(CHUNK * width)
                .zip(table.par_chunks(CHUNK * width))
                .try_for_each(|(codes, values)| monitor.check().and_then(|()| binning.bin_block(values, codes)))?;
            rest = after;
        }
        let rows = codes.len() / width;
        let block = |b: usize| -> Result<Vec<[u8; LANES]>> {
            let lanes = b * LANES..((b + 1) * LANES).min(width);
            let mut block = Vec::with_capacity(rows);
            for piece in watched(rows, monitor) {
                let piece = piece?;
                let piece = codes[piece.start * width..piece.end * width].chunks_exact(width);
                block.extend(piece.map(|row| padded(&row[lanes.clone()])));
            }
            Ok(block)
        };
        let blocks = map_ordered(width.div_ceil(LANES), monitor, block)?;
        Ok(Self { binning, blocks })
    }

    /// Number of blocks.
    pub(in crate::classification::boosting) fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Codes of block `b`, row by row; lanes beyond the last feature hold 0.
    pub(in crate::classification::boosting) fn block(&self, b: usize) -> &[[u8; LANES]] {
        &self.blocks[b]
    }

    /// Code of one feature of one row.
    #[inline]
    pub(in crate::classification::boosting) fn code(&self, feature: usize, row: u32) -> u8 {
        self.blocks[feature / LANES][row as usize][feature % LANES]
    }

    /// True if code 0 of the feature stands for missing values.
    pub(in crate::classification::boosting) fn holds_missing(&self, feature: usize) -> bool {
        self.binning.cuts(feature).first() == Some(&f32::MIN)
    }
}

fn padded(codes: &[u8]) -> [u8; LANES] {
    let mut row = [0; LANES];
    row.iter_mut().zip(codes).for_each(|(to, &code)| *to = code);
    row
}
