//! Sorts keys by only those bits in which they differ: a few dozen of the 64, even for scattered keys.

use crate::error::{Error, Result};
use crate::parallel::{Monitor, watched};
use crate::voxels::cells::radix::{Bits, radix_sort};

/// Sorts keys; equal ones are dropped.
///
/// # Errors
/// If there are 2^32 or more, or the work was cancelled.
pub(super) fn sorted(mut keys: Vec<u64>, monitor: &Monitor) -> Result<Vec<u64>> {
    check_count(keys.len())?;
    if !keys.is_sorted() {
        let varying = Varying::of(&keys);
        keys.iter_mut().for_each(|key| *key = varying.pack(*key));
        radix_sort(&mut keys, Bits { from: 0, count: varying.count }, |key| *key, monitor)?;
        keys.iter_mut().for_each(|key| *key = varying.unpack(*key));
    }
    keys.dedup();
    Ok(keys)
}

/// Keys ascending, each once, and where the given ones stand among them.
#[derive(Debug, Default)]
pub(super) struct Ranks {
    pub(super) keys: Vec<u64>,
    /// Place in `keys` of each key that was given.
    pub(super) of: Vec<u32>,
}

/// Sorts keys and keeps where each went.
///
/// # Errors
/// As [`sorted`].
pub(super) fn ranked(keys: &[u64], monitor: &Monitor) -> Result<Ranks> {
    check_count(keys.len())?;
    let varying = Varying::of(keys);
    let numbered = keys.iter().zip(0u32..);
    match varying.count {
        0..=32 => {
            let mut rows: Vec<u64> = numbered.map(|(&key, i)| varying.pack(key) << 32 | u64::from(i)).collect();
            radix_sort(&mut rows, Bits { from: 32, count: varying.count }, |row| *row, monitor)?;
            let rows = rows.into_iter().map(|row| Row { key: varying.unpack(row >> 32), number: row as u32 });
            of_sorted(rows, monitor)
        }
        _ => {
            let mut rows: Vec<Row> = numbered.map(|(&key, number)| Row { key: varying.pack(key), number }).collect();
            radix_sort(&mut rows, Bits { from: 0, count: varying.count }, |row| row.key, monitor)?;
            of_sorted(rows.into_iter().map(|row| Row { key: varying.unpack(row.key), ..row }), monitor)
        }
    }
}

fn check_count(count: usize) -> Result<()> {
    match u32::try_from(count) {
        Ok(_) => Ok(()),
        Err(_) => Err(Error::input(format!("{count} sites (allowed: below 2^32)"))),
    }
}

/// A key, and which of the given ones it is.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    key: u64,
    number: u32,
}

fn of_sorted(mut rows: impl ExactSizeIterator<Item = Row>, monitor: &Monitor) -> Result<Ranks> {
    let mut ranks = Ranks { keys: Vec::with_capacity(rows.len()), of: vec![0; rows.len()] };
    for piece in watched(rows.len(), monitor) {
        for Row { key, number } in rows.by_ref().take(piece?.len()) {
            if ranks.keys.last() != Some(&key) {
                ranks.keys.push(key);
            }
            ranks.of[number as usize] = ranks.keys.len() as u32 - 1;
        }
    }
    Ok(ranks)
}

/// The bits in which some keys differ, as runs of neighbouring bits.
struct Varying {
    runs: Vec<Run>,
    /// How many they are.
    count: u32,
    /// The bits that all keys share, in their places.
    common: u64,
}

/// Bits that are side by side in a key.
struct Run {
    mask: u64,
    /// By how much lower they are in the packed key.
    shift: u32,
}

impl Varying {
    fn of(keys: &[u64]) -> Self {
        let first = keys.first().copied().unwrap_or_default();
        let varying = keys.iter().fold(0, |bits, key| bits | (key ^ first));
        let (mut runs, mut count, mut rest) = (Vec::new(), 0, varying);
        while rest != 0 {
            let low = rest.trailing_zeros();
            let length = (rest >> low).trailing_ones();
            let mask = u64::MAX >> (64 - length) << low;
            runs.push(Run { mask, shift: low - count });
            count += length;
            rest &= !mask;
        }
        Self { runs, count, common: first & !varying }
    }

    /// The varying bits of a key, side by side: a number that sorts as the key does.
    #[inline(always)]
    fn pack(&self, key: u64) -> u64 {
        self.runs.iter().fold(0, |packed, run| packed | (key & run.mask) >> run.shift)
    }

    #[inline(always)]
    fn unpack(&self, packed: u64) -> u64 {
        self.runs.iter().fold(self.common, |key, run| key | packed << run.shift & run.mask)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// Keys of few bits and of all, with bits that never change between others, and with equal ones.
    #[test]
    fn keys_are_in_the_order_of_the_standard_library() {
        let mut s = stream(3, 9);
        for mask in [0, 1, 0xff_00ff, 0x8000_0000_0000_0001, 0x1ff_03fe_0000_07f8, u64::MAX] {
            let mut word = || (0..4).fold(0, |word, _| word << 16 | s.below(1 << 16) as u64);
            let common = word() & !mask;
            let keys: Vec<u64> = (0..3000).map(|_| word() & mask | common).collect();
            let mut expected = keys.clone();
            expected.sort_unstable();
            expected.dedup();
            assert_eq!(sorted(keys.clone(), &Monitor::default()).unwrap(), expected, "{mask:x}");
            let ranks = ranked(&keys, &Monitor::default()).unwrap();
            assert_eq!(ranks.keys, expected, "{mask:x}");
            assert!(keys.iter().zip(&ranks.of).all(|(key, &rank)| expected[rank as usize] == *key), "{mask:x}");
        }
        assert!(sorted(Vec::new(), &Monitor::default()).unwrap().is_empty());
        assert!(ranked(&[], &Monitor::default()).unwrap().of.is_empty());
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(sorted(vec![2, 1], &monitor).is_err() && ranked(&[2, 1], &monitor).is_err());
    }
}
