//! LAZ: the chunk table, and chunks decoded and encoded one by one in memory.
//!
//! The arithmetic coding is the `laz` crate's. Whatever it would allocate from declared sizes is checked here first, and a
//! panic inside it becomes an error.

use super::header::{Header, RECORD_SIZES, bad, u16_at, u32_at};
use super::vlr::{Vlr, read_at};
use crate::error::{Error, Result};
use laz::laszip::{ChunkTable, ChunkTableEntry, LazItemType};
use laz::record::{
    LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor, RecordDecompressor,
    SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazVlr};
use std::fs::File;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A chunk: where its bytes stand and how many points it holds.
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
    pub(in crate::io) list: Vec<Chunk>,
}

/// Reads and checks the LAZ record and the chunk table.
pub(super) fn read_table(path: &Path, file: &mut File, (header, vlrs): (&Header, &[Vlr]), size: u64) -> Result<Chunks> {
    let vlr = check_record(path, header, vlrs)?;
    if header.points == 0 {
        return Ok(Chunks { vlr, list: Vec::new() });
    }
    let first = header.points_at + 8;
    let table_at = table_offset(path, file, header.points_at, size)?;
    let head = read_at(path, file, table_at, 8)?;
    let count = u64::from(u32_at(&head, 4));
    let table = read_at(path, file, table_at, (size - table_at).min(16 + 16 * count) as usize)?;
    // An entry takes at least a few bits; each chunk at least one point's bytes.
    if count == 0 || count > header.points || count > table_at - first {
        let most = header.points.min(table_at - first);
        return Err(bad(path, "number of chunks", table_at + 4, (count, format!("1 to {most}"))));
    }
    let variable = vlr.uses_variable_size_chunks();
    let entries = guarded(path, "chunk table", || ChunkTable::read(&mut Cursor::new(&table), variable))?;
    list(path, &entries, (&vlr, header.points), (first, table_at)).map(|list| Chunks { vlr, list })
}

/// The LAZ record, its items compared with the header.
pub(super) fn check_record(path: &Path, header: &Header, vlrs: &[Vlr]) -> Result<LazVlr> {
    let vlr = vlrs.iter().find(|v| v.is("laszip encoded", 22204));
    let vlr = vlr.ok_or_else(|| bad(path, "LAZ record", 100, ("none", "a VLR `laszip encoded` 22204")))?;
    check_items(path, header, vlr)
}

/// Places the chunks one after the other and compares their sums with header and file.
fn list(
    path: &Path,
    table: &ChunkTable,
    (vlr, points): (&LazVlr, u64),
    (first, end): (u64, u64),
) -> Result<Vec<Chunk>> {
    let mut list = Vec::with_capacity(table.len());
    let (mut at, mut left) = (first, points);
    for (i, entry) in table.into_iter().enumerate() {
        let points =
            if vlr.uses_variable_size_chunks() { entry.point_count } else { left.min(u64::from(vlr.chunk_size())) };
        let field = |name: &str| format!("{name} of chunk {i}");
        if entry.byte_count > end - at {
            return Err(bad(path, &field("size"), at, (entry.byte_count, format!("at most {}", end - at))));
        }
        // A compressed point takes at least a bit of its own; nothing real comes near 4096 points a byte.
        if points > left || points > entry.byte_count.saturating_mul(4096) {
            return Err(bad(
                path,
                &field("number of points"),
                at,
                (points, format!("at most {}", left.min(4096 * entry.byte_count))),
            ));
        }
        list.push(Chunk { at, bytes: entry.byte_count, points });
        at += entry.byte_count;
        left -= points;
    }
    match left {
        0 => Ok(list),
        _ => Err(bad(path, "number of points", 107, (points, format!("{} as the chunks hold", points - left)))),
    }
}

/// Where the chunk table stands; old writers put it at the end of the file.
fn table_offset(path: &Path, file: &mut File, points_at: u64, size: u64) -> Result<u64> {
    let valid = |at: u64| at >= points_at + 8 && at <= size - 8;
    for place in [points_at, size - 8] {
        let at = i64::from_le_bytes(super::header::array(&read_at(path, file, place, 8)?, 0));
        if u64::try_from(at).is_ok_and(valid) {
            return Ok(at as u64);
        }
        if at > 0 {
            return Err(bad(path, "offset to chunk table", place, (at, format!("{} to {}", points_at + 8, size - 8))));
        }
    }
    Err(bad(path, "offset to chunk table", points_at, ("none", "a table after the chunks; the file is incomplete")))
}

