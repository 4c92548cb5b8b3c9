//! The fields of a point record as columns with PDAL's names.

pub(super) mod extra;
pub(super) mod fit;
pub(super) mod layout;

use super::header::{array, put};
use crate::cloud::{Values, names};
use laz::DecompressionSelection;

/// A field of the point formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::io) enum Field {
    Intensity,
    ReturnNumber,
    NumberOfReturns,
    ScanDirectionFlag,
    EdgeOfFlightLine,
    Classification,
    Synthetic,
    KeyPoint,
    Withheld,
    Overlap,
    ScanChannel,
    ScanAngle,
    UserData,
    PointSourceId,
    GpsTime,
    Red,
    Green,
    Blue,
    Infrared,
}

const ALL: [(Field, &str); 19] = [
    (Field::Intensity, names::INTENSITY),
    (Field::ReturnNumber, names::RETURN_NUMBER),
    (Field::NumberOfReturns, names::NUMBER_OF_RETURNS),
    (Field::ScanDirectionFlag, "ScanDirectionFlag"),
    (Field::EdgeOfFlightLine, "EdgeOfFlightLine"),
    (Field::Classification, names::CLASSIFICATION),
    (Field::Synthetic, "Synthetic"),
    (Field::KeyPoint, "KeyPoint"),
    (Field::Withheld, "Withheld"),
    (Field::Overlap, "Overlap"),
    (Field::ScanChannel, "ScanChannel"),
    (Field::ScanAngle, "ScanAngle"),
    (Field::UserData, "UserData"),
    (Field::PointSourceId, "PointSourceId"),
    (Field::GpsTime, "GpsTime"),
    (Field::Red, names::COLOUR[0]),
    (Field::Green, names::COLOUR[1]),
    (Field::Blue, names::COLOUR[2]),
    (Field::Infrared, "Infrared"),
];

/// Fields of a point format with their names.
pub(in crate::io) fn of_format(format: u8) -> impl Iterator<Item = (Field, &'static str)> {
    ALL.into_iter().filter(move |(field, _)| field.exists(format))
}

impl Field {
    /// The field with that name in that point format.
    pub(in crate::io) fn named(name: &str, format: u8) -> Option<Self> {
        of_format(format).find(|(_, n)| *n == name).map(|(f, _)| f)
    }

    fn exists(self, format: u8) -> bool {
        match self {
            Self::Overlap | Self::ScanChannel => format >= 6,
            Self::GpsTime => !matches!(format, 0 | 2),
            Self::Red | Self::Green | Self::Blue => matches!(format, 2 | 3 | 5 | 7 | 8 | 10),
            Self::Infrared => matches!(format, 8 | 10),
            _ => true,
        }
    }

    /// Adds the compressed layer that holds this field.
    pub(in crate::io) fn select(self, selection: DecompressionSelection) -> DecompressionSelection {
        match self {
            Self::ReturnNumber | Self::NumberOfReturns | Self::ScanChannel => selection,
            Self::Intensity => selection.decompress_intensity(),
            Self::Classification => selection.decompress_classification(),
            Self::ScanAngle => selection.decompress_scan_angle(),
            Self::UserData => selection.decompress_user_data(),
            Self::PointSourceId => selection.decompress_point_source_id(),
            Self::GpsTime => selection.decompress_gps_time(),
            Self::Red | Self::Green | Self::Blue => selection.decompress_rgb(),
            Self::Infrared => selection.decompress_nir(),
            Self::ScanDirectionFlag
            | Self::EdgeOfFlightLine
            | Self::Synthetic
            | Self::KeyPoint
            | Self::Withheld
            | Self::Overlap => selection.decompress_flags(),
        }
    }

    /// An empty column of this field's type.
    pub(in crate::io) fn values(self) -> Values {
        match self {
            Self::Intensity | Self::PointSourceId | Self::Red | Self::Green | Self::Blue | Self::Infrared => {
                Values::U16(Vec::new())
            }
            Self::ScanAngle => Values::F32(Vec::new()),
            Self::GpsTime => Values::F64(Vec::new()),
            _ => Values::U8(Vec::new()),
        }
    }

