//! From values to codes: two counts among 16 cuts instead of a search, compiled for each instruction set.

use super::descend::Codes;

/// 255 cuts and infinity, and every 16th of them once more: a code is found by two counts among 16 numbers, which the
/// processor does at once.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    coarse: [f32; 16],
    fine: [[f32; 16]; 16],
}

impl Table {
    pub(super) fn new(cuts: &[f32]) -> Self {
        let cut = |i: usize| cuts.get(i).copied().unwrap_or(f32::INFINITY);
        let fine = std::array::from_fn(|block| std::array::from_fn(|i| cut(16 * block + i)));
        Self { coarse: std::array::from_fn(|block| cut(16 * block + 15)), fine }
    }

    #[inline(always)]
    fn code(&self, x: f32) -> u8 {
        let block = count_below(&self.coarse, x);
        (block.wrapping_mul(16).wrapping_add(count_below(&self.fine[(block & 15) as usize], x))) as u8
    }
}

#[inline(always)]
fn count_below(cuts: &[f32; 16], x: f32) -> u32 {
    let mut counts = [0u32; 16];
    for (count, &cut) in counts.iter_mut().zip(cuts) {
        *count = u32::from(x > cut);
    }
    counts.iter().fold(0, |sum, count| sum.wrapping_add(*count))
}

/// Codes of whole rows, compiled for each instruction set.
pub(super) struct Rows<'a> {
    pub(super) tables: &'a [Table],
    pub(super) values: &'a [f32],
    pub(super) codes: &'a mut [u8],
}

impl pulp::WithSimd for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let width = self.tables.len();
        for (values, codes) in self.values.chunks_exact(width).zip(self.codes.chunks_exact_mut(width)) {
            for ((code, &x), table) in codes.iter_mut().zip(values).zip(self.tables) {
                *code = table.code(x);
            }
        }
    }
}

/// Rows that are quantised feature by feature: their values stay in the nearest cache.
const CHUNK: usize = 64;

/// Codes of rows in both layouts, compiled for each instruction set.
pub(super) struct Block<'a> {
    pub(super) tables: &'a [Table],
    pub(super) values: &'a [f32],
    pub(super) codes: &'a mut Codes<u8>,
}

impl pulp::WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let (width, rows) = (self.tables.len().max(1), self.codes.rows.max(1));
        let chunks = self.values.chunks(CHUNK * width).zip(self.codes.by_row.chunks_mut(CHUNK * width));
        for (chunk, (values, by_row)) in chunks.enumerate() {
            let columns = self.codes.by_feature.chunks_exact_mut(rows);
            for (f, (column, table)) in columns.zip(self.tables).enumerate() {
                let column = column.get_mut(chunk * CHUNK..).unwrap_or_default();
                let of_rows = values.chunks_exact(width).zip(by_row.chunks_exact_mut(width));
                for (slot, (values, codes)) in column.iter_mut().zip(of_rows) {
                    *slot = table.code(values[f]);
                    codes[f] = *slot;
                }
            }
        }
    }
}
