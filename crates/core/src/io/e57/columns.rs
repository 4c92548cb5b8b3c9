//! The columns of all scans of a file, and their types.

use crate::cloud::{Column, Values, names};
use crate::io::ReadOptions;
use crate::io::table::known;
use crate::io::table::number::Kind;
use ::e57::{PointCloud, RecordDataType, RecordName};
use std::collections::HashMap;

/// Name and type of each column, in the order in which they first appear.
#[derive(Clone, Debug, Default)]
pub(super) struct ScanColumns {
    list: Vec<(String, Span)>,
    places: HashMap<String, usize>,
}

/// The type of values that a column must hold.
#[derive(Clone, Copy, Debug)]
struct Span {
    float: Option<Kind>,
    /// Smallest and largest integer.
    low: i64,
    high: i64,
}

/// Column name of a field; `None` for coordinates and validity flags.
pub(super) fn name(field: &RecordName) -> Option<String> {
    let name = match field {
        RecordName::Intensity => names::INTENSITY,
        RecordName::ColorRed => names::COLOUR[0],
        RecordName::ColorGreen => names::COLOUR[1],
        RecordName::ColorBlue => names::COLOUR[2],
        RecordName::RowIndex => "RowIndex",
        RecordName::ColumnIndex => "ColumnIndex",
        RecordName::ReturnCount => names::NUMBER_OF_RETURNS,
        RecordName::ReturnIndex => names::RETURN_NUMBER,
        RecordName::TimeStamp => "TimeStamp",
        RecordName::Unknown { name, .. } => return Some(known::name(name)),
        _ => return None,
    };
    Some(name.into())
}

/// Value of the first return: E57 counts returns from 0.
pub(super) fn first(field: &RecordName) -> i64 {
    i64::from(*field == RecordName::ReturnIndex)
}

impl ScanColumns {
    /// The columns of the selected fields of all scans.
    pub(super) fn of(scans: &[PointCloud], options: &ReadOptions) -> Self {
        let mut columns = Self::default();
        for record in scans.iter().flat_map(|scan| &scan.prototype) {
            let Some(name) = name(&record.name).filter(|n| options.wants(n)) else { continue };
            let span = Span::of(&record.data_type, first(&record.name));
            match columns.places.get(&name) {
                Some(&at) => columns.list[at].1 = columns.list[at].1.with(span),
                None => {
                    columns.places.insert(name.clone(), columns.list.len());
                    columns.list.push((name, span));
                }
            }
        }
        columns
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.list.iter().map(|(name, _)| name.clone()).collect()
    }

    pub(super) fn position(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Bytes of a point: coordinates, these columns and the index of the scan.
    pub(super) fn width(&self) -> u64 {
        self.list.iter().map(|(_, span)| span.kind().size() as u64).sum::<u64>() + 28
    }

    /// The columns, empty.
    pub(super) fn empty(&self) -> Vec<Column> {
        self.list.iter().map(|(name, span)| Column::new(name, span.kind().values())).collect()
    }
}

impl Span {
    fn of(kind: &RecordDataType, first: i64) -> Self {
        match kind {
            RecordDataType::Single { .. } => Self { float: Some(Kind::F32), low: 0, high: 0 },
            RecordDataType::Double { .. } | RecordDataType::ScaledInteger { .. } => {
                Self { float: Some(Kind::F64), low: 0, high: 0 }
            }
            // 0 is stored if a scan has no value.
            RecordDataType::Integer { min, max } => {
                Self { float: None, low: min.saturating_add(first).min(0), high: max.saturating_add(first).max(0) }
            }
        }
    }

    fn with(self, other: Self) -> Self {
        let float = match (self.float, other.float) {
            (None, None) => None,
            (Some(Kind::F32), Some(Kind::F32)) => Some(Kind::F32),
            _ => Some(Kind::F64),
        };
        Self { float, low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn kind(self) -> Kind {
        let fits = |low: i64, high: i64| self.low >= low && self.high <= high;
        match self.float {
            Some(kind) => kind,
            None if fits(0, 255) => Kind::U8,
            None if fits(0, 65_535) => Kind::U16,
            None if fits(-32_768, 32_767) => Kind::I16,
            None if fits(0, i64::from(u32::MAX)) => Kind::U32,
            None if fits(i64::from(i32::MIN), i64::from(i32::MAX)) => Kind::I32,
            None => Kind::I64,
        }
    }
}

/// Appends a value; integers fit, because the type was chosen by their range.
pub(super) fn push(values: &mut Values, integer: i64, float: f64) {
    match values {
        Values::U8(v) => v.push(integer as u8),
        Values::I8(v) => v.push(integer as i8),
        Values::U16(v) => v.push(integer as u16),
        Values::I16(v) => v.push(integer as i16),
        Values::U32(v) => v.push(integer as u32),
        Values::I32(v) => v.push(integer as i32),
        Values::U64(v) => v.push(integer as u64),
        Values::I64(v) => v.push(integer),
        Values::F32(v) => v.push(float as f32),
        Values::F64(v) => v.push(float),
    }
}
