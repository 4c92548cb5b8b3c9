//! The columns of a file's records, covering every byte, and their extraction from raw records.

use super::Field;
use super::extra::{self, Extra};
use crate::cloud::{Column, Values};
use crate::io::las::fields;
use crate::io::las::header::vlr::Vlr;
use crate::io::las::header::{Header, RECORD_SIZES};
use crate::io::table::limits::Names;
use std::collections::HashMap;

/// Source of a column.
#[derive(Clone, Debug)]
enum ColumnSource {
    Axis(usize),
    Field(Field),
    Extra(Extra),
    /// At most 8 bytes without a descriptor, as a number.
    Bytes(usize, usize),
}

/// All columns of a point format with its extra bytes; together they cover every byte of a record.
#[derive(Clone, Debug)]
pub(in crate::io) struct Layout {
    format: u8,
    length: usize,
    sources: Vec<(String, ColumnSource)>,
    /// Index of the column of each name.
    places: HashMap<String, usize>,
    taken: Names,
}

/// Parts of the 29 bytes at the end of a record with a waveform (LAS 1.4 R15, table 11).
const WAVE: [(&str, usize, usize); 7] = [
    ("WavePacketDescriptorIndex", 0, 1),
    ("WaveformDataOffset", 1, 8),
    ("WaveformPacketSize", 9, 4),
    ("WaveformLocation", 13, 4),
    ("WaveformXt", 17, 4),
    ("WaveformYt", 21, 4),
    ("WaveformZt", 25, 4),
];

impl Layout {
    /// The layout according to header and Extra Bytes descriptors.
    pub(in crate::io) fn of(header: &Header, vlrs: &[Vlr]) -> Self {
        let base = usize::from(RECORD_SIZES[usize::from(header.format)]);
        let mut layout = Self {
            format: header.format,
            length: usize::from(header.record_length),
            sources: Vec::new(),
            places: HashMap::new(),
            taken: Names::default(),
        };
        (0..3).for_each(|a| layout.push(["X", "Y", "Z"][a], ColumnSource::Axis(a)));
        fields::of_format(header.format).for_each(|(field, name)| layout.push(name, ColumnSource::Field(field)));
        if matches!(header.format, 4 | 5 | 9 | 10) {
            WAVE.iter().for_each(|(name, at, size)| layout.push(name, ColumnSource::Bytes(base - 29 + at, *size)));
        }
        let mut at = base;
        for extra in extra::described(header, vlrs).0 {
            layout.unnamed(at..extra.at, base);
            at = extra.at + extra::size_of(extra.kind);
            layout.push(&extra.name.clone(), ColumnSource::Extra(extra));
        }
        layout.unnamed(at..layout.length, base);
        layout
    }

    /// Adds a column; a number is appended to a name that exists already.
    fn push(&mut self, name: &str, source: ColumnSource) {
        let free = self.taken.free(name);
        self.places.insert(free.clone(), self.sources.len());
        self.sources.push((free, source));
    }

    /// Adds bytes without a descriptor.
    fn unnamed(&mut self, range: std::ops::Range<usize>, base: usize) {
        for at in range.clone().step_by(8) {
            let size = (range.end - at).min(8);
            self.push(&format!("ExtraByte{}", at - base), ColumnSource::Bytes(at, size));
        }
    }

    /// Names of the columns, in the order of the record.
    pub(in crate::io) fn names(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|(name, _)| &name[..])
    }

    /// Whether there is a column of that name.
    pub(in crate::io) fn has(&self, name: &str) -> bool {
        self.places.contains_key(name)
    }

    /// The column of that name from raw records. `X`, `Y`, `Z` are the stored integers.
    pub(in crate::io) fn column(&self, name: &str, records: &[u8]) -> Option<Column> {
        let (name, source) = &self.sources[*self.places.get(name)?];
        let each = records.chunks_exact(self.length);
        let values = match source {
            ColumnSource::Axis(axis) => {
                Values::I32(each.map(|r| i32::from_le_bytes(crate::io::las::header::array(r, 4 * axis))).collect())
            }
            ColumnSource::Bytes(at, size) => Values::U64(each.map(|r| number(&r[*at..at + size])).collect()),
            ColumnSource::Field(field) => {
                let mut values = field.values();
                field.append(self.format, records, self.length, &mut values);
                values
            }
            ColumnSource::Extra(extra) => {
                let mut values = extra.values();
                extra.append(records, self.length, &mut values);
                values
            }
        };
        Some(Column::new(name, values))
    }
}

fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |sum, &b| sum << 8 | u64::from(b))
}
