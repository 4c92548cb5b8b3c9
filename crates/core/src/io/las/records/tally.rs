//! Counts and bounds of points, as in a header.

use crate::cloud::Bounds;
use crate::io::las::header::{Header, array, put};

/// Counts and bounds of the records so far.
#[derive(Clone, Debug)]
pub(in crate::io::las) struct Tally {
    points: u64,
    returns: [u64; 15],
    low: [i32; 3],
    high: [i32; 3],
    /// Bit mask of the return number.
    mask: u8,
}

impl Tally {
    /// For records of that point format.
    pub(in crate::io::las) fn new(format: u8) -> Self {
        let mask = if format >= 6 { 15 } else { 7 };
        Self { points: 0, returns: [0; 15], low: [i32::MAX; 3], high: [i32::MIN; 3], mask }
    }

    /// Adds whole records.
    pub(in crate::io::las) fn add(&mut self, records: &[u8], length: usize) {
        for record in records.chunks_exact(length) {
            self.points += 1;
            if let Some(count) = self.returns.get_mut(usize::from((record[14] & self.mask).wrapping_sub(1))) {
                *count += 1;
            }
            for a in 0..3 {
                let tick = i32::from_le_bytes(array(record, 4 * a));
                (self.low[a], self.high[a]) = (self.low[a].min(tick), self.high[a].max(tick));
            }
        }
    }

    /// Number of records so far.
    pub(in crate::io::las) fn points(&self) -> u64 {
        self.points
    }

    /// Lowest and highest coordinates; those of the header if there is no point.
    pub(in crate::io::las) fn bounds(&self, header: &Header) -> Bounds {
        if self.points == 0 {
            return [header.low, header.high];
        }
        let place = |ticks: [i32; 3]| [0, 1, 2].map(|a| f64::from(ticks[a]).mul_add(header.scale[a], header.offset[a]));
        [place(self.low), place(self.high)]
    }

    /// Writes counts and bounds into the bytes of a header.
    pub(in crate::io::las) fn put(&self, header: &Header, raw: &mut [u8]) {
        let narrow = |n: u64| if header.format < 6 { u32::try_from(n).unwrap_or(0) } else { 0 };
        put(raw, 107, &narrow(self.points).to_le_bytes());
        (0..5).for_each(|r| put(raw, 111 + 4 * r, &narrow(self.returns[r]).to_le_bytes()));
        if header.minor >= 4 {
            put(raw, 247, &self.points.to_le_bytes());
            (0..15).for_each(|r| put(raw, 255 + 8 * r, &self.returns[r].to_le_bytes()));
        }
        let [low, high] = self.bounds(header);
        for a in 0..3 {
            put(raw, 187 + 16 * a, &low[a].to_le_bytes());
            put(raw, 179 + 16 * a, &high[a].to_le_bytes());
        }
    }
}
