//! Extra bytes: descriptors of dimensions beyond those of the point format (VLR `LASF_Spec` 4).

use crate::cloud::{Column, Values, each_values};
use crate::error::{Error, Result};
use crate::io::las::header::vlr::Vlr;
use crate::io::las::header::{Header, f64_at};
use crate::io::table::number::{Kind, Slot};

/// A described dimension and its position in a record.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::io) struct Extra {
    pub(in crate::io) name: String,
    /// LAS data type 1..=10, or 0 for bytes without a type.
    pub(in crate::io) kind: u8,
    /// Offset of its first byte in the record.
    pub(in crate::io) at: usize,
    /// Scale and offset of a scaled value.
    pub(in crate::io) scaled: Option<(f64, f64)>,
    /// Whether it is one of the two or three values of a described dimension.
    pub(in crate::io) is_element: bool,
}

/// Bytes of data type 1..=10.
const SIZES: [usize; 11] = [0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8];

pub(in crate::io) fn is_record(vlr: &Vlr) -> bool {
    vlr.is("LASF_Spec", 4)
}

/// The described dimensions that fit into the record. Bytes without a type (0) are skipped. Of the deprecated types
/// 11..=30, which have two or three values, each value is a dimension: `name0`, `name1`, `name2`.
pub(in crate::io) fn described<'a>(header: &Header, vlrs: impl IntoIterator<Item = &'a Vlr>) -> (Vec<Extra>, usize) {
    let end = usize::from(header.record_length);
    let mut at = end - header.extra();
    let mut list = Vec::new();
    let blocks = vlrs.into_iter().filter(|v| is_record(v)).flat_map(|v| v.data.chunks_exact(192));
    for block in blocks {
        let (kind, options) = (block[2], block[3]);
        let values = match kind {
            0 => Vec::new(),
            1..=30 => elements(block),
            _ => break,
        };
        let size = match kind {
            0 => usize::from(options),
            _ => values.iter().map(|value| size_of(value.kind)).sum(),
        };
        if at + size > end {
            break;
        }
        let mut place = at;
        for value in values {
            let bytes = size_of(value.kind);
            list.push(Extra { at: place, ..value });
            place += bytes;
        }
        at += size;
    }
    (list, end - at)
}

/// The values that a descriptor of a type describes; their positions are not set.
fn elements(block: &[u8]) -> Vec<Extra> {
    let (kind, options) = (block[2], block[3]);
    let name = String::from_utf8_lossy(block[4..36].split(|&b| b == 0).next().unwrap_or_default()).into_owned();
    let count = usize::from((kind - 1) / 10 + 1);
    let element = |i: usize| {
        let scale = if options & 8 != 0 { f64_at(block, 112 + 8 * i) } else { 1.0 };
        let offset = if options & 16 != 0 { f64_at(block, 136 + 8 * i) } else { 0.0 };
        // A name has 31 bytes at most, with which it could be written again.
        let name = if count == 1 { name.clone() } else { format!("{}{i}", shortened(&name, 30)) };
        let scaled = (options & 24 != 0).then_some((scale, offset));
        Extra { name, kind: (kind - 1) % 10 + 1, at: 0, scaled, is_element: count > 1 }
    };
    (0..count).map(element).collect()
}

/// The first characters of a name, at most that many bytes.
fn shortened(name: &str, most: usize) -> &str {
    let end = (0..=name.len().min(most)).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
    &name[..end]
}

impl Extra {
    fn kind(&self) -> Kind {
        match self.kind {
            1 => Kind::U8,
            2 => Kind::I8,
            3 => Kind::U16,
            4 => Kind::I16,
            5 => Kind::U32,
            6 => Kind::I32,
            7 => Kind::U64,
            8 => Kind::I64,
            9 => Kind::F32,
            _ => Kind::F64,
        }
    }

    /// An empty column of this dimension's type; `f64` for scaled values.
    pub(in crate::io) fn values(&self) -> Values {
        if self.scaled.is_some() { Values::F64(Vec::new()) } else { self.kind().values() }
    }

