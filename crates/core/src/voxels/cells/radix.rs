//! Sorting by the digits of a number.

use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Bits of a number by which rows are sorted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bits {
    /// The lowest of them.
    pub(crate) from: u32,
    pub(crate) count: u32,
}

/// Bits of a digit: 2^11 counters stay in the fastest cache.
const DIGIT: u32 = 11;

/// Sorts rows by some bits of a number, digit by digit from the lowest; rows of the same number keep their order.
pub(crate) fn radix_sort<T: Copy + Default + Send>(
    rows: &mut Vec<T>,
    bits: Bits,
    number: impl Fn(&T) -> u64,
    monitor: &Monitor,
) -> Result<()> {
    if rows.is_sorted_by_key(|row| number(row) >> bits.from) {
        return Ok(());
    }
    let digits = bits.count.div_ceil(DIGIT);
    let width = bits.count.div_ceil(digits);
    let mut other = vec![T::default(); rows.len()];
    for digit in 0..digits {
        let of = |row: &T| (number(row) >> (bits.from + digit * width)) as usize & ((1 << width) - 1);
        let mut places = vec![0u32; 1 << width];
        rows.iter().for_each(|row| places[of(row)] += 1);
        let mut next = 0;
        places.iter_mut().for_each(|place| next += std::mem::replace(place, next));
        for piece in watched(rows.len(), monitor) {
            for row in &rows[piece?] {
                let place = &mut places[of(row)];
                other[*place as usize] = *row;
                *place += 1;
            }
        }
        std::mem::swap(rows, &mut other);
    }
    Ok(())
}
