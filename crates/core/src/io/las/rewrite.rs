//! Passing a LAS or LAZ file through: only what is asked changes.
//!
//! The raw records stream from input to output. Header, VLRs, the bytes between VLRs and points, every field and every extra
//! byte of the records, and everything behind the points are copied as they stand.

use super::extra::{self, Extra};
use super::fields::Field;
use super::header::{RECORD_SIZES, put, u64_at};
use super::promote;
use super::read::{check_codes, check_values};
use super::records::{Records, par_records};
use super::vlr::{Vlr, laz_chunk_size, read_at};
use super::writer::{CHUNK, Front, Writer};
use crate::cloud::{Column, Values};
use crate::error::{Error, Result};
use crate::io::{Edit, RewriteReport, WriteOptions};
use rayon::prelude::*;
use std::path::Path;

/// Where a dimension's values go in the record that is written.
struct Slot<'a> {
    at: usize,
    values: &'a Values,
}

/// All that changes.
struct Plan<'a> {
    codes: Option<&'a [u8]>,
    slots: Vec<Slot<'a>>,
    /// The record gets the layout of LAS 1.4 first.
    promote: bool,
    format: u8,
    old_length: usize,
    new_length: usize,
}

/// Copies `input` to `output` (LAS or LAZ by its extension) with the edits applied.
pub(in crate::io) fn rewrite(
    input: &Path,
    output: &Path,
    edits: &[Edit],
    options: &WriteOptions,
) -> Result<RewriteReport> {
    let mut records = Records::open(input)?;
    let points = records.len()? as u64;
    let mut report = RewriteReport { points, notes: Vec::new() };
    let codes = edits.iter().find_map(|e| if let Edit::Classification(codes) = e { Some(&codes[..]) } else { None });
    if let Some(codes) = codes {
        check_codes(codes, points)?;
    }
    let largest = codes.and_then(|c| c.iter().max().copied()).unwrap_or(0);
    let promote = records.header.format < 6 && largest > 31;
    let mut front = front(&records, promote, output);
    if promote {
        let to = promote::target(records.header.format);
        report.notes.push(format!(
            "class codes up to {largest} need LAS 1.4: point format {} became {to}",
            records.header.format
        ));
    }
    if drop_copc(&mut records, &mut front) {
        report.notes.push("the octree of the COPC input is not kept; the output is plain LAZ".into());
    }
    let plan = plan(&records, &mut front, edits, codes, promote)?;
    let tail = tail(&mut records)?;
    let old = records.header.clone();
    let mut writer = Writer::create(output, front)?;
    options.monitor.stage("write", points);
    let monitor = options.monitor.clone();
    records.for_each(&monitor, |slab| {
        let first = slab.points.start;
        monitor.advance(slab.points.len() as u64);
        if plan.old_length != plan.new_length {
            return writer.push(&plan.widen(slab.bytes, first), &monitor);
        }
        par_records(slab.bytes, first, plan.old_length).for_each(|(i, record)| plan.apply(record, i));
        writer.push(slab.bytes, &monitor)
    })?;
    writer.finish(&tail.bytes, &options.monitor, |header, end| {
        if tail.evlrs > 0 {
            put(header, 235, &(end + (old.evlrs_at - tail.start)).to_le_bytes());
        } else if header.len() >= 375 {
            put(header, 235, &[0; 12]);
        }
        let wave = if header.len() >= 235 { u64_at(header, 227) } else { 0 };
        if wave >= tail.start && !tail.bytes.is_empty() && wave > 0 {
            put(header, 227, &(end + (wave - tail.start)).to_le_bytes());
        }
    })?;
    Ok(report)
}

/// Everything before the points, as the input has it.
fn front(records: &Records, promote: bool, output: &Path) -> Front {
    let wkt = records.vlrs.iter().any(|v| v.is("LASF_Projection", 2112));
    let header = if promote { promote::header(&records.header, wkt) } else { records.header.raw.clone() };
    let laz = output.extension().and_then(|e| e.to_str()).is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    let own = records.vlrs.iter().find(|v| v.is("laszip encoded", 22204)).map(laz_chunk_size);
    let chunk = own.filter(|&c| c > 0 && c < 10_000_000).unwrap_or(CHUNK);
    Front { header, vlrs: records.vlrs.clone(), gap: records.gap.clone(), chunk: laz.then_some(chunk) }
}

/// COPC's info record and hierarchy speak of chunks that the output does not have.
fn drop_copc(records: &mut Records, front: &mut Front) -> bool {
    let before = front.vlrs.len();
    front.vlrs.retain(|v| v.user() != "copc");
    let hierarchy = records.evlrs.iter().any(|v| v.user() == "copc");
    records.evlrs.retain(|v| v.user() != "copc");
    if hierarchy {
        put(&mut front.header, 243, &(records.evlrs.len() as u32).to_le_bytes());
    }
    before != front.vlrs.len() || hierarchy
}

struct Tail {
    bytes: Vec<u8>,
    /// Where these bytes stood in the input.
    start: u64,
    evlrs: usize,
}