    /// Appends the value of every record of `length` bytes, scaled.
    pub(in crate::io) fn append(&self, records: &[u8], length: usize, values: &mut Values) {
        let slot = Slot { kind: self.kind(), at: self.at, width: length, big: false };
        match (self.scaled, &mut *values) {
            (Some((factor, offset)), Values::F64(v)) => {
                let first = v.len();
                slot.append_f64(records, v);
                v[first..].iter_mut().for_each(|x| *x = x.mul_add(factor, offset));
            }
            _ => slot.append(records, values),
        }
    }
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

/// The 192-byte descriptor of a column.
///
/// # Errors
/// If the name is empty, longer than 31 bytes, or contains special characters.
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

/// Descriptors for bytes without a descriptor: at most 255 bytes each.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{self, Edit, WriteOptions};

    #[test]
    fn the_values_of_an_array_are_dimensions() {
        let folder = tempfile::tempdir().unwrap();
        let (path, target) = (folder.path().join("a.las"), folder.path().join("b.laz"));
        let mut builder = las::Builder::from((1, 4));
        builder.point_format = las::point::Format::new(6).unwrap();
        builder.point_format.extra_bytes = 14;
        let mut arrays = vec![0; 2 * 192];
        // Three floats, and two scaled 8-bit integers.
        (arrays[2], arrays[192 + 2], arrays[192 + 3]) = (29, 12, 8);
        arrays[4..10].copy_from_slice(b"normal");
        arrays[196] = b'q';
        arrays[192 + 112..][..16].copy_from_slice(&[0.5f64, 10.0].map(f64::to_le_bytes).concat());
        builder.vlrs.push(las::Vlr { user_id: "LASF_Spec".into(), record_id: 4, description: "".into(), data: arrays });
        let mut writer = las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
        for i in 0..20u8 {
            let floats = [0.0, 1.0, 2.0].map(|k| (f32::from(i) + k).to_le_bytes()).concat();
            let extra_bytes = [floats, vec![i, 0xff]].concat();
            writer.write_point(las::Point { gps_time: Some(1.0), extra_bytes, ..Default::default() }).unwrap();
        }
        writer.close().unwrap();
        let check = |path: &std::path::Path| {
            let cloud = io::read(path).unwrap();
            let value = |name: &str| cloud.column(name).unwrap().values.get(7);
            assert_eq!(["normal0", "normal1", "normal2", "q0", "q1"].map(value), [7.0, 8.0, 9.0, 3.5, -10.0]);
        };
        check(&path);
        let new = Column::new("normal1", Values::F32(vec![8.0; 20]));
        io::rewrite(&path, &target, &[Edit::Dimension(new)], &WriteOptions::default()).unwrap();
        check(&target);
        let text = folder.path().join("c.ply");
        io::convert(&path, &text, &io::ConvertParams::default(), &WriteOptions::default()).unwrap();
        check(&text);
    }

    #[test]
    fn descriptors_in_an_extended_record_are_honoured_and_kept_when_a_dimension_is_added() {
        let folder = tempfile::tempdir().unwrap();
        let (path, target) = (folder.path().join("a.las"), folder.path().join("b.laz"));
        let mut builder = las::Builder::from((1, 4));
        builder.point_format = las::point::Format::new(6).unwrap();
        builder.point_format.extra_bytes = 3;
        let columns = [Column::new("A", Values::U8(vec![])), Column::new("B", Values::I16(vec![]))];
        let data = columns.iter().flat_map(|c| descriptor(c).unwrap()).collect();
        builder.evlrs.push(las::Vlr { user_id: "LASF_Spec".into(), record_id: 4, description: "".into(), data });
        let mut writer = las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
        for i in 0..50u8 {
            let point = las::Point { gps_time: Some(1.0), extra_bytes: vec![i, i, 0xff], ..Default::default() };
            writer.write_point(point).unwrap();
        }
        writer.close().unwrap();
        let (a, b) = ((0..50).collect(), (0..50).map(|i| i - 256).collect());
        let expected = [Values::U8(a), Values::I16(b)];
        let check = |path: &std::path::Path| {
            let cloud = io::read(path).unwrap();
            let values = ["A", "B"].map(|n| cloud.column(n).unwrap().values.clone());
            assert_eq!(values, expected);
            cloud
        };
        check(&path);
        let new = Column::new("Confidence", Values::F32((0..50).map(|i| i as f32).collect()));
        io::rewrite(&path, &target, &[Edit::Dimension(new.clone())], &WriteOptions::default()).unwrap();
        assert_eq!(check(&target).column("Confidence"), Some(&new));
    }
}
