//! LAZ: the LAZ record and the chunk table, checked before anything is allocated, and encoding of chunks in memory.

pub(super) mod decoder;
pub(super) mod unpack;

use super::header::vlr::{Vlr, read_at};
use super::header::{Header, RECORD_SIZES, bad, put, u16_at, u32_at};
use crate::error::{Error, Mismatch, Result};
use decoder::{guarded, layered};
use laz::laszip::{ChunkTable, ChunkTableEntry, LazItemType};
use laz::record::{LayeredPointRecordCompressor, RecordCompressor, SequentialPointRecordCompressor};
use laz::{LazItem, LazVlr};
use std::fs::File;
use std::io::Cursor;
use std::ops::Range;
use std::path::Path;

/// A chunk: position of its bytes, and its number of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::io) struct Chunk {
    pub(in crate::io) at: u64,
    pub(super) bytes: u64,
    pub(super) points: u64,
}

/// The items of a LAZ record and the chunks of the file.
#[derive(Debug)]
pub(in crate::io) struct Chunks {
    pub(super) vlr: LazVlr,
    /// Whether a chunk must end exactly after its last point; false for a damaged file.
    pub(super) whole: bool,
    pub(in crate::io) list: Vec<Chunk>,
}

/// The header and the records before the points.
#[derive(Clone, Copy)]
pub(super) struct LasHead<'a> {
    pub(super) header: &'a Header,
    pub(super) vlrs: &'a [Vlr],
}

/// Reads and checks the LAZ record and the chunk table.
pub(super) fn read_table(path: &Path, file: &mut File, head: LasHead<'_>, size: u64) -> Result<Chunks> {
    let header = head.header;
    let vlr = check_record(path, head)?;
    if header.points == 0 {
        return Ok(Chunks { vlr, whole: true, list: Vec::new() });
    }
    let first = header.points_at + 8;
    let table_at = table_offset(path, file, header.points_at, size)?;
    let head = read_at(path, file, table_at, 8)?;
    let count = u64::from(u32_at(&head, 4));
    let table = read_at(path, file, table_at, (size - table_at).min(16 + 16 * count) as usize)?;
    // An entry takes at least a few bits, and each chunk at least the bytes of one point.
    if count == 0 || count > header.points || count > table_at - first {
        let most = header.points.min(table_at - first);
        return Err(bad(path, "number of chunks", table_at + 4, Mismatch::new(count, format!("1 to {most}"))));
    }
    let variable = vlr.uses_variable_size_chunks();
    let entries = guarded(path, "chunk table", || ChunkTable::read(&mut Cursor::new(&table), variable))?;
    let declared = DeclaredChunks { vlr: &vlr, points: header.points, bytes: first..table_at };
    list(path, &entries, declared).map(|list| Chunks { vlr, whole: true, list })
}

/// The LAZ record, with its items checked against the header.
pub(super) fn check_record(path: &Path, LasHead { header, vlrs }: LasHead<'_>) -> Result<LazVlr> {
    let vlr = vlrs.iter().find(|v| v.is("laszip encoded", 22204));
    let vlr = vlr.ok_or_else(|| bad(path, "LAZ record", 100, Mismatch::new("none", "a VLR `laszip encoded` 22204")))?;
    check_items(path, header, vlr)
}

/// What a file says of all its chunks together.
struct DeclaredChunks<'a> {
    vlr: &'a LazVlr,
    /// Number of points.
    points: u64,
    /// From the first chunk to the table.
    bytes: Range<u64>,
}

/// The positions of consecutive chunks; their total is checked against header and file.
fn list(path: &Path, table: &ChunkTable, declared: DeclaredChunks<'_>) -> Result<Vec<Chunk>> {
    let DeclaredChunks { vlr, points, bytes: Range { start: first, end } } = declared;
    let mut list = Vec::with_capacity(table.len());
    let (mut at, mut left) = (first, points);
    for (i, entry) in table.into_iter().enumerate() {
        let points =
            if vlr.uses_variable_size_chunks() { entry.point_count } else { left.min(u64::from(vlr.chunk_size())) };
        let field = |name: &str| format!("{name} of chunk {i}");
        if entry.byte_count > end - at {
            return Err(bad(
                path,
                &field("size"),
                at,
                Mismatch::new(entry.byte_count, format!("at most {}", end - at)),
            ));
        }
        // A compressed point takes at least part of a byte; no real file comes near 4096 points a byte.
        if points > left || points > entry.byte_count.saturating_mul(4096) {
            return Err(bad(
                path,
                &field("number of points"),
                at,
                Mismatch::new(points, format!("at most {}", left.min(4096 * entry.byte_count))),
            ));
        }
        list.push(Chunk { at, bytes: entry.byte_count, points });
        at += entry.byte_count;
        left -= points;
    }
    match left {
        0 => Ok(list),
        _ => Err(bad(
            path,
            "number of points",
            107,
            Mismatch::new(points, format!("{} as the chunks hold", points - left)),
        )),
    }
}

