//! Conversion of raw records to a cloud: column by column, in pieces that fit into the cache.

use crate::cloud::{ClassNames, Cloud, CodeScheme, Column, Coordinates};
use crate::error::Result;
use crate::io::las::fields::extra::Extra;
use crate::io::las::fields::{self, Field};
use crate::io::las::header::Header;
use crate::io::las::header::crs::Projection;
use crate::io::las::header::lookup;
use crate::io::las::records::Records;
use crate::io::options::Bounds;
use crate::io::table::limits::Names;
use crate::io::table::number::array;
use crate::io::{ReadOptions, table};
use laz::DecompressionSelection;
use rayon::prelude::*;

/// Bytes of records from which one thread extracts the columns.
const PIECE: usize = 128 << 10;

/// Source of a column.
#[derive(Clone, Debug)]
enum FieldSource {
    Field(Field),
    Extra(Extra),
}

/// Points extracted from records and not returned yet.
#[derive(Clone, Debug)]
pub(super) struct Sink {
    header: Header,
    bounds: Option<Bounds>,
    ticks: [Vec<i32>; 3],
    columns: Vec<(FieldSource, Column)>,
    crs: Option<String>,
    metres_per_unit: Option<f64>,
    class_names: ClassNames,
}

impl Sink {
    /// The selected columns of a file, empty. Also selects the fields to decode in `records`.
    pub(in crate::io::las) fn new(records: &mut Records, options: &ReadOptions) -> Self {
        let header = records.header.clone();
        let (extras, _) = records.extras();
        let fields = fields::of_format(header.format)
            .map(|(field, name)| (FieldSource::Field(field), Column::new(name, field.values())));
        let extras = extras.into_iter().map(|e| {
            let column = Column::new(&e.name, e.values());
            (FieldSource::Extra(e), column)
        });
        let mut columns: Vec<(FieldSource, Column)> =
            fields.chain(extras).filter(|(_, column)| options.wants(&column.name)).collect();
        tell_apart(&mut columns);
        records.selection =
            columns.iter().fold(DecompressionSelection::base().decompress_z(), |selection, (source, _)| match source {
                FieldSource::Field(field) => field.select(selection),
                FieldSource::Extra(_) => selection.decompress_extra_bytes(),
            });
        let vlrs = records.vlrs.iter().chain(&records.evlrs);
        let Projection { crs, metres_per_unit, warning } = Projection::of(header.wkt(), vlrs);
        warning.iter().for_each(|text| options.monitor.warn(format!("{}: {text}", records.path.display())));
        let (bounds, class_names) = (options.bounds, lookup::get(&records.vlrs));
        Self { header, bounds, ticks: Default::default(), columns, crs, metres_per_unit, class_names }
    }

    /// Number of buffered points.
    pub(in crate::io::las) fn len(&self) -> usize {
        self.ticks[0].len()
    }

    /// Reserves address space for `n` points; memory is committed only as points arrive, so that a wrong count is
    /// harmless.
    pub(super) fn reserve(&mut self, n: usize) -> Result<()> {
        let axes = self.ticks.iter_mut().all(|axis| axis.try_reserve_exact(n).is_ok());
        match axes && self.columns.iter_mut().all(|(_, column)| table::reserve(&mut column.values, n)) {
            true => Ok(()),
            false => Err(table::missing(n, 12, self.columns.iter().map(|(_, column)| &column.values))),
        }
    }

    /// Adds records; only those in the box are kept.
    pub(in crate::io::las) fn push(&mut self, records: &[u8]) {
        match self.bounds {
            None => self.append(records),
            Some(bounds) => {
                let inside = within(records, &self.header, bounds);
                self.append(&inside);
            }
        }
    }

    fn append(&mut self, records: &[u8]) {
        let (format, length) = (self.header.format, usize::from(self.header.record_length));
        let axis = |a: usize, axis: &mut Vec<i32>, piece: &[u8]| {
            axis.extend(piece.chunks_exact(length).map(|record| i32::from_le_bytes(array(record, 4 * a))));
        };
        let column = |source: &FieldSource, column: &mut Column, piece: &[u8]| match source {
            FieldSource::Field(field) => field.append(format, piece, length, &mut column.values),
            FieldSource::Extra(extra) => extra.append(piece, length, &mut column.values),
        };
        if rayon::current_num_threads() > 1 && records.len() > 4 * PIECE {
            self.ticks.par_iter_mut().enumerate().for_each(|(a, ticks)| axis(a, ticks, records));
            self.columns.par_iter_mut().for_each(|(source, c)| column(source, c, records));
            return;
        }
        for piece in records.chunks((PIECE / length).max(1) * length) {
            self.ticks.iter_mut().enumerate().for_each(|(a, ticks)| axis(a, ticks, piece));
            self.columns.iter_mut().for_each(|(source, c)| column(source, c, piece));
        }
    }

    /// The first `n` buffered points (or all there are) as a cloud.
    pub(in crate::io::las) fn take(&mut self, n: usize) -> Result<Cloud> {
        let n = n.min(self.len());
        let mut ticks: [Vec<i32>; 3] = Default::default();
        for (head, axis) in ticks.iter_mut().zip(&mut self.ticks) {
            let rest = axis.split_off(n);
            *head = std::mem::replace(axis, rest);
        }
        let (scale, offset) = (self.header.scale, self.header.offset);
        let mut cloud = Cloud::new(Coordinates::Scaled { ticks, scale, offset })?;
        (cloud.scheme, cloud.class_names) = (CodeScheme::Asprs, self.class_names.clone());
        for (_, column) in &mut self.columns {
            cloud.set_column(Column::new(&column.name, table::split(&mut column.values, n)))?;
        }
        (cloud.crs, cloud.metres_per_unit) = (self.crs.clone(), self.metres_per_unit);
        Ok(cloud)
    }
}

/// The records inside the box.
pub(in crate::io::las) fn within(records: &[u8], header: &Header, [low, high]: Bounds) -> Vec<u8> {
    let Header { scale, offset, record_length, .. } = header;
    let within = |record: &&[u8]| {
        (0..3).all(|a| {
            let v = f64::from(i32::from_le_bytes(array(record, 4 * a))).mul_add(scale[a], offset[a]);
            low[a] <= v && v <= high[a]
        })
    };
    records.chunks_exact(usize::from(*record_length)).filter(within).flatten().copied().collect()
}

/// Appends a number to the second of two dimensions with the same name.
fn tell_apart(columns: &mut [(FieldSource, Column)]) {
    let mut names = Names::default();
    columns.iter_mut().for_each(|(_, column)| column.name = names.free(&column.name));
}
