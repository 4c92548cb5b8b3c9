//! Copies a LAS or LAZ file and changes only what was requested.
//!
//! The raw records are streamed from input to output. Header, VLRs, the bytes between VLRs and points, all fields and
//! extra bytes of the records, and everything after the points are copied unchanged.

pub(super) mod crop;
mod grid;
mod kept;
pub(super) mod merge;
mod promote;
pub(super) mod provenance;

pub(super) mod plan;
pub(super) mod tail;
#[cfg(test)]
mod tests;

use super::header::{lookup, put};
use super::records::outside::Outside;

use super::chunks::unpack::SLAB;
use super::header::vlr::laz_chunk_size;
use super::read::{check_codes, check_count, check_values};
use super::records::stream::Stream;
use super::records::{Records, par_records};
use super::write::writer::{CHUNK, Front, Writer};
use crate::cloud::Column;
use crate::error::{Error, Result};
use crate::io::{Edit, RewriteReport, Selection, WriteOptions, run};
use crate::parallel::Monitor;
use kept::Kept;
use plan::{RecordChanges, plan};
use rayon::prelude::*;
use std::path::Path;
use tail::Tail;

/// Chunks as large as the input's are written up to this many points; larger ones would need too much memory.
const LARGEST_CHUNK: u32 = 500_000;

/// Copies the selected points of `input` to `output` (LAS or LAZ by its extension) with the edits applied.
pub(in crate::io) fn select(
    input: &Path,
    output: &Path,
    selection: &Selection<'_>,
    options: &WriteOptions,
) -> Result<RewriteReport> {
    rewrite_records(Records::open(input)?, output, selection, options)
}

/// Fails if the dimensions could not be added, for reasons other than their values.
pub(in crate::io) fn check_dimensions(input: &Path, output: &Path, added: &[Column]) -> Result<()> {
    let records = Records::open(input)?;
    let edits: Vec<Edit> = added.iter().map(|column| Edit::Dimension(column.clone())).collect();
    plan(&records, &mut front(&records, None, output), &edits, None).map(|_| ())
}

/// Writes selected ones of open records with the edits applied.
pub(in crate::io) fn rewrite_records(
    records: Records,
    output: &Path,
    selection: &Selection<'_>,
    options: &WriteOptions,
) -> Result<RewriteReport> {
    let edits = selection.edits;
    let codes = edits.iter().find_map(|e| if let Edit::Classification(codes) = e { Some(&codes[..]) } else { None });
    if let Some(codes) = codes {
        check_codes(codes, records.header.points)?;
    }
    let largest = codes.and_then(|c| c.iter().max().copied()).unwrap_or(0);
    let from = records.header.format;
    let (mut format, mut notes) = (from, Vec::new());
    if from < 6 && largest > 31 {
        format = promote::target(from);
        notes.push(format!("class codes up to {largest} need LAS 1.4: point format {from} became {format}"));
    }
    if edits.iter().any(|edit| matches!(edit, Edit::Colour(_))) && promote::coloured(format) != format {
        notes.push(format!("colours: point format {format} became {}", promote::coloured(format)));
        format = promote::coloured(format);
    }
    let to = (format != from).then_some(format);
    let mut report = rewrite_as(records, output, Changes { selection: *selection, format: to }, options)?;
    notes.append(&mut report.notes);
    Ok(RewriteReport { notes, ..report })
}

/// Copies `input` to `output` (LAS or LAZ by its extension), in another point format if requested.
pub(in crate::io) fn convert(
    input: &Path,
    output: &Path,
    point_format: Option<u8>,
    options: &WriteOptions,
) -> Result<RewriteReport> {
    let records = Records::open(input)?;
    let from = records.header.format;
    let to = point_format.filter(|&to| to != from);
    if let Some(to) = to {
        let missing = promote::missing(from, to);
        if !missing.is_empty() {
            let reason = format!("point format {to} cannot hold what format {from} has: {}", missing.join(", "));
            return Err(Error::Unsupported { path: input.to_path_buf(), reason });
        }
    }
    let mut report = rewrite_as(records, output, Changes { selection: Selection::default(), format: to }, options)?;
    report.notes.extend(to.map(|to| format!("point format {from} became {to}; fields that are new are 0")));
    Ok(report)
}

/// What is changed in a copy.
pub(in crate::io) struct Changes<'a> {
    pub(in crate::io) selection: Selection<'a>,
    /// Another point format.
    pub(in crate::io) format: Option<u8>,
}

