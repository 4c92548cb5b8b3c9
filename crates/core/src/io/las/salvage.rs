//! Opens a damaged LAS or LAZ file: reads what is intact and counts what is missing.

use super::chunks::decoder::{ChunkBytes, Decoder, How, layered, layers};
use super::chunks::unpack::slab;
use super::chunks::{self, Chunk, Chunks, LasHead};
use super::header::vlr::{MOST_EVLR, Vlr, read_at};
use super::header::{Header, RECORD_SIZES, bad, least_size, put, u16_at, u32_at, u64_at};
use super::records::Records;
use super::records::outside::Outside;
use super::records::stream::Stream;
use super::records::tally::Tally;
use crate::error::{Error, Mismatch, Result};
use crate::io::info::Losses;
use crate::io::open;
use crate::parallel::{Monitor, map_ordered};
use laz::{DecompressionSelection, LazVlr};
use std::fs::File;
use std::io::Read;
use std::path::Path;

impl Records {
    /// Opens a file as far as it can be read. The returned header describes what is intact.
    ///
    /// # Errors
    /// If there is no header, or it is unusable: then nothing can be recovered.
    pub(in crate::io) fn salvage(path: &Path, monitor: &Monitor) -> Result<(Self, Losses)> {
        let mut file = open::file(path)?;
        let size = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut losses = Losses::default();
        let mut header = header(path, &mut file, size, &mut losses)?;
        losses.declared = header.points;
        let (vlrs, gap) = vlrs(path, &mut file, &mut header, &mut losses)?;
        let evlrs = evlrs(path, &mut file, &mut header, size)?;
        if let Some(note) = evlrs.note {
            losses.notes.push(note);
        }
        let (evlrs, end) = (evlrs.list, evlrs.points_end);
        let chunks = match header.compressed {
            true => {
                let damaged = Damaged { path, file: &mut file, head: LasHead { header: &header, vlrs: &vlrs }, end };
                Some(damaged.chunks(&mut losses, monitor)?)
            }
            false => None,
        };
        header.points = match &chunks {
            Some(chunks) => chunks.list.iter().map(|c| c.points).sum(),
            None => plain_points(&header, end, &mut losses),
        };
        let selection = DecompressionSelection::all();
        let records = Self { path: path.to_path_buf(), file, size, header, vlrs, gap, evlrs, chunks, selection };
        losses.read = records.header.points;
        Ok((recount(records, &mut losses, monitor)?, losses))
    }
}

/// The header, with sizes limited to those of the file.
fn header(path: &Path, file: &mut File, size: u64, losses: &mut Losses) -> Result<Header> {
    let mut raw = Vec::new();
    file.take(375).read_to_end(&mut raw).map_err(|e| Error::io(path, e))?;
    if raw.len() < 227 || &raw[..4] != b"LASF" {
        return Err(bad(
            path,
            "header",
            0,
            Mismatch::new(format!("{} bytes", raw.len()), "at least the 227 bytes of a LAS header"),
        ));
    }
    let least = least_size([raw[24], raw[25]])
        .ok_or_else(|| bad(path, "version", 24, Mismatch::new(format!("{}.{}", raw[24], raw[25]), "1.0 to 1.5")))?;
    let mut length = usize::from(u16_at(&raw, 94));
    if length < least || length as u64 > size {
        losses.notes.push(format!("header size {length} taken as {least}"));
        length = least;
        put(&mut raw, 94, &(least as u16).to_le_bytes());
    }
    if raw.len() < length {
        raw.extend(read_at(
            path,
            file,
            raw.len() as u64,
            (length - raw.len()).min((size as usize).saturating_sub(raw.len())),
        )?);
    }
    raw.resize(length, 0);
    let mut header = Header::parse(raw);
    let Some(&least) = RECORD_SIZES.get(usize::from(header.format)) else {
        return Err(bad(path, "point format", 104, Mismatch::new(header.format, "0 to 10")));
    };
    if header.record_length < least {
        return Err(bad(path, "record length", 105, Mismatch::new(header.record_length, format!("{least} or more"))));
    }
    let usable = |v: &[f64; 3]| v.iter().all(|v| v.is_finite());
    if !usable(&header.scale) || header.scale.iter().any(|s| *s <= 0.0) || !usable(&header.offset) {
        let found = format!("{:?} {:?}", header.scale, header.offset);
        return Err(bad(
            path,
            "scale and offset",
            131,
            Mismatch::new(found, "numbers, the scale above 0; they cannot be guessed"),
        ));
    }
    if header.points_at < header.raw.len() as u64 || header.points_at > size {
        losses.notes.push(format!("points are said to begin at byte {}, which is not in the file", header.points_at));
        header.points_at = size;
    }
    Ok(header)
}

