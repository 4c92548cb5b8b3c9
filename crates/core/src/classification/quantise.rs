//! Quantisation of values: counts comparisons with 16 cuts instead of a binary search; compiled for each instruction
//! set.

use pulp::{Simd, bytemuck};

/// Rows of a tile: two vector registers of codes, so that the processor can work on one while the other waits.
pub(super) const TILE: usize = 128;

/// Codes of the widest row of compact trees.
pub(super) const ROW: usize = 256;

/// Rows that descend a tree in step.
pub(super) const IN_STEP: usize = 12;

/// Codes that may be read behind the last row: those of rows in step.
pub(super) const SPARE: usize = IN_STEP * ROW;

/// Values in a cache line.
const LINE: usize = 16;

/// The codes of one feature for the rows of a tile, in whole cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Column(pub(super) [u8; TILE]);

/// The codes of a block of at most 65,536 rows: by row, in tiles of [`TILE`] rows, or both.
#[derive(Clone, Debug, Default)]
pub(super) struct CodeBlock<C> {
    /// For each tile a column for each feature.
    pub(super) by_tile: Vec<Column>,
    /// Row by row; behind the last row there are more codes that may be read.
    pub(super) by_row: Vec<C>,
    /// From one row to the next in `by_row`: at least the width.
    pub(super) stride: usize,
    pub(super) rows: usize,
    pub(super) width: usize,
}

/// 255 cuts and infinity, and every 16th of them again: a code is found by two comparisons with 16 numbers at once; by
/// one or a few if there are few cuts.
#[derive(Clone, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct CutTable {
    coarse: [f32; 16],
    fine: [[f32; 16]; 16],
    /// Number of cuts.
    cuts: usize,
}

impl CutTable {
    pub(super) fn new(cuts: &[f32]) -> Self {
        let cut = |i: usize| cuts.get(i).copied().unwrap_or(f32::INFINITY);
        let fine = std::array::from_fn(|block| std::array::from_fn(|i| cut(16 * block + i)));
        Self { cuts: cuts.len(), coarse: std::array::from_fn(|block| cut(16 * block + 15)), fine }
    }

    /// Codes of one feature.
    #[inline(always)]
    fn column<S: Simd>(&self, simd: S, feature: Feature<'_>) {
        match self.cuts {
            0 => feature.fill(|_| 0),
            1..=16 => feature.fill(|x| self.flat::<1, S>(simd, x)),
            17..=32 => feature.fill(|x| self.flat::<2, S>(simd, x)),
            _ => feature.fill(|x| self.nested(simd, x)),
        }
    }

    /// The code if all cuts are in the first blocks.
    #[inline(always)]
    fn flat<const BLOCKS: usize, S: Simd>(&self, simd: S, x: f32) -> u8 {
        let x = simd.splat_f32s(x);
        let counts = self.fine.iter().take(BLOCKS).map(|block| count_below(simd, block, x));
        counts.fold(0, u32::wrapping_add) as u8
    }

    #[inline(always)]
    fn nested<S: Simd>(&self, simd: S, x: f32) -> u8 {
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
        // One bit per lane.
        let mut count = 0u32;
        for &cuts in lanes {
            let below: u16 = bytemuck::cast(simd.less_than_f32s(cuts, x));
            count = count.wrapping_add(below.count_ones());
        }
        return count;
    }
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = (&simd as &dyn std::any::Any).downcast_ref::<pulp::x86::V3>() {
        // One bit per lane: its sign.
        let mut count = 0u32;
        for &cuts in lanes {
            let below: pulp::f32x8 = bytemuck::cast(simd.less_than_f32s(cuts, x));
            count = count.wrapping_add(v3.avx._mm256_movemask_ps(bytemuck::cast(below)).count_ones());
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
pub(super) struct QuantiseRows<'a> {
    pub(super) tables: &'a [CutTable],
    pub(super) values: &'a [f32],
    pub(super) codes: &'a mut [u8],
}

impl pulp::WithSimd for QuantiseRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.tables.len().max(1);
        for (values, codes) in self.values.chunks_exact(width).zip(self.codes.chunks_exact_mut(width)) {
            for ((code, &x), table) in codes.iter_mut().zip(values).zip(self.tables) {
                *code = table.nested(simd, x);
            }
        }
    }
}

/// One feature of the rows of a tile: values and codes of the first row at the beginning, those of the others at equal
/// distances.
struct Feature<'a> {
    values: &'a [f32],
    width: usize,
    codes: &'a mut [u8; TILE],
    by_row: &'a mut [u8],
    stride: usize,
}

impl Feature<'_> {
    #[inline(always)]
    fn fill(self, code_of: impl Fn(f32) -> u8) {
        let (mut from, mut to) = (0usize, 0usize);
        for code in self.codes {
            let Some(&x) = self.values.get(from) else { break };
            *code = code_of(x);
            if let Some(to) = self.by_row.get_mut(to) {
                *to = *code;
            }
            from = from.wrapping_add(self.width);
            to = to.wrapping_add(self.stride);
        }
    }
}

/// Codes of rows in tiles; compiled for each instruction set.
pub(super) struct QuantiseTiles<'a> {
    pub(super) tables: &'a [CutTable],
    pub(super) values: &'a [f32],
    pub(super) codes: &'a mut [Column],
    /// The same codes row by row; empty if they are not needed.
    pub(super) by_row: &'a mut [u8],
    /// From one row to the next in `by_row`.
    pub(super) stride: usize,
}

impl pulp::WithSimd for QuantiseTiles<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (width, stride) = (self.tables.len().max(1), self.stride);
        let mut rows = self.by_row.chunks_mut(TILE * stride.max(1));
        for (values, tile) in self.values.chunks(TILE * width).zip(self.codes.chunks_exact_mut(width)) {
            read_ahead(values);
            let rows = rows.next().unwrap_or_default();
            for (f, (table, Column(codes))) in self.tables.iter().zip(tile).enumerate() {
                let values = values.get(f..).unwrap_or_default();
                let by_row = rows.get_mut(f..).unwrap_or_default();
                table.column(simd, Feature { values, width, codes, by_row, stride });
            }
        }
    }
}

/// Reads values sequentially, which loads them from memory much faster than feature by feature.
#[inline(always)]
fn read_ahead(values: &[f32]) {
    std::hint::black_box(values.iter().step_by(LINE).fold(0u32, |bits, x| bits ^ x.to_bits()));
}
