//! Decodes the chunks of a file in their order: small ones in parallel, large ones in pieces.

use super::decoder::{ChunkBytes, Decoder, How, decode};
use super::{Chunk, Chunks};
use crate::error::Result;
use crate::io::las::header::vlr::read_at;
use crate::parallel::{Monitor, map_ordered};
use laz::DecompressionSelection;
use std::fs::File;
use std::path::Path;

/// Number of points of a slab of an uncompressed file, and of a piece of a large chunk.
pub(in crate::io::las) const SLAB: usize = 100_000;
/// Chunks with more points than this are decoded in pieces, so that the memory does not depend on the declared size.
const LARGE: u64 = 200_000;
/// Largest size of a slab in bytes: records may be 65,535 bytes long.
const SLAB_BYTES: usize = 32 << 20;
/// Number of points of a slab, for records of this length.
pub(in crate::io::las) fn slab(length: usize) -> usize {
    SLAB.min(SLAB_BYTES / length.max(1)).max(1)
}

/// Whether a chunk is decoded in pieces.
fn large(chunk: &Chunk, length: usize) -> bool {
    chunk.points > LARGE || chunk.points > 2 * slab(length) as u64
}

/// A file in LAZ and what is decoded of it.
pub(in crate::io::las) struct Compressed<'a> {
    pub(in crate::io::las) path: &'a Path,
    pub(in crate::io::las) file: &'a mut File,
    pub(in crate::io::las) chunks: &'a Chunks,
    /// Fields that are decoded (layered chunks only).
    pub(in crate::io::las) selection: DecompressionSelection,
    /// Bytes of a record.
    pub(in crate::io::las) length: usize,
}

/// The place in a file up to which its chunks are decoded.
#[derive(Default)]
pub(in crate::io::las) struct Unpacker {
    /// Chunk to decode next.
    next: usize,
    /// A chunk that is too large to be decoded at once, and its number of remaining points.
    large: Option<(Decoder<'static, Vec<u8>>, u64)>,
}

impl Unpacker {
    /// Begins with that chunk.
    pub(in crate::io::las) fn from(chunk: usize) -> Self {
        Self { next: chunk, large: None }
    }

    /// The records of the next chunks, one vector each, decoded in parallel: at most `most`, at least one; or those of a
    /// piece of a large chunk. No vector after the last chunk.
    pub(in crate::io::las) fn next(
        &mut self,
        from: Compressed<'_>,
        most: usize,
        monitor: &Monitor,
    ) -> Result<Vec<Vec<u8>>> {
        monitor.check()?;
        if self.large.is_some() {
            return self.piece(from.length);
        }
        let Compressed { path, file, chunks, selection, length } = from;
        let (first, left) = (self.next, chunks.list.get(self.next..).unwrap_or_default());
        let small = left.iter().take(most).take_while(|c| !large(c, length)).count();
        let group = &left[..left.len().min(small.max(1))];
        let how = How { vlr: &chunks.vlr, selection, whole: chunks.whole };
        let mut packed = Vec::with_capacity(group.len());
        for chunk in group {
            packed.push(read_at(path, file, chunk.at, chunk.bytes as usize)?);
        }
        self.next += group.len();
        if small == 0 {
            let (Some(chunk), Some(bytes)) = (group.first(), packed.pop()) else { return Ok(Vec::new()) };
            self.large = Some((Decoder::new(path, how, ChunkBytes { index: first, bytes })?, chunk.points));
            return self.piece(length);
        }
        map_ordered(group.len(), monitor, |i| {
            let mut bytes = vec![0; group[i].points as usize * length];
            if !bytes.is_empty() {
                decode(path, how, ChunkBytes { index: first + i, bytes: &packed[i] }, &mut bytes)?;
            }
            Ok(bytes)
        })
    }

    /// The next records of a large chunk.
    fn piece(&mut self, length: usize) -> Result<Vec<Vec<u8>>> {
        let Some((decoder, left)) = &mut self.large else { return Ok(Vec::new()) };
        let mut bytes = vec![0; (*left).min(slab(length) as u64) as usize * length];
        decoder.next(&mut bytes)?;
        *left -= (bytes.len() / length) as u64;
        if *left == 0 {
            decoder.end()?;
            self.large = None;
        }
        Ok(vec![bytes])
    }
}