    /// Appends the value of every record of `length` bytes to values of the field's type.
    pub(in crate::io) fn append(self, format: u8, records: &[u8], length: usize, values: &mut Values) {
        let each = records.chunks_exact(length);
        match values {
            Values::U8(v) => {
                let (at, shift, bits) = self.bits(format);
                let mask = (0xffu16 >> (8 - bits)) as u8;
                v.extend(each.map(|record| record.get(at).map_or(0, |byte| byte >> shift & mask)));
            }
            Values::F32(v) if format >= 6 => {
                v.extend(each.map(|record| f32::from(i16::from_le_bytes(array(record, 18))) * 0.006));
            }
            Values::F32(v) => v.extend(each.map(|record| f32::from(record.get(16).map_or(0, |byte| *byte as i8)))),
            Values::U16(v) => {
                let at = self.place(format);
                v.extend(each.map(|record| u16::from_le_bytes(array(record, at))));
            }
            Values::F64(v) => {
                let at = self.place(format);
                v.extend(each.map(|record| f64::from_le_bytes(array(record, at))));
            }
            _ => {}
        }
    }

    /// Byte offset, shift and width of a field of at most 8 bits.
    fn bits(self, format: u8) -> (usize, u32, u32) {
        match (self, format >= 6) {
            (Self::ReturnNumber, false) => (14, 0, 3),
            (Self::NumberOfReturns, false) => (14, 3, 3),
            (Self::ScanDirectionFlag, false) => (14, 6, 1),
            (Self::EdgeOfFlightLine, false) => (14, 7, 1),
            (Self::Classification, false) => (15, 0, 5),
            (Self::Synthetic, false) => (15, 5, 1),
            (Self::KeyPoint, false) => (15, 6, 1),
            (Self::Withheld, false) => (15, 7, 1),
            (Self::ReturnNumber, true) => (14, 0, 4),
            (Self::NumberOfReturns, true) => (14, 4, 4),
            (Self::Synthetic, true) => (15, 0, 1),
            (Self::KeyPoint, true) => (15, 1, 1),
            (Self::Withheld, true) => (15, 2, 1),
            (Self::Overlap, true) => (15, 3, 1),
            (Self::ScanChannel, true) => (15, 4, 2),
            (Self::ScanDirectionFlag, true) => (15, 6, 1),
            (Self::EdgeOfFlightLine, true) => (15, 7, 1),
            (Self::Classification, true) => (16, 0, 8),
            _ => (17, 0, 8),
        }
    }

    /// Byte offset of a field of more than 8 bits.
    fn place(self, format: u8) -> usize {
        let colour = match format {
            2 => 20,
            3 | 5 => 28,
            _ => 30,
        };
        match self {
            Self::Intensity => 12,
            Self::PointSourceId if format >= 6 => 20,
            Self::PointSourceId => 18,
            Self::GpsTime if format >= 6 => 22,
            Self::GpsTime => 20,
            Self::Red => colour,
            Self::Green => colour + 2,
            Self::Blue => colour + 4,
            _ => 36,
        }
    }

    /// Writes a value into a record, rounded and clamped to the range of the field.
    pub(in crate::io) fn store(self, format: u8, record: &mut [u8], value: f64) {
        let place = self.place(format);
        match self {
            Self::Intensity | Self::PointSourceId | Self::Red | Self::Green | Self::Blue | Self::Infrared => {
                put(record, place, &(value.round() as u16).to_le_bytes());
            }
            Self::ScanAngle if format >= 6 => put(record, 18, &((value / 0.006).round() as i16).to_le_bytes()),
            Self::ScanAngle => record[16] = value.round() as i8 as u8,
            Self::GpsTime => put(record, place, &value.to_le_bytes()),
            _ => {
                let (at, shift, bits) = self.bits(format);
                let mask = (0xffu16 >> (8 - bits)) as u8;
                let byte = (value.round() as u8).min(mask);
                record[at] = record[at] & !(mask << shift) | byte << shift;
            }
        }
    }
}
