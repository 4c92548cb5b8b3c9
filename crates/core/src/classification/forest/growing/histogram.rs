//! Columns of quantised features, and the split search by histograms.

use super::impurity::{BestSplit, Entry, SplitSearch, Weight};
use super::splitter::{CodeTable, Scan};
use crate::classification::binning::Binning;
use crate::classification::samples::Samples;
use crate::error::Result;
use rayon::prelude::*;

/// Number of rows transposed at a time.
const BLOCK: usize = 4096;

/// The samples' codes twice: by feature for large nodes, by row for copies of small ones.
pub(in crate::classification) struct QuantisedSamples {
    binning: Binning,
    rows: Vec<u8>,
    columns: Vec<u8>,
}

impl QuantisedSamples {
    pub(in crate::classification) fn new(samples: &Samples<'_>, binning: Binning) -> Result<Self> {
        let mut rows = vec![0u8; samples.features.len()];
        rows.par_chunks_mut(BLOCK * samples.width)
            .zip(samples.features.par_chunks(BLOCK * samples.width))
            .try_for_each(|(codes, values)| binning.bin_block(values, codes))?;
        let mut columns = vec![0u8; rows.len()];
        columns.par_chunks_mut(samples.len()).enumerate().for_each(|(f, column)| {
            column.iter_mut().zip(rows.chunks_exact(samples.width)).for_each(|(to, row)| *to = row[f]);
        });
        Ok(Self { binning, rows, columns })
    }
}

impl CodeTable for QuantisedSamples {
    type Code = u8;

    fn width(&self) -> usize {
        self.binning.width()
    }

    fn columns(&self) -> &[u8] {
        &self.columns
    }

    fn row(&self, row: usize) -> Option<&[u8]> {
        let width = self.width();
        self.rows.get(row * width..(row + 1) * width)
    }

    fn threshold(&self, split: &BestSplit<u8>, draw: Option<f64>) -> (u8, f32) {
        let (low, high) = (usize::from(split.low), usize::from(split.high));
        let cut = match draw {
            None => (low + high - 1) / 2,
            Some(u) => low + (u * (high - low) as f64) as usize,
        };
        (cut as u8, self.binning.cuts(split.feature)[cut])
    }
}

/// Weights by code and class, all zero between features, and the occupied codes as a bit set.
pub(in crate::classification) struct Histogram<W> {
    classes: usize,
    weights: Vec<W>,
    rows: [u32; 256],
    occupied: [u64; 4],
}

impl<W: Weight> Histogram<W> {
    pub(in crate::classification) fn new(classes: usize) -> Self {
        Self { classes, weights: vec![W::default(); 256 * classes], rows: [0; 256], occupied: [0; 4] }
    }
}

impl<W: Weight> Scan<u8, W> for Histogram<W> {
    fn scan(&mut self, column: &[u8], entries: &[Entry<W>], search: &mut SplitSearch<u8>) {
        for entry in entries {
            let code = usize::from(column[entry.row as usize]);
            self.weights[code.wrapping_mul(self.classes).wrapping_add(entry.class as usize)] += entry.weight;
            self.rows[code] += 1;
            self.occupied[code >> 6] |= 1 << (code & 63);
        }
        for word in 0..4 {
            let mut bits = std::mem::take(&mut self.occupied[word]);
            while bits != 0 {
                let code = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let cells = &mut self.weights[code * self.classes..(code + 1) * self.classes];
                search.group(code as u8, cells, self.rows[code] as usize);
                cells.fill(W::default());
                self.rows[code] = 0;
            }
        }
    }
}
