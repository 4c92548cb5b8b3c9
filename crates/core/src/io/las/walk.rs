//! Finds the chunks of a LAZ file without its table, one after the other.

use super::chunks::Chunk;
use super::decoder::{self, Decoder, How};
use super::header::Header;
use super::records::slab;
use super::salvage::layered_size;
use super::vlr::read_at;
use crate::error::Result;
use crate::parallel::Monitor;
use laz::{DecompressionSelection, LazVlr};
use std::fs::File;
use std::path::Path;

/// The chunks from the first on, up to `end` or to bytes that are not a chunk. The last one may be incomplete.
///
/// A layered chunk (LAZ 3) stores its size and number of points; the size of an older one is known after decoding it.
pub(super) fn chunks(
    path: &Path,
    file: &mut File,
    (header, vlr): (&Header, &LazVlr),
    end: u64,
    monitor: &Monitor,
) -> Result<Vec<Chunk>> {
    let (mut at, mut left) = (header.points_at + 8, header.points);
    let mut list = Vec::new();
    let usual = if vlr.uses_variable_size_chunks() { left } else { u64::from(vlr.chunk_size()) };
    while at < end && left > 0 {
        monitor.check()?;
        let found = match decoder::layered(vlr) {
            true => layered(path, file, (vlr, usual.min(left)), (at, end))?,
            false => sequential(path, file, (header, vlr, usual.min(left)), (at, end), monitor)?,
        };
        let Some(chunk) = found else { break };
        at += chunk.bytes;
        left -= chunk.points;
        list.push(chunk);
    }
    Ok(list)
}

fn layered(path: &Path, file: &mut File, (vlr, most): (&LazVlr, u64), (at, end): (u64, u64)) -> Result<Option<Chunk>> {
    let head = vlr.items_size() + 4 + 4 * decoder::layers(vlr) as u64;
    let bytes = read_at(path, file, at, head.min(end - at) as usize)?;
    Ok(match layered_size(vlr, &bytes) {
        Some((bytes, points)) if points > 0 && points <= most && bytes <= end - at => Some(Chunk { at, bytes, points }),
        _ => None,
    })
}

fn sequential(
    path: &Path,
    file: &mut File,
    (header, vlr, most): (&Header, &LazVlr, u64),
    (at, end): (u64, u64),
    monitor: &Monitor,
) -> Result<Option<Chunk>> {
    // No encoder produces points larger than twice their uncompressed size.
    let length = usize::from(header.record_length);
    let room = (end - at).min(most.saturating_mul(2 * length as u64) + 1024).min(1 << 28);
    let bytes = read_at(path, file, at, room as usize)?;
    let how = How { vlr, selection: DecompressionSelection::all(), whole: false };
    let Ok(mut decoder) = Decoder::new(path, how, (0, &bytes)) else {
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