/// The records before the points, up to the first that does not fit.
fn vlrs(path: &Path, file: &mut File, header: &mut Header, losses: &mut Losses) -> Result<(Vec<Vlr>, Vec<u8>)> {
    let start = header.raw.len();
    let bytes = read_at(path, file, start as u64, (header.points_at as usize).saturating_sub(start))?;
    let (mut vlrs, mut at) = (Vec::new(), 0);
    while (vlrs.len() as u64) < u64::from(header.vlrs) {
        let Some(head) = bytes.get(at..at + 54) else { break };
        let Some(data) = bytes.get(at + 54..at + 54 + usize::from(u16_at(head, 20))) else { break };
        at += 54 + data.len();
        vlrs.push(Vlr { head: head.to_vec(), data: data.to_vec() });
    }
    if vlrs.len() as u64 != u64::from(header.vlrs) {
        losses.notes.push(format!("{} of {} VLRs are there", vlrs.len(), header.vlrs));
        header.vlrs = vlrs.len() as u32;
    }
    Ok((vlrs, bytes[at..].to_vec()))
}

/// The intact records after the points.
struct Evlrs {
    list: Vec<Vlr>,
    /// Offset before which the points end.
    points_end: u64,
    /// What is missing.
    note: Option<String>,
}

/// The records after the points, up to the first that does not fit.
fn evlrs(path: &Path, file: &mut File, header: &mut Header, size: u64) -> Result<Evlrs> {
    let mut note = None;
    let (mut list, mut at) = (Vec::new(), header.evlrs_at);
    let there = header.evlrs > 0 && at >= header.points_at && at <= size;
    while there && (list.len() as u64) < u64::from(header.evlrs) && size - at >= 60 {
        let head = read_at(path, file, at, 60)?;
        let length = u64_at(&head, 20);
        if length > size - at - 60 {
            break;
        }
        let data = if length <= MOST_EVLR { read_at(path, file, at + 60, length as usize)? } else { Vec::new() };
        list.push(Vlr { head, data });
        at += 60 + length;
    }
    let end = if there && !list.is_empty() { header.evlrs_at } else { size };
    if list.len() as u64 != u64::from(header.evlrs) {
        note = Some(format!("{} of {} EVLRs are there", list.len(), header.evlrs));
        header.evlrs = list.len() as u32;
        header.evlrs_at = if list.is_empty() { 0 } else { header.evlrs_at };
        put(&mut header.raw, 235, &header.evlrs_at.to_le_bytes());
        put(&mut header.raw, 243, &header.evlrs.to_le_bytes());
    }
    Ok(Evlrs { list, points_end: end, note })
}

/// Number of points of an uncompressed file that are declared and exist. Killed writers leave a count of 0.
fn plain_points(header: &Header, end: u64, losses: &mut Losses) -> u64 {
    let there = end.saturating_sub(header.points_at) / u64::from(header.record_length);
    if header.points == 0 && there > 0 {
        losses.notes.push(format!("the header says 0 points, {there} records stand in the file"));
        return there;
    }
    if header.points > there {
        losses.notes.push(format!("the file ends after {there} of {} points", header.points));
    }
    header.points.min(there)
}

/// A compressed file that may be damaged.
struct Damaged<'a> {
    path: &'a Path,
    file: &'a mut File,
    head: LasHead<'a>,
    /// Offset before which the points end.
    end: u64,
}

