//! Numbers of fixed width in binary records.

use crate::cloud::{Values, each_values};

/// Type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::io) enum Kind {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Kind {
    /// Bytes of a number.
    pub(in crate::io) fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// An empty column of this type.
    pub(in crate::io) fn values(self) -> Values {
        match self {
            Self::U8 => Values::U8(Vec::new()),
            Self::I8 => Values::I8(Vec::new()),
            Self::U16 => Values::U16(Vec::new()),
            Self::I16 => Values::I16(Vec::new()),
            Self::U32 => Values::U32(Vec::new()),
            Self::I32 => Values::I32(Vec::new()),
            Self::U64 => Values::U64(Vec::new()),
            Self::I64 => Values::I64(Vec::new()),
            Self::F32 => Values::F32(Vec::new()),
            Self::F64 => Values::F64(Vec::new()),
        }
    }

    /// Type of these values.
    pub(in crate::io) fn of(values: &Values) -> Self {
        match values {
            Values::U8(_) => Self::U8,
            Values::I8(_) => Self::I8,
            Values::U16(_) => Self::U16,
            Values::I16(_) => Self::I16,
            Values::U32(_) => Self::U32,
            Values::I32(_) => Self::I32,
            Values::U64(_) => Self::U64,
            Values::I64(_) => Self::I64,
            Values::F32(_) => Self::F32,
            Values::F64(_) => Self::F64,
        }
    }
}

/// Appends the little-endian bytes of value `i`.
pub(in crate::io) fn put(values: &Values, i: usize, bytes: &mut Vec<u8>) {
    each_values!(values, v => bytes.extend(v[i].to_le_bytes()));
}

/// One number in every record of `width` bytes.
#[derive(Clone, Copy, Debug)]
pub(in crate::io) struct Slot {
    pub(in crate::io) kind: Kind,
    /// Offset of its first byte; the number ends within the record.
    pub(in crate::io) at: usize,
    /// Bytes of a record, above 0.
    pub(in crate::io) width: usize,
    pub(in crate::io) big: bool,
}

/// N bytes at an offset; zeros beyond the end.
pub(in crate::io) fn array<const N: usize>(record: &[u8], at: usize) -> [u8; N] {
    record.get(at..at + N).and_then(|bytes| bytes.try_into().ok()).unwrap_or([0; N])
}

macro_rules! numbers {
    ($slot:expr, $records:expr, $type:ty) => {{
        let (at, big) = ($slot.at, $slot.big);
        $records.chunks_exact($slot.width).map(move |record| {
            let bytes = array(record, at);
            if big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }
        })
    }};
}

impl Slot {
    /// Appends the number of every record to values of the slot's type.
    pub(in crate::io) fn append(self, records: &[u8], values: &mut Values) {
        match values {
            Values::U8(v) => v.extend(numbers!(self, records, u8)),
            Values::I8(v) => v.extend(numbers!(self, records, i8)),
            Values::U16(v) => v.extend(numbers!(self, records, u16)),
            Values::I16(v) => v.extend(numbers!(self, records, i16)),
            Values::U32(v) => v.extend(numbers!(self, records, u32)),
            Values::I32(v) => v.extend(numbers!(self, records, i32)),
            Values::U64(v) => v.extend(numbers!(self, records, u64)),
            Values::I64(v) => v.extend(numbers!(self, records, i64)),
            Values::F32(v) => v.extend(numbers!(self, records, f32)),
            Values::F64(v) => v.extend(numbers!(self, records, f64)),
        }
    }

    /// Appends the number of every record as `f64` (64-bit integers above 2^53 are rounded).
    pub(in crate::io) fn append_f64(self, records: &[u8], out: &mut Vec<f64>) {
        match self.kind {
            Kind::U8 => out.extend(numbers!(self, records, u8).map(f64::from)),
            Kind::I8 => out.extend(numbers!(self, records, i8).map(f64::from)),
            Kind::U16 => out.extend(numbers!(self, records, u16).map(f64::from)),
            Kind::I16 => out.extend(numbers!(self, records, i16).map(f64::from)),
            Kind::U32 => out.extend(numbers!(self, records, u32).map(f64::from)),
            Kind::I32 => out.extend(numbers!(self, records, i32).map(f64::from)),
            Kind::U64 => out.extend(numbers!(self, records, u64).map(|v| v as f64)),
            Kind::I64 => out.extend(numbers!(self, records, i64).map(|v| v as f64)),
            Kind::F32 => out.extend(numbers!(self, records, f32).map(f64::from)),
            Kind::F64 => out.extend(numbers!(self, records, f64)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_both_byte_orders_are_taken_from_the_middle_of_records() {
        let little = [9, 0xfe, 0xff, 7, 9, 1, 0, 7];
        let slot = Slot { kind: Kind::I16, at: 1, width: 4, big: false };
        let mut values = Kind::I16.values();
        slot.append(&little, &mut values);
        assert_eq!(values, Values::I16(vec![-2, 1]));
        let mut numbers = vec![5.0];
        Slot { big: true, ..slot }.append_f64(&little, &mut numbers);
        assert_eq!(numbers, [5.0, -257.0, 256.0]);
    }
}