/// What stands behind the points: EVLRs and waveforms.
fn tail(records: &mut Records) -> Result<Tail> {
    let header = &records.header;
    let evlrs = records.evlrs.len();
    if evlrs as u32 != header.evlrs {
        // Some were dropped: the others are written anew.
        let bytes = records.evlrs.iter().flat_map(|v| v.head.iter().chain(&v.data)).copied().collect();
        return Ok(Tail { bytes, start: header.evlrs_at, evlrs });
    }
    let start = match &records.chunks {
        None => header.points_at + header.points * u64::from(header.record_length),
        Some(_) if evlrs > 0 => header.evlrs_at,
        Some(_) if header.minor >= 3 && u64_at(&header.raw, 227) > header.points_at => u64_at(&header.raw, 227),
        Some(_) => records.size,
    };
    let length = records.size.saturating_sub(start);
    let (path, evlrs) = (records.path.clone(), if header.evlrs_at >= start { evlrs } else { 0 });
    let bytes = read_at(&path, &mut records.file, start.min(records.size), length as usize)?;
    Ok(Tail { bytes, start, evlrs })
}

/// Decides where each edit goes and extends record length and descriptors.
fn plan<'a>(
    records: &Records,
    front: &mut Front,
    edits: &'a [Edit],
    codes: Option<&'a [u8]>,
    promote: bool,
) -> Result<Plan<'a>> {
    let header = &records.header;
    let format = if promote { promote::target(header.format) } else { header.format };
    let base = usize::from(RECORD_SIZES[usize::from(format)]);
    let moved = base as isize - isize::try_from(usize::from(RECORD_SIZES[usize::from(header.format)])).unwrap_or(0);
    let (known, undescribed) = extra::described(header, &records.vlrs);
    let mut length = base + header.extra();
    let (mut slots, mut added) = (Vec::new(), Vec::new());
    for edit in edits {
        let Edit::Dimension(column) = edit else { continue };
        check_values(&column.name, &column.values, header.points)?;
        if Field::named(&column.name, format).is_some() {
            return Err(Error::parameter(
                "dimension",
                &column.name,
                "a name that the point format does not use itself",
            ));
        }
        match known.iter().find(|e| e.name == column.name) {
            Some(old) => {
                slots.push(Slot { at: same_type(old, column)?.saturating_add_signed(moved), values: &column.values })
            }
            None => {
                slots.push(Slot { at: length, values: &column.values });
                added.extend(extra::descriptor(column)?);
                length += extra::size_of(extra::kind_of(&column.values));
            }
        }
    }
    if !added.is_empty() {
        describe(&mut front.vlrs, undescribed, &added)?;
    }
    let new_length = u16::try_from(length)
        .map_err(|_| Error::input(format!("records of {length} bytes; at most 65535 are possible")))?;
    put(&mut front.header, 105, &new_length.to_le_bytes());
    Ok(Plan {
        codes,
        slots,
        promote,
        format: header.format,
        old_length: usize::from(header.record_length),
        new_length: length,
    })
}

fn same_type(old: &Extra, column: &Column) -> Result<usize> {
    match old.kind == extra::kind_of(&column.values) && old.scaled.is_none() {
        true => Ok(old.at),
        false => Err(Error::parameter(
            "dimension",
            &column.name,
            "another name: the file has a dimension of this name and another type",
        )),
    }
}

/// Adds descriptors to the one Extra Bytes record, making it if there is none.
fn describe(vlrs: &mut Vec<Vlr>, undescribed: usize, added: &[u8]) -> Result<()> {
    let mut data = extra::undescribed(undescribed);
    data.extend_from_slice(added);
    match vlrs.iter_mut().find(|v| extra::is_record(v)) {
        Some(vlr) => {
            let whole = vlr.data.len() / 192 * 192;
            vlr.set_data([&vlr.data[..whole], &data].concat());
        }
        None => vlrs.push(Vlr::new("LASF_Spec", 4, "Extra Bytes Record", data)),
    }
    match vlrs.iter().find(|v| extra::is_record(v)).is_some_and(|v| v.data.len() > 65_535) {
        true => Err(Error::input("more than 341 extra dimensions do not fit into one Extra Bytes record")),
        false => Ok(()),
    }
}

impl Plan<'_> {
    /// Changes a record in place.
    fn apply(&self, record: &mut [u8], i: usize) {
        if let Some(codes) = self.codes {
            let format = if self.promote { promote::target(self.format) } else { self.format };
            Field::Classification.store(format, record, f64::from(codes[i]));
        }
        for slot in &self.slots {
            extra::store(slot.values, i, &mut record[slot.at..]);
        }
    }

    /// Longer records with the old ones in them, changed.
    fn widen(&self, old: &[u8], first: usize) -> Vec<u8> {
        let mut new = vec![0; old.len() / self.old_length * self.new_length];
        let pairs = new.par_chunks_exact_mut(self.new_length).zip(old.par_chunks_exact(self.old_length));
        pairs.with_min_len(8192).enumerate().for_each(|(i, (to, from))| {
            match self.promote {
                true => promote::record(self.format, from, to),
                false => to[..from.len()].copy_from_slice(from),
            }
            self.apply(to, first + i);
        });
        new
    }
}
