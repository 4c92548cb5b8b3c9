//! Reading a LAS or LAZ file into a cloud.

use super::extra::{self, Extra};
use super::fields::{self, Field};
use super::header::array;
use super::records::Records;
use super::vlr::crs;
use crate::cloud::{Cloud, Column, Coordinates, Values};
use crate::error::{Error, Result};
use crate::io::ReadOptions;
use std::path::Path;

/// Where a column comes from.
enum Source {
    Field(Field),
    Extra(Extra),
}

/// Reads coordinates and the wanted columns.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let mut records = Records::open(path)?;
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
    for (source, column) in &mut columns {
        column.values = match source {
            Source::Field(field) => field.values(n),
            Source::Extra(extra) => extra.values(n),
        };
    }
    let mut ticks = [vec![0i32; n], vec![0i32; n], vec![0i32; n]];
    let length = usize::from(records.header.record_length);
    options.monitor.stage("read", n as u64);
    let monitor = options.monitor.clone();
    records.for_each(&monitor, |slab| {
        monitor.advance(slab.points.len() as u64);
        for (record, i) in slab.bytes.chunks_exact(length).zip(slab.points) {
            (0..3).for_each(|a| ticks[a][i] = i32::from_le_bytes(array(record, 4 * a)));
            for (source, column) in &mut columns {
                match source {
                    Source::Field(field) => field.take(format, record, i, &mut column.values),
                    Source::Extra(extra) => extra.take(record, i, &mut column.values),
                }
            }
        }
        Ok(())
    })?;
    finish(&records, ticks, columns.into_iter().map(|c| c.1))
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

/// Fails if a code does not fit into a class of the point format.
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
