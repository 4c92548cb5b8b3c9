//! The data after the points: extended records and waveforms. They are copied in pieces and never held in memory.

use crate::error::Result;
use crate::io::atomic::AtomicFile;
use crate::io::las::header::vlr::{Vlr, read_at};
use crate::io::las::header::{Header, put, u64_at};
use crate::io::las::records::Records;
use crate::io::las::write::writer::Front;
use crate::parallel::Monitor;
use std::ops::Range;

const PIECE: u64 = 1 << 20;

/// Byte ranges of the input that follow the points of the output.
pub(in crate::io::las) struct Tail {
    ranges: Vec<Range<u64>>,
    /// Extended records among them.
    evlrs: u32,
    pub(in crate::io::las) lost_copc: bool,
}

impl Tail {
    /// Everything after the points except the COPC hierarchy.
    pub(in crate::io::las) fn of(records: &mut Records, front: &mut Front) -> Result<Self> {
        let info = records.vlrs.iter().any(|v| v.user() == "copc");
        let hierarchy = records.evlrs.iter().any(|v| v.user() == "copc");
        if hierarchy {
            let tail = Self::without_copc(records);
            put(&mut front.header, 243, &tail.evlrs.to_le_bytes());
            return Ok(tail);
        }
        let start = start(records);
        let evlrs = if records.header.evlrs_at >= start { records.header.evlrs } else { 0 };
        let ranges = Vec::from_iter((start < records.size).then_some(start..records.size));
        Ok(Self { ranges, evlrs, lost_copc: info })
    }

    fn without_copc(records: &Records) -> Self {
        let (mut at, mut ranges) = (records.header.evlrs_at, Vec::new());
        for vlr in &records.evlrs {
            let end = at + length(vlr);
            if vlr.user() != "copc" {
                ranges.push(at..end);
            }
            at = end;
        }
        let evlrs = ranges.len() as u32;
        Self { ranges, evlrs, lost_copc: true }
    }

    /// Appends the bytes to the output; returns their number.
    pub(in crate::io::las) fn copy(
        &self,
        records: &mut Records,
        file: &mut AtomicFile,
        monitor: &Monitor,
    ) -> Result<u64> {
        let mut written = 0;
        for range in &self.ranges {
            for at in range.clone().step_by(PIECE as usize) {
                monitor.check()?;
                let bytes = read_at(&records.path, &mut records.file, at, (range.end - at).min(PIECE) as usize)?;
                file.write_all(&bytes)?;
                written += bytes.len() as u64;
            }
        }
        Ok(written)
    }

    /// The offset in the output of a byte of the input, if it is copied; the tail starts at `end`.
    fn moved(&self, at: u64, end: u64) -> Option<u64> {
        let mut before = 0;
        for range in &self.ranges {
            if range.contains(&at) {
                return Some(end + before + (at - range.start));
            }
            before += range.end - range.start;
        }
        None
    }

    /// Updates the offsets of extended records and waveforms in the header.
    pub(in crate::io::las) fn patch(&self, old: &Header, header: &mut [u8], end: u64) {
        if self.evlrs > 0 {
            // The remaining records start where the first of them was, or at the start of the tail.
            let at = self.moved(old.evlrs_at, end).unwrap_or(end);
            put(header, 235, &at.to_le_bytes());
        } else if old.minor >= 4 {
            put(header, 235, &[0; 12]);
        }
        // In older versions these bytes of a longer header are user data.
        let wave = if old.minor >= 3 { u64_at(&old.raw, 227) } else { 0 };
        if let Some(at) = self.moved(wave, end).filter(|_| wave > 0) {
            put(header, 227, &at.to_le_bytes());
        }
    }
}

/// Offset of the first byte after the points (and their chunk table).
fn start(records: &Records) -> u64 {
    let header = &records.header;
    let wave = if header.minor >= 3 { u64_at(&header.raw, 227) } else { 0 };
    let start = match &records.chunks {
        None => header.points_at + header.points * u64::from(header.record_length),
        Some(_) if header.evlrs > 0 => header.evlrs_at,
        Some(_) if wave > header.points_at => wave,
        Some(_) => records.size,
    };
    start.min(records.size)
}

/// Bytes of an extended record, including its header.
fn length(vlr: &Vlr) -> u64 {
    60 + u64_at(&vlr.head, 20)
}
