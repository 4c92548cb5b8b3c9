//! Reading a LAS, LAZ or COPC file into clouds.

pub(super) mod point_reader;
pub(super) mod sink;

use super::chunks::unpack::slab;
use super::copc;
use super::records::outside::Outside;
use super::records::stream::Stream;
use super::records::{Records, Slab};
use crate::cloud::{Cloud, Values};
use crate::error::{Error, Result};
use crate::io::ReadOptions;
use crate::io::reader::BlockReader;
use crate::parallel::Monitor;
use sink::Sink;
use std::path::Path;

/// Opens a file and selects the needed parts of a COPC octree.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Records> {
    let mut records = Records::open(path)?;
    if (options.bounds.is_some() || options.resolution.is_some()) && copc::is(&records) {
        copc::narrow(&mut records, options)?;
    } else if let Some(resolution) = options.resolution {
        return Err(Error::parameter("resolution", resolution, "none: the file has no levels (it is not COPC)"));
    }
    Ok(records)
}

/// Reads coordinates and the selected columns.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    read_records(open(path, options)?, options)
}

/// Reads coordinates and the selected columns of an open file.
pub(in crate::io) fn read_records(mut records: Records, options: &ReadOptions) -> Result<Cloud> {
    let n = records.len()?;
    let mut sink = Sink::new(&mut records, options);
    if options.bounds.is_none() {
        sink.reserve(n)?;
    }
    options.monitor.stage("read", n as u64);
    let monitor = options.monitor.clone();
    let mut outside = Outside::new(&records.header);
    let length = usize::from(records.header.record_length);
    records.for_each(&monitor, |Slab { points, bytes }| {
        monitor.advance(points.len() as u64);
        outside.add(bytes, length);
        sink.push(bytes);
        Ok(())
    })?;
    outside.report(&records.path, &records.header, &monitor);
    sink.take(usize::MAX)
}

/// Reads a file block by block.
#[derive(Debug)]
pub(in crate::io) struct Reader {
    stream: Stream,
    sink: Sink,
    outside: Outside,
    monitor: Monitor,
}

impl Reader {
    pub(in crate::io) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let mut records = open(path, options)?;
        let sink = Sink::new(&mut records, options);
        options.monitor.stage("read", records.header.points);
        let outside = Outside::new(&records.header);
        Ok(Self { stream: Stream::of(records), sink, outside, monitor: options.monitor.clone() })
    }
}

impl BlockReader for Reader {
    fn take(&mut self, points: usize) -> Result<Cloud> {
        while self.sink.len() < points {
            let bytes =
                self.stream.next((points - self.sink.len()).min(slab(self.stream.record_length())), &self.monitor)?;
            if bytes.is_empty() {
                let records = &self.stream.records;
                self.outside.report(&records.path, &records.header, &self.monitor);
                break;
            }
            self.monitor.advance((bytes.len() / self.stream.record_length()) as u64);
            self.outside.add(&bytes, self.stream.record_length());
            self.sink.push(&bytes);
        }
        self.sink.take(points)
    }
}

/// Fails if there is not one code a point.
pub(super) fn check_codes(codes: &[u8], points: u64) -> Result<()> {
    check_count("class codes", codes.len(), points)
}

/// Fails if there is not one value a point.
pub(super) fn check_count(what: &str, values: usize, points: u64) -> Result<()> {
    match values as u64 == points {
        true => Ok(()),
        false => Err(Error::input(format!("{values} {what} for {points} points"))),
    }
}

/// Fails if a column does not have one value a point.
pub(super) fn check_values(name: &str, values: &Values, points: u64) -> Result<()> {
    match values.len() as u64 == points {
        true => Ok(()),
        false => Err(Error::input(format!("dimension {name} has {} values for {points} points", values.len()))),
    }
}
