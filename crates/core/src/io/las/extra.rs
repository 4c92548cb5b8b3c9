//! Extra bytes: the descriptors of dimensions beyond the point format (VLR `LASF_Spec` 4).

use super::header::{Header, array, f64_at};
use super::vlr::Vlr;
use crate::cloud::{Column, Values};
use crate::error::{Error, Result};
use crate::io::number::each_values;

/// One described dimension and where it stands in a record.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::io) struct Extra {
    pub(in crate::io) name: String,
    /// LAS data type 1..=10, or 0 for bytes without a type.
    pub(in crate::io) kind: u8,
    /// First byte in the record.
    pub(in crate::io) at: usize,
    /// Factor and offset of a scaled value.
    pub(in crate::io) scaled: Option<(f64, f64)>,
}

/// Bytes of data type 1..=10.
const SIZES: [usize; 11] = [0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8];

pub(in crate::io) fn is_record(vlr: &Vlr) -> bool {
    vlr.is("LASF_Spec", 4)
}

/// The described dimensions that fit into the record. Types 11..=30 (deprecated arrays) and 0 only take their room.
pub(in crate::io) fn described(header: &Header, vlrs: &[Vlr]) -> (Vec<Extra>, usize) {
    let end = usize::from(header.record_length);
    let mut at = end - header.extra();
    let mut list = Vec::new();
    let blocks = vlrs.iter().filter(|v| is_record(v)).flat_map(|v| v.data.chunks_exact(192));
    for block in blocks {
        let (kind, options) = (block[2], block[3]);
        let size = match kind {
            0 => usize::from(options),
            1..=10 => SIZES[usize::from(kind)],
            11..=30 => SIZES[usize::from((kind - 1) % 10 + 1)] * usize::from((kind - 1) / 10 + 1),
            _ => break,
        };
        if at + size > end {
            break;
        }
        if (1..=10).contains(&kind) {
            let name = String::from_utf8_lossy(block[4..36].split(|&b| b == 0).next().unwrap_or_default()).into_owned();
            let (scale, offset) = (f64_at(block, 112), f64_at(block, 136));
            let scale = if options & 8 != 0 { scale } else { 1.0 };
            let offset = if options & 16 != 0 { offset } else { 0.0 };
            let scaled = (options & 24 != 0).then_some((scale, offset));
            list.push(Extra { name, kind, at, scaled });
        }
        at += size;
    }
    (list, end - at)
}

impl Extra {
    /// The values of this dimension, empty, with room for `n`.
    pub(in crate::io) fn values(&self, n: usize) -> Values {
        match (self.scaled, self.kind) {
            (Some(_), _) | (None, 10) => Values::F64(vec![0.0; n]),
            (None, 1) => Values::U8(vec![0; n]),
            (None, 2) => Values::I8(vec![0; n]),
            (None, 3) => Values::U16(vec![0; n]),
            (None, 4) => Values::I16(vec![0; n]),
            (None, 5) => Values::U32(vec![0; n]),
            (None, 6) => Values::I32(vec![0; n]),
            (None, 7) => Values::U64(vec![0; n]),
            (None, 8) => Values::I64(vec![0; n]),
            _ => Values::F32(vec![0.0; n]),
        }
    }

    /// Value of a record, scaled.
    fn number(&self, record: &[u8]) -> f64 {
        let raw = match self.kind {
            1 => f64::from(record[self.at]),
            2 => f64::from(record[self.at] as i8),
            3 => f64::from(u16::from_le_bytes(array(record, self.at))),
            4 => f64::from(i16::from_le_bytes(array(record, self.at))),
            5 => f64::from(u32::from_le_bytes(array(record, self.at))),
            6 => f64::from(i32::from_le_bytes(array(record, self.at))),
            7 => u64::from_le_bytes(array(record, self.at)) as f64,
            8 => i64::from_le_bytes(array(record, self.at)) as f64,
            9 => f64::from(f32::from_le_bytes(array(record, self.at))),
            _ => f64::from_le_bytes(array(record, self.at)),
        };
        self.scaled.map_or(raw, |(factor, offset)| raw.mul_add(factor, offset))
    }

    /// Takes the value of a record into position `i`.
    pub(in crate::io) fn take(&self, record: &[u8], i: usize, values: &mut Values) {
        match values {
            Values::U8(v) => v[i] = record[self.at],
            Values::I8(v) => v[i] = record[self.at] as i8,
            Values::U16(v) => v[i] = u16::from_le_bytes(array(record, self.at)),
            Values::I16(v) => v[i] = i16::from_le_bytes(array(record, self.at)),
            Values::U32(v) => v[i] = u32::from_le_bytes(array(record, self.at)),
            Values::I32(v) => v[i] = i32::from_le_bytes(array(record, self.at)),
            Values::U64(v) => v[i] = u64::from_le_bytes(array(record, self.at)),
            Values::I64(v) => v[i] = i64::from_le_bytes(array(record, self.at)),
            Values::F32(v) => v[i] = f32::from_le_bytes(array(record, self.at)),
            Values::F64(v) => v[i] = self.number(record),
        }
    }
}

/// Whether there is room for `n` values in all.
pub(in crate::io) fn reserve(values: &mut Values, n: usize) -> bool {
    each_values!(values, v => v.try_reserve_exact(n.saturating_sub(v.len())).is_ok())
}

/// Lengthens to `n` values with zeros.
pub(in crate::io) fn grow(values: &mut Values, n: usize) {
    each_values!(values, v => v.resize(n, Default::default()));
}

/// LAS data type of values.
pub(in crate::io) fn kind_of(values: &Values) -> u8 {
    match values {
        Values::U8(_) => 1,
        Values::I8(_) => 2,
        Values::U16(_) => 3,
        Values::I16(_) => 4,
        Values::U32(_) => 5,
        Values::I32(_) => 6,
        Values::U64(_) => 7,
        Values::I64(_) => 8,
        Values::F32(_) => 9,
        Values::F64(_) => 10,
    }
}

/// Bytes of a value.
pub(in crate::io) fn size_of(kind: u8) -> usize {
    SIZES[usize::from(kind.min(10))]
}

/// Writes value `i` at the start of `slot`.
pub(in crate::io) fn store(values: &Values, i: usize, slot: &mut [u8]) {
    each_values!(values, v => {
        let bytes = v[i].to_le_bytes();
        slot[..bytes.len()].copy_from_slice(&bytes);
    });
}

/// The 192 bytes that describe a column.
///
/// # Errors
/// A name that is empty, longer than 31 bytes, or not plain.
pub(in crate::io) fn descriptor(column: &Column) -> Result<Vec<u8>> {
    let name = column.name.as_bytes();
    let plain = name.iter().all(|b| b.is_ascii_graphic() || *b == b' ');
    if name.is_empty() || name.len() > 31 || !plain {
        return Err(Error::parameter("dimension name", &column.name, "1 to 31 plain ASCII characters"));
    }
    let mut block = vec![0; 192];
    block[2] = kind_of(&column.values);
    block[4..4 + name.len()].copy_from_slice(name);
    Ok(block)
}

/// Descriptors of bytes that nobody described: at most 255 bytes each.
pub(in crate::io) fn undescribed(mut bytes: usize) -> Vec<u8> {
    let mut blocks = Vec::new();
    while bytes > 0 {
        let now = bytes.min(255);
        let mut block = vec![0; 192];
        block[3] = now as u8;
        block[4..15].copy_from_slice(b"undescribed");
        blocks.extend(block);
        bytes -= now;
    }
    blocks
}
