//! Finds the chunks of a LAZ file without its table, one after the other.

use super::chunks::Chunk;
use super::chunks::decoder::{self, ChunkBytes, Decoder, How};
use super::header::vlr::read_at;
use super::header::{Header, u32_at};
use super::records::slab;
use crate::error::Result;
use crate::parallel::Monitor;
use laz::{DecompressionSelection, LazVlr};
use std::fs::File;
use std::path::Path;

/// A file whose chunks are searched.
pub(super) struct Walk<'a> {
    pub(super) path: &'a Path,
    pub(super) file: &'a mut File,
    pub(super) header: &'a Header,
    pub(super) vlr: &'a LazVlr,
    /// Offset before which all chunks lie.
    pub(super) end: u64,
}

impl Walk<'_> {
    /// The chunks from the first on, up to the end or to bytes that are not a chunk. The last one may be incomplete.
    ///
    /// A layered chunk (LAZ 3) stores its size and number of points; the size of an older one is known after decoding
    /// it.
    pub(super) fn chunks(&mut self, monitor: &Monitor) -> Result<Vec<Chunk>> {
        let (mut at, mut left) = (self.header.points_at + 8, self.header.points);
        let mut list = Vec::new();
        let usual = if self.vlr.uses_variable_size_chunks() { left } else { u64::from(self.vlr.chunk_size()) };
        while at < self.end && left > 0 {
            monitor.check()?;
            let found = match decoder::layered(self.vlr) {
                true => self.layered(at, usual.min(left))?,
                false => self.sequential(at, usual.min(left), monitor)?,
            };
            let Some(chunk) = found else { break };
            at += chunk.bytes;
            left -= chunk.points;
            list.push(chunk);
        }
        Ok(list)
    }

    /// The layered chunk at an offset, of at most `most` points.
    fn layered(&mut self, at: u64, most: u64) -> Result<Option<Chunk>> {
        let Self { vlr, end, .. } = *self;
        let head = vlr.items_size() + 4 + 4 * decoder::layers(vlr) as u64;
        let bytes = read_at(self.path, self.file, at, head.min(end - at) as usize)?;
        Ok(match layered_size(vlr, &bytes) {
            Some((bytes, points)) if points > 0 && points <= most && bytes <= end - at => {
                Some(Chunk { at, bytes, points })
            }
            _ => None,
        })
    }

    /// The older chunk at an offset, of `most` points.
    fn sequential(&mut self, at: u64, most: u64, monitor: &Monitor) -> Result<Option<Chunk>> {
        // No encoder produces points larger than twice their uncompressed size.
        let length = usize::from(self.header.record_length);
        let room = (self.end - at).min(most.saturating_mul(2 * length as u64) + 1024).min(1 << 28);
        let bytes = read_at(self.path, self.file, at, room as usize)?;
        let how = How { vlr: self.vlr, selection: DecompressionSelection::all(), whole: false };
        let Ok(mut decoder) = Decoder::new(self.path, how, ChunkBytes { index: 0, bytes: &bytes }) else {
            return Ok(None);
        };
        let mut buffer = vec![0; most.min(slab(length) as u64) as usize * length];
        let mut done = 0;
        while done < most {
            monitor.check()?;
            let now = (most - done).min(slab(length) as u64);
            if decoder.next(&mut buffer[..now as usize * length]).is_err() {
                // Truncated or damaged: the caller finds how many of its points are intact.
                return Ok(Some(Chunk { at, bytes: room, points: most }));
            }
            done += now;
        }
        Ok(Some(Chunk { at, bytes: decoder.consumed().min(room), points: most }))
    }
}

/// Size and number of points stored in a layered chunk; `None` if its head is truncated.
fn layered_size(vlr: &LazVlr, bytes: &[u8]) -> Option<(u64, u64)> {
    let (start, layers) = (vlr.items_size() as usize, decoder::layers(vlr));
    let head = bytes.get(start..start + 4 + 4 * layers)?;
    let sum: u64 = (0..layers).map(|l| u64::from(u32_at(head, 4 + 4 * l))).sum();
    Some(((start + head.len()) as u64 + sum, u64::from(u32_at(head, 0))))
}
