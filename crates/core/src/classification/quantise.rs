//! From values to codes: two counts among 16 cuts instead of a search, compiled for each instruction set.

use super::descend::Codes;
use pulp::{Simd, bytemuck};

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
    fn code<S: Simd>(&self, simd: S, x: f32) -> u8 {
        let x = simd.splat_f32s(x);
        let block = count_below(simd, &self.coarse, x);
        let within = count_below(simd, &self.fine[(block & 15) as usize], x);
        block.wrapping_mul(16).wrapping_add(within) as u8
    }
}

/// Number of cuts below `x`.
#[inline(always)]
fn count_below<S: Simd>(simd: S, cuts: &[f32; 16], x: S::f32s) -> u32 {
    let (lanes, _) = S::as_simd_f32s(cuts);
    if const { size_of::<S::m32s>() == size_of::<u16>() } {
        // A bit a lane.
        let mut count = 0u32;
        for &cuts in lanes {
            let below: u16 = bytemuck::cast(simd.less_than_f32s(cuts, x));
            count = count.wrapping_add(below.count_ones());
        }
        return count;
    }
    let (one, zero) = (simd.splat_f32s(1.0), simd.splat_f32s(0.0));
    let mut counts = zero;
    for &cuts in lanes {
        counts = simd.add_f32s(counts, simd.select_f32s(simd.less_than_f32s(cuts, x), one, zero));
    }
    simd.reduce_sum_f32s(counts) as u32
}

/// Codes of whole rows, compiled for each instruction set.
pub(super) struct Rows<'a> {
    pub(super) tables: &'a [Table],
    pub(super) values: &'a [f32],
    pub(super) codes: &'a mut [u8],
}

/// Rows that are quantised feature by feature: their values and the feature's table stay in the nearest cache.
const CHUNK: usize = 64;

impl pulp::WithSimd for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.tables.len().max(1);
        for (values, codes) in self.values.chunks(CHUNK * width).zip(self.codes.chunks_mut(CHUNK * width)) {
            for (f, table) in self.tables.iter().enumerate() {
                let values = values.get(f..).unwrap_or_default().iter().step_by(width);
                let codes = codes.get_mut(f..).unwrap_or_default().iter_mut().step_by(width);
                for (code, &x) in codes.zip(values) {
                    *code = table.code(simd, x);
                }
            }
        }
    }
}

/// Codes of rows, a column a feature, compiled for each instruction set.
pub(super) struct Columns<'a> {
    pub(super) tables: &'a [Table],
    pub(super) values: &'a [f32],
    pub(super) codes: &'a mut Codes<u8>,
}

impl pulp::WithSimd for Columns<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (width, rows) = (self.tables.len().max(1), self.codes.rows.max(1));
        for (chunk, values) in self.values.chunks(CHUNK * width).enumerate() {
            let columns = self.codes.by_feature.chunks_exact_mut(rows);
            for (f, (column, table)) in columns.zip(self.tables).enumerate() {
                let codes = column.get_mut(chunk.wrapping_mul(CHUNK)..).unwrap_or_default();
                let values = values.get(f..).unwrap_or_default().iter().step_by(width);
                for (code, &x) in codes.iter_mut().zip(values) {
                    *code = table.code(simd, x);
                }
            }
        }
    }
}
