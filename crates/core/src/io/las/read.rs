//! Reading a LAS or LAZ file into a cloud.

use super::extra::{self, Extra, grow};
use super::fields::{self, Field};
use super::header::array;
use super::records::{Records, Slab};
use super::vlr::crs;
use crate::cloud::{Cloud, Column, Coordinates, Values};
use crate::error::{Error, Result};
use crate::io::ReadOptions;
use laz::DecompressionSelection;
use rayon::prelude::*;
use std::path::Path;

/// Where a column comes from.
enum Source {
    Field(Field),
    Extra(Extra),
}

/// Reads coordinates and the wanted columns.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    read_records(Records::open(path)?, options)
}

/// Reads coordinates and the wanted columns of a file that is open.
pub(in crate::io) fn read_records(mut records: Records, options: &ReadOptions) -> Result<Cloud> {
    let (n, format) = (records.len()?, records.header.format);
    let (extras, _) = extra::described(&records.header, &records.vlrs);
    let fields =
        fields::of_format(format).map(|(field, name)| (Source::Field(field), name.to_string(), field.values(0)));
    let extras = extras
        .into_iter()
        .map(|e| (e.name.clone(), e.values(0), e))
        .map(|(name, values, e)| (Source::Extra(e), name, values));
    let mut columns: Vec<(Source, Column)> = fields
        .chain(extras)
        .filter(|(_, name, _)| options.wants(name))
        .map(|(source, name, values)| (source, Column::new(name, values)))
        .collect();
    let mut ticks = [Vec::new(), Vec::new(), Vec::new()];
    reserve(&mut ticks, &mut columns, n)?;
    records.selection =
        columns.iter().fold(DecompressionSelection::base().decompress_z(), |selection, (source, _)| match source {
            Source::Field(field) => field.select(selection),
            Source::Extra(_) => selection.decompress_extra_bytes(),
        });
    let length = usize::from(records.header.record_length);
    options.monitor.stage("read", n as u64);
    let monitor = options.monitor.clone();
    records.for_each(&monitor, |Slab { points, bytes }| {
        monitor.advance(points.len() as u64);
        let bytes = &*bytes;
        ticks.par_iter_mut().enumerate().for_each(|(a, axis)| {
            axis.extend(bytes.chunks_exact(length).map(|record| i32::from_le_bytes(array(record, 4 * a))));
        });
        columns.par_iter_mut().for_each(|(source, column)| {
            grow(&mut column.values, points.end);
            for (record, i) in bytes.chunks_exact(length).zip(points.clone()) {
                match source {
                    Source::Field(field) => field.take(format, record, i, &mut column.values),
                    Source::Extra(extra) => extra.take(record, i, &mut column.values),
                }
            }
        });
        Ok(())
    })?;
    finish(&records, ticks, columns.into_iter().map(|c| c.1))
}

/// Asks for the address space of `n` points; memory is taken only as points come, so a hostile count costs nothing.
fn reserve(ticks: &mut [Vec<i32>; 3], columns: &mut [(Source, Column)], n: usize) -> Result<()> {
    let axes = ticks.iter_mut().all(|axis| axis.try_reserve_exact(n).is_ok());
    match axes && columns.iter_mut().all(|(_, column)| extra::reserve(&mut column.values, n)) {
        true => Ok(()),
        false => Err(Error::input(format!("not enough memory for {n} points with {} columns", columns.len()))),
    }
}

fn finish(records: &Records, ticks: [Vec<i32>; 3], columns: impl Iterator<Item = Column>) -> Result<Cloud> {
    let header = &records.header;
    let mut cloud = Cloud::new(Coordinates::Scaled { ticks, scale: header.scale, offset: header.offset })?;
    for mut column in columns {
        // Two dimensions of one name (it happens) are told apart by a number.
        let name = column.name.clone();
        let mut serial = 2;
        while cloud.column(&column.name).is_some() {
            column.name = format!("{name}_{serial}");
            serial += 1;
        }
        cloud.set_column(column)?;
    }
    (cloud.crs, cloud.metres_per_unit) = crs(header, records.vlrs.iter().chain(&records.evlrs));
    Ok(cloud)
}

/// Fails if there is not one code a point.
pub(super) fn check_codes(codes: &[u8], points: u64) -> Result<()> {
    match codes.len() as u64 == points {
        true => Ok(()),
        false => Err(Error::input(format!("{} class codes for {points} points", codes.len()))),
    }
}

/// Fails if a column does not have one value a point.
pub(super) fn check_values(name: &str, values: &Values, points: u64) -> Result<()> {
    match values.len() as u64 == points {
        true => Ok(()),
        false => Err(Error::input(format!("dimension {name} has {} values for {points} points", values.len()))),
    }
}