impl Damaged<'_> {
    /// The chunks that can be decoded: from the table or, if it is missing or wrong, by decoding one after the other.
    fn chunks(self, losses: &mut Losses, monitor: &Monitor) -> Result<Chunks> {
        let Self { path, file, head, end } = self;
        let header = head.header;
        let vlr = chunks::check_record(path, head)?;
        let mut chunks = match chunks::read_table(path, file, head, end) {
            Ok(chunks) => chunks,
            Err(e) => {
                losses.notes.push(format!("the chunk table is not usable ({e}); chunks are read one after the other"));
                let list = Walk { path, file, header, vlr: &vlr, end }.chunks(monitor)?;
                Chunks { vlr, whole: false, list }
            }
        };
        let how = How { vlr: &chunks.vlr, selection: DecompressionSelection::all(), whole: chunks.whole };
        let length = usize::from(header.record_length);
        let mut good = Vec::with_capacity(chunks.list.len());
        for (group, list) in chunks.list.chunks(rayon::current_num_threads().max(1)).enumerate() {
            let first = group * rayon::current_num_threads().max(1);
            let packed =
                list.iter().map(|c| read_at(path, file, c.at, c.bytes as usize)).collect::<Result<Vec<_>>>()?;
            let found = map_ordered(list.len(), monitor, |i| {
                match Decoder::new(path, how, ChunkBytes { index: first + i, bytes: &packed[i] }) {
                    Ok(decoder) => readable(decoder, list[i].points, length, monitor),
                    Err(_) => Ok((0, false)),
                }
            })?;
            for (i, (chunk, (points, sound))) in list.iter().zip(found).enumerate() {
                if points == chunk.points && !sound {
                    losses
                        .notes
                        .push(format!("chunk {}: damaged somewhere, some of its points may be wrong", first + i));
                }
                if points < chunk.points {
                    losses.notes.push(format!("chunk {}: {points} of {} points can be read", first + i, chunk.points));
                }
                good.push(Chunk { points, ..*chunk });
            }
        }
        good.retain(|c| c.points > 0);
        (chunks.list, chunks.whole) = (good, false);
        Ok(chunks)
    }
}

/// A file whose chunks are searched.
struct Walk<'a> {
    path: &'a Path,
    file: &'a mut File,
    header: &'a Header,
    vlr: &'a LazVlr,
    /// Offset before which all chunks lie.
    end: u64,
}

impl Walk<'_> {
    /// The chunks from the first on, up to the end or to bytes that are not a chunk. The last one may be incomplete.
    ///
    /// A layered chunk (LAZ 3) stores its size and number of points; the size of an older one is known after decoding
    /// it.
    fn chunks(&mut self, monitor: &Monitor) -> Result<Vec<Chunk>> {
        let (mut at, mut left) = (self.header.points_at + 8, self.header.points);
        let mut list = Vec::new();
        let usual = if self.vlr.uses_variable_size_chunks() { left } else { u64::from(self.vlr.chunk_size()) };
        while at < self.end && left > 0 {
            monitor.check()?;
            let found = match layered(self.vlr) {
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
        let head = vlr.items_size() + 4 + 4 * layers(vlr) as u64;
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
    let (start, layers) = (vlr.items_size() as usize, layers(vlr));
    let head = bytes.get(start..start + 4 + 4 * layers)?;
    let sum: u64 = (0..layers).map(|l| u64::from(u32_at(head, 4 + 4 * l))).sum();
    Some(((start + head.len()) as u64 + sum, u64::from(u32_at(head, 0))))
}

/// Number of points of a chunk that can be decoded, and whether the chunk ends after them; `length` is that of a record.
fn readable<'a, B: AsRef<[u8]> + Send + Sync + 'a>(
    mut decoder: Decoder<'a, B>,
    points: u64,
    length: usize,
    monitor: &Monitor,
) -> Result<(u64, bool)> {
    let mut done = 0;
    let mut buffer = vec![0; points.min(slab(length) as u64) as usize * length];
    while done < points {
        monitor.check()?;
        let now = (points - done).min(slab(length) as u64) as usize;
        let good = decoder.readable(&mut buffer[..now * length], length);
        done += good as u64;
        if good < now {
            break;
        }
    }
    Ok((done, decoder.end().is_ok()))
}

/// Updates counts, returns and bounds in the header to the recovered points. Points outside the former bounds are noted:
/// they were decoded, but may be wrong.
fn recount(records: Records, losses: &mut Losses, monitor: &Monitor) -> Result<Records> {
    let mut stream = Stream::of(records);
    let (format, length) = (stream.records.header.format, stream.record_length());
    let (mut tally, mut outside) = (Tally::new(format), Outside::new(&stream.records.header));
    loop {
        let block = stream.next(slab(length), monitor)?;
        if block.is_empty() {
            break;
        }
        tally.add(&block, length);
        outside.add(&block, length);
    }
    let mut records = stream.records;
    let header = &mut records.header;
    losses.notes.extend(outside.sentence(header));
    let mut raw = std::mem::take(&mut header.raw);
    tally.put(header, &mut raw);
    (header.raw, [header.low, header.high]) = (raw, tally.bounds(header));
    Ok(records)
}
