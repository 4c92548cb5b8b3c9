//! Sums of derivatives by feature and code, as integers: every order of summation gives the same bits.
//!
//! A cell is two 64-bit integers: the sum of first derivatives; and, in one number, the sum of second derivatives in
//! the upper 40 bits and the count of samples in the lower 24. Adding a sample is two additions, and a sibling is
//! parent minus child.

use crate::classification::boosting::growing::blocks::LANES;
use crate::parallel::fold_ordered;

/// Largest count of samples that fits.
pub(in crate::classification::boosting) const MAX_ROWS: usize = (1 << 24) - 1;

const COUNT_BITS: u32 = 24;
const FIRST_RANGE: f64 = (1u64 << 61) as f64;
const SECOND_RANGE: f64 = ((1u64 << 40) - (1 << 25)) as f64;
const CHUNK: usize = 1 << 14;

/// Fixed-point sums.
pub(in crate::classification::boosting) type Cell = [u64; 2];

/// Cells of the features of a block, by code.
pub(in crate::classification::boosting) type Cells = [[Cell; 256]; LANES];

/// Adds a cell.
#[inline(always)]
pub(in crate::classification::boosting) fn plus(a: Cell, b: Cell) -> Cell {
    [a[0].wrapping_add(b[0]), a[1].wrapping_add(b[1])]
}

/// Subtracts a cell.
#[inline(always)]
pub(in crate::classification::boosting) fn minus(a: Cell, b: Cell) -> Cell {
    [a[0].wrapping_sub(b[0]), a[1].wrapping_sub(b[1])]
}

/// Number of samples in a cell.
#[inline(always)]
pub(in crate::classification::boosting) fn count(cell: Cell) -> u64 {
    cell[1] & ((1 << COUNT_BITS) - 1)
}

/// Conversion between numbers and fixed-point cells, scaled so that no sum overflows.
#[derive(Clone, Copy, Debug)]
pub(in crate::classification::boosting) struct Scale {
    to: [f64; 2],
    from: [f64; 2],
}

impl Scale {
    /// The scale for these derivatives, of which the second are not negative.
    pub(in crate::classification::boosting) fn of(derivatives: &[[f32; 2]]) -> Self {
        let sums = |range: std::ops::Range<usize>| {
            let part = derivatives.get(range).unwrap_or_default().iter();
            part.fold([0.0f64; 2], |[g, h], d| [g + f64::from(d[0].abs()), h + f64::from(d[1])])
        };
        let sums = fold_ordered(derivatives.len(), CHUNK, sums, |a, b| [a[0] + b[0], a[1] + b[1]]);
        let [g, h] = sums.unwrap_or_default().map(|sum| sum.max(1e-30));
        let to = [FIRST_RANGE / g, SECOND_RANGE / h];
        Self { to, from: to.map(|t| 1.0 / t) }
    }

    /// The cell of one sample.
    #[inline]
    pub(in crate::classification::boosting) fn cell(&self, derivatives: [f32; 2]) -> Cell {
        let first = (f64::from(derivatives[0]) * self.to[0]).round_ties_even() as i64;
        let second = (f64::from(derivatives[1]) * self.to[1]).round_ties_even() as u64;
        [first as u64, (second << COUNT_BITS) | 1]
    }

    /// First and second derivatives of a sum.
    #[inline(always)]
    pub(in crate::classification::boosting) fn sums(&self, cell: Cell) -> (f64, f64) {
        (cell[0] as i64 as f64 * self.from[0], (cell[1] >> COUNT_BITS) as f64 * self.from[1])
    }
}

/// Number of rows whose codes are fetched ahead: a short loop keeps many memory loads in flight.
const AHEAD: usize = 128;

/// Adds the samples `rows` to the histograms of a block; `samples` holds their cells in the same order.
pub(in crate::classification::boosting) fn accumulate(
    cells: &mut Cells,
    codes: &[[u8; LANES]],
    rows: &[u32],
    samples: &[Cell],
) {
    let mut ahead = [[0u8; LANES]; AHEAD];
    for (rows, samples) in rows.chunks(AHEAD).zip(samples.chunks(AHEAD)) {
        for (to, &row) in ahead.iter_mut().zip(rows) {
            *to = codes.get(row as usize).copied().unwrap_or_default();
        }
        for (codes, &sample) in ahead.iter().zip(samples) {
            for (lane, &code) in cells.iter_mut().zip(codes) {
                let cell = &mut lane[usize::from(code)];
                *cell = plus(*cell, sample);
            }
        }
    }
}

/// Subtracts one block's histograms from another's.
pub(in crate::classification::boosting) fn subtract(parent: &mut Cells, child: &Cells) {
    for (parent, child) in parent.as_flattened_mut().iter_mut().zip(child.as_flattened()) {
        *parent = minus(*parent, *child);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn sums_come_back_and_siblings_are_differences() {
        let mut random = stream(1, 0);
        let pairs: Vec<[f32; 2]> =
            (0..1000).map(|_| [random.uniform() as f32 * 2.0 - 1.0, random.uniform() as f32]).collect();
        let scale = Scale::of(&pairs);
        let samples: Vec<Cell> = pairs.iter().map(|&p| scale.cell(p)).collect();
        let codes: Vec<[u8; LANES]> = (0..1000).map(|i| [(i * 7 % 256) as u8; LANES]).collect();
        let rows: Vec<u32> = (0..1000).collect();
        let build = |rows: std::ops::Range<usize>, all: &[u32]| {
            let mut cells = Box::new([[[0; 2]; 256]; LANES]);
            accumulate(&mut cells, &codes, &all[rows.clone()], &samples[rows]);
            cells
        };
        let (mut whole, part, rest) = (build(0..1000, &rows), build(0..300, &rows), build(300..1000, &rows));
        let total = whole[3].iter().fold([0; 2], |a, &b| plus(a, b));
        let (g, h) = scale.sums(total);
        let wanted = pairs.iter().fold((0.0, 0.0), |(g, h), p| (g + f64::from(p[0]), h + f64::from(p[1])));
        assert!((g - wanted.0).abs() < 1e-9 && (h - wanted.1).abs() < 1e-6, "{g} {h} {wanted:?}");
        assert_eq!(count(total), 1000);
        subtract(&mut whole, &part);
        assert!(whole == rest);
    }
}
