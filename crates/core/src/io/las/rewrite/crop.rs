//! Writes a part of a LAS, LAZ or COPC file: a box, or the levels of a resolution.

use super::front;
use super::tail::Tail;
use crate::error::Result;
use crate::io::las::chunks::unpack::slab;
use crate::io::las::read::open;
use crate::io::las::read::sink::within;
use crate::io::las::records::outside::Outside;
use crate::io::las::records::stream::Stream;
use crate::io::las::records::tally::Tally;
use crate::io::las::write::writer::Writer;
use crate::io::{ReadOptions, RewriteReport, WriteOptions, run};
use std::path::Path;

/// Copies the records inside the box, byte for byte. Header, variable length records and everything after the points
/// are kept; counts and bounds in the header become those of the remaining points.
pub(in crate::io) fn crop(
    input: &Path,
    output: &Path,
    part: &ReadOptions,
    options: &WriteOptions,
) -> Result<RewriteReport> {
    let mut records = open(input, part)?;
    let (old, all) = (records.header.clone(), records.header.points);
    let mut front = front(&records, None, output);
    let tail = Tail::of(&mut records, &mut front)?;
    let mut notes = Vec::new();
    if tail.lost_copc {
        notes.push("the octree of the COPC input is not kept; the output is plain LAZ".into());
    }
    let mut writer = Writer::create(output, front)?;
    let monitor = &options.monitor;
    monitor.stage("write", all);
    let mut stream = Stream::of(records);
    let length = stream.record_length();
    let (mut tally, mut outside) = (Tally::new(old.format), Outside::new(&old));
    loop {
        let mut bytes = stream.next(slab(stream.record_length()), monitor)?;
        if bytes.is_empty() {
            break;
        }
        monitor.advance((bytes.len() / length) as u64);
        outside.add(&bytes, length);
        if let Some(bounds) = part.bounds {
            bytes = within(&bytes, &old, bounds);
        }
        tally.add(&bytes, length);
        writer.push(&bytes, monitor)?;
    }
    run::unchanged(&stream.records.path)?;
    let records = &mut stream.records;
    outside.report(&records.path, &old, monitor);
    writer.finish(
        monitor,
        |file| tail.copy(records, file, monitor),
        |header, end| {
            tally.put(&old, header);
            tail.patch(&old, header, end);
        },
    )?;
    Ok(RewriteReport { points: tally.points(), notes })
}