fn check_items(path: &Path, header: &Header, vlr: &Vlr) -> Result<LazVlr> {
    let wrong = |field: &str, found: String, allowed: &str| {
        bad(path, field, header.raw.len() as u64, (found, allowed.to_string()))
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
    if u32_at(&vlr.data, 12) == 0 {
        return Err(wrong("LAZ chunk size", "0".into(), "1 or more"));
    }
    let bytes = item_bytes(&vlr.data).map_err(|(found, allowed)| wrong("LAZ item", found, &allowed))?;
    if bytes != u64::from(header.record_length) {
        return Err(wrong(
            "LAZ items",
            format!("{bytes} bytes a point"),
            &format!("{} as the header says", header.record_length),
        ));
    }
    let parsed = LazVlr::from_buffer(&vlr.data).map_err(|e| unsupported(format!("LAZ record: {e}")))?;
    let base = match (header.format, parsed.items().first().map(LazItem::item_type)) {
        (0..=5, Some(LazItemType::Point10)) | (6..=10, Some(LazItemType::Point14)) => true,
        _ => RECORD_SIZES.len() < usize::from(header.format),
    };
    if !base {
        return Err(wrong(
            "LAZ items",
            format!("{:?}", parsed.items().first().map(LazItem::item_type)),
            "the point item of the point format first",
        ));
    }
    Ok(parsed)
}

/// Bytes of all items of a record that is long enough for them, or what is found and allowed of a wrong item.
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

pub(super) fn layered(vlr: &LazVlr) -> bool {
    vlr.items().first().is_some_and(|item| item.version() >= 3)
}

/// Decodes one chunk, some records at a time. `B` holds or borrows the chunk's bytes.
pub(super) struct Decoder<'a, B> {
    path: PathBuf,
    place: String,
    inner: Box<dyn RecordDecompressor<Cursor<B>> + Send + Sync + 'a>,
}

impl<'a, B: AsRef<[u8]> + Send + Sync + 'a> Decoder<'a, B> {
    /// A decoder of chunk `index`; fields outside the selection are left as they come (layered chunks only).
    pub(super) fn new(
        path: &Path,
        (vlr, selection): (&LazVlr, DecompressionSelection),
        (index, bytes): (usize, B),
    ) -> Result<Self> {
        if layered(vlr) {
            check_layers(path, vlr, index, bytes.as_ref())?;
        }
        let place = format!("chunk {index}");
        let inner = guarded(path, &place, || {
            let source = Cursor::new(bytes);
            let mut inner: Box<dyn RecordDecompressor<Cursor<B>> + Send + Sync + 'a> = match layered(vlr) {
                true => Box::new(LayeredPointRecordDecompressor::new(source)),
                false => Box::new(SequentialPointRecordDecompressor::new(source)),
            };
            inner.set_fields_from(vlr.items()).map_err(std::io::Error::other)?;
            inner.set_selection(selection);
            Ok(inner)
        })?;
        Ok(Self { path: path.to_path_buf(), place, inner })
    }

    /// Fills `out`, a whole number of records, with the next ones.
    pub(super) fn next(&mut self, out: &mut [u8]) -> Result<()> {
        guarded(&self.path, &self.place, || self.inner.decompress_many(out))
    }

    /// Bytes of the chunk that were read so far.
    pub(super) fn consumed(&self) -> u64 {
        self.inner.get().position()
    }
}

/// Number of layers of a layered chunk.
pub(super) fn layers(vlr: &LazVlr) -> usize {
    let of = |item: &LazItem| match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => usize::from(count),
        _ => 1,
    };
    vlr.items().iter().map(of).sum()
}

/// The layers of a chunk follow its first point and say how long they are: together they must fit.
fn check_layers(path: &Path, vlr: &LazVlr, index: usize, bytes: &[u8]) -> Result<()> {
    let layers = layers(vlr);
    let start = vlr.items_size() as usize + 4;
    let declared: u64 = (0..layers).map(|l| u64::from(u32_at(bytes, start + 4 * l))).sum();
    let room = (bytes.len() as u64).saturating_sub((start + 4 * layers) as u64);
    if bytes.len() < start + 4 * layers || declared > room {
        return Err(bad(
            path,
            &format!("layers of chunk {index}"),
            0,
            (format!("{declared} bytes"), format!("at most {room}")),
        ));
    }
    Ok(())
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
    // Seen where GPS times change their sign: differences of their bits overflow in the encoder.
    encoded.map_err(|_| Error::Unsupported {
        path: path.to_path_buf(),
        reason:
            "the LAZ encoder cannot hold these points (are there negative GPS times among positive ones?); write .las"
                .into(),
    })
}

/// The chunk table of chunks of these (points, bytes).
pub(super) fn encode_table(path: &Path, vlr: &LazVlr, sizes: &[(u64, u64)]) -> Result<Vec<u8>> {
    let mut table = ChunkTable::with_capacity(sizes.len());
    sizes.iter().for_each(|&(point_count, byte_count)| table.push(ChunkTableEntry { point_count, byte_count }));
    guarded(path, "chunk table", || {
        let mut bytes = Vec::new();
        table.write_to(&mut bytes, vlr).map(|()| bytes)
    })
}

/// Runs a piece of the decoder; its errors and panics become an error about `what`.
fn guarded<T>(path: &Path, what: &str, work: impl FnOnce() -> std::io::Result<T>) -> Result<T> {
    let failed = |found: String| Error::Malformed {
        path: path.to_path_buf(),
        format: "LAZ",
        field: "compressed points".into(),
        place: what.to_string(),
        found,
        allowed: "what a LAZ encoder writes".into(),
    };
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(e)) => Err(failed(e.to_string())),
        Err(_) => Err(failed("bytes that no encoder writes".into())),
    }
}