/// Position of the chunk table; old writers put it at the end of the file.
fn table_offset(path: &Path, file: &mut File, points_at: u64, size: u64) -> Result<u64> {
    let valid = |at: u64| at >= points_at + 8 && at <= size - 8;
    for place in [points_at, size - 8] {
        let at = i64::from_le_bytes(super::header::array(&read_at(path, file, place, 8)?, 0));
        if u64::try_from(at).is_ok_and(valid) {
            return Ok(at as u64);
        }
        if at > 0 {
            return Err(bad(
                path,
                "offset to chunk table",
                place,
                Mismatch::new(at, format!("{} to {}", points_at + 8, size - 8)),
            ));
        }
    }
    Err(bad(
        path,
        "offset to chunk table",
        points_at,
        Mismatch::new("none", "a table after the chunks; the file is incomplete"),
    ))
}

fn check_items(path: &Path, header: &Header, vlr: &Vlr) -> Result<LazVlr> {
    let wrong = |field: &str, found: String, allowed: &str| {
        bad(path, field, header.raw.len() as u64, Mismatch::new(found, allowed.to_string()))
    };
    let unsupported = |reason: String| Error::Unsupported { path: path.to_path_buf(), reason };
    if vlr.data.len() < 34 || vlr.data.len() < 34 + 6 * usize::from(u16_at(&vlr.data, 32)) {
        return Err(wrong("LAZ record length", vlr.data.len().to_string(), "34 bytes and 6 for each item"));
    }
    match u16_at(&vlr.data, 0) {
        2 | 3 => {}
        1 => {
            return Err(unsupported(
                "LAZ compressor PointWise (LASzip before 1.0) is not supported; rewrite the file with laszip".into(),
            ));
        }
        other => {
            return Err(wrong("LAZ compressor", other.to_string(), "2 (pointwise chunked) or 3 (layered chunked)"));
        }
    }
    let bytes = item_bytes(&vlr.data).map_err(|(found, allowed)| wrong("LAZ item", found, &allowed))?;
    if bytes != u64::from(header.record_length) {
        return Err(wrong(
            "LAZ items",
            format!("{bytes} bytes a point"),
            &format!("{} as the header says", header.record_length),
        ));
    }
    let mut data = vlr.data.clone();
    if u32_at(&data, 12) == 0 {
        // Chunks of any size, as LASzip reads it; lasR writes it.
        put(&mut data, 12, &u32::MAX.to_le_bytes());
    }
    let parsed = LazVlr::from_buffer(&data).map_err(|e| unsupported(format!("LAZ record: {e}")))?;
    let base = match (header.format, parsed.items().first().map(LazItem::item_type)) {
        (0..=5, Some(LazItemType::Point10)) | (6..=10, Some(LazItemType::Point14)) => true,
        _ => RECORD_SIZES.len() < usize::from(header.format),
    };
    if !base {
        return Err(wrong(
            "LAZ items",
            parsed.items().first().map_or("none".into(), |item| format!("{:?}", item.item_type())),
            "the point item of the point format first",
        ));
    }
    Ok(parsed)
}

/// Total bytes of the items of a LAZ record, or the invalid item and what is allowed.
fn item_bytes(data: &[u8]) -> std::result::Result<u64, (String, String)> {
    let items = data[34..].chunks_exact(6).take(usize::from(u16_at(data, 32)));
    let sizes = items.map(|item| {
        let (kind, size) = (u16_at(item, 0), u16_at(item, 2));
        let right = match kind {
            0 | 14 => size,
            6 => 20,
            7 | 12 => 8,
            8 | 11 => 6,
            9 | 13 => 29,
            10 => 30,
            _ => return Err((format!("type {kind}"), "types 0 and 6 to 14".into())),
        };
        if size == right { Ok(u64::from(size)) } else { Err((format!("{size} bytes, type {kind}"), right.to_string())) }
    });
    sizes.sum()
}

/// Encodes records as one chunk.
pub(super) fn encode(path: &Path, vlr: &LazVlr, records: &[u8]) -> Result<Vec<u8>> {
    let encoded = guarded(path, "LAZ encoder", || {
        let target = Cursor::new(Vec::with_capacity(records.len() / 4 + 1024));
        if layered(vlr) {
            let mut encoder = LayeredPointRecordCompressor::new(target);
            encoder.set_fields_from(vlr.items()).map_err(std::io::Error::other)?;
            encoder.compress_many(records)?;
            encoder.done()?;
            Ok(encoder.into_inner().into_inner())
        } else {
            let mut encoder = SequentialPointRecordCompressor::new(target);
            encoder.set_fields_from(vlr.items()).map_err(std::io::Error::other)?;
            encoder.compress_many(records)?;
            encoder.done()?;
            Ok(encoder.into_inner().into_inner())
        }
    });
    // Happens where GPS times change sign: the differences of their bits overflow in the encoder.
    encoded.map_err(|_| Error::Unsupported {
        path: path.to_path_buf(),
        reason:
            "the LAZ encoder cannot hold these points (are there negative GPS times among positive ones?); write .las"
                .into(),
    })
}

/// The chunk table for chunks of these (points, bytes).
pub(super) fn encode_table(path: &Path, vlr: &LazVlr, sizes: &[(u64, u64)]) -> Result<Vec<u8>> {
    let mut table = ChunkTable::with_capacity(sizes.len());
    sizes.iter().for_each(|&(point_count, byte_count)| table.push(ChunkTableEntry { point_count, byte_count }));
    guarded(path, "chunk table", || {
        let mut bytes = Vec::new();
        table.write_to(&mut bytes, vlr).map(|()| bytes)
    })
}