/// Writes open records with the changes applied.
pub(in crate::io) fn rewrite_as(
    mut records: Records,
    output: &Path,
    changes: Changes<'_>,
    options: &WriteOptions,
) -> Result<RewriteReport> {
    let Changes { selection: Selection { kept, edits }, format: to } = changes;
    changes.selection.check(records.header.points)?;
    let mut report = RewriteReport { points: records.header.points, notes: Vec::new() };
    let mut front = front(&records, to, output);
    let tail = Tail::of(&mut records, &mut front)?;
    if tail.lost_copc {
        report.notes.push("the octree of the COPC input is not kept; the output is plain LAZ".into());
    }
    for edit in edits {
        match edit {
            Edit::Dimension(column) => check_values(&column.name, &column.values, report.points)?,
            Edit::Colour(colours) => check_count("colours", colours.len(), report.points)?,
            Edit::Classification(_) | Edit::ClassNames(_) | Edit::OtherClassNames(_) | Edit::Provenance(_) => {}
        }
    }
    let plan = plan(&records, &mut front, edits, to)?;
    for edit in edits {
        match edit {
            Edit::ClassNames(names) => lookup::add(&mut front.vlrs, names),
            Edit::OtherClassNames(names) => {
                lookup::remove(&mut front.vlrs, names);
                lookup::add(&mut front.vlrs, names);
            }
            Edit::Provenance(text) => provenance::put(&mut front.vlrs, text)?,
            _ => {}
        }
    }
    let old = records.header.clone();
    let mut kept = kept.map(|marks| Kept::new(marks, &old, to));
    let mut writer = Writer::create(output, front)?;
    let mut stream = Stream::of(records);
    copy(&mut stream, &mut Way { plan: &plan, kept: kept.as_mut(), writer: &mut writer }, &options.monitor)?;
    run::unchanged(&stream.records.path)?;
    let (records, monitor) = (&mut stream.records, &options.monitor);
    report.points = kept.as_ref().map_or(report.points, Kept::points);
    writer.finish(
        monitor,
        |file| tail.copy(records, file, monitor),
        |header, end| {
            kept.iter().for_each(|kept| kept.put(header));
            tail.patch(&old, header, end);
        },
    )?;
    Ok(report)
}

/// The way of the records from the input to the output.
struct Way<'a, 'b> {
    plan: &'a RecordChanges<'b>,
    kept: Option<&'a mut Kept<'b>>,
    writer: &'a mut Writer,
}

/// Changes and writes all records, slab by slab.
fn copy(stream: &mut Stream, to: &mut Way<'_, '_>, monitor: &Monitor) -> Result<()> {
    let (header, plan) = (stream.records.header.clone(), to.plan);
    monitor.stage("write", header.points);
    let mut outside = Outside::new(&header);
    let mut first = 0;
    loop {
        let mut bytes = stream.next(SLAB, monitor)?;
        let count = bytes.len() / plan.old_length;
        if count == 0 {
            break;
        }
        outside.add(&bytes, plan.old_length);
        match plan.keeps_length() {
            true => par_records(&mut bytes, first, plan.old_length).for_each(|(i, record)| plan.apply(record, i)),
            false => bytes = plan.widen(&bytes, first),
        }
        if let Some(kept) = &mut to.kept {
            bytes = kept.of(&bytes, first, plan.new_length);
        }
        to.writer.push(&bytes, monitor)?;
        first += count;
        monitor.advance(count as u64);
    }
    outside.report(&stream.records.path, &header, monitor);
    Ok(())
}

/// Everything before the points, from the input.
pub(super) fn front(records: &Records, to: Option<u8>, output: &Path) -> Front {
    let wkt = records.vlrs.iter().any(|v| v.is("LASF_Projection", 2112));
    let header = match to {
        Some(to) => promote::header(&records.header, to, wkt),
        None => records.header.raw.clone(),
    };
    let laz = output.extension().and_then(|e| e.to_str()).is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    let own = records.vlrs.iter().find(|v| v.is("laszip encoded", 22204)).map(laz_chunk_size);
    let chunk = own.filter(|&c| c > 0 && c <= LARGEST_CHUNK).unwrap_or(CHUNK);
    let mut vlrs = records.vlrs.clone();
    // The COPC info record refers to chunks that the output does not have.
    vlrs.retain(|v| v.user() != "copc");
    let mut front = Front { header, vlrs, gap: records.gap.clone(), chunk: laz.then_some(chunk) };
    put(&mut front.header, 100, &(front.vlrs.len() as u32).to_le_bytes());
    front
}
