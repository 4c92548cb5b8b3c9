//! Writing PCD.

use super::header::{LONGEST, MOST_NUMBERS};
use super::lzf;
use super::read::Reader;
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::{Error, Result};
use crate::io::atomic::AtomicFile;
use crate::io::table::number;
use crate::io::{WriteOptions, verify};
use std::path::Path;

/// Number of points assembled at once.
const SLAB: usize = 16_384;

/// The source of a field in the file.
enum Part<'a> {
    Axis(usize),
    Value(&'a Values),
    /// Red, green and blue of 8 bits: the library's `rgb`.
    Colour([&'a [u8]; 3]),
}

struct Field<'a> {
    name: String,
    letter: char,
    size: usize,
    part: Part<'a>,
}

/// Writes binary PCD 0.7, compressed if requested. Coordinates are single precision if that is exact, else double;
/// 8-bit colours become `rgb`.
pub(in crate::io) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let fields = fields(cloud);
    let head = head(&fields, cloud.len(), options.compressed);
    if fields.len() > MOST_NUMBERS || head.len() as u64 > LONGEST {
        let columns = cloud.columns().len();
        let reason =
            format!("{columns} columns; PCD files have at most {MOST_NUMBERS} numbers a point, and 64 KiB for names");
        return Err(Error::Unsupported { path: path.to_path_buf(), reason: format!("{reason}; use .npz or .csv") });
    }
    let mut file = AtomicFile::create(path)?;
    file.write_all(head.as_bytes())?;
    options.monitor.stage("write", cloud.len() as u64);
    if options.compressed {
        let points = Points { cloud, fields: &fields };
        points.compressed(path, &mut file, options)?;
        return verify::finish(file, cloud, options, Reader::open);
    }
    for first in (0..cloud.len()).step_by(SLAB) {
        options.monitor.check()?;
        let end = (first + SLAB).min(cloud.len());
        let mut bytes = Vec::new();
        for i in first..end {
            fields.iter().for_each(|field| field.put(cloud, i, &mut bytes));
        }
        file.write_all(&bytes)?;
        options.monitor.advance((end - first) as u64);
    }
    verify::finish(file, cloud, options, Reader::open)
}

/// The points and their fields.
struct Points<'a> {
    cloud: &'a Cloud,
    fields: &'a [Field<'a>],
}

impl Points<'_> {
    fn compressed(&self, path: &Path, file: &mut AtomicFile, options: &WriteOptions) -> Result<()> {
        let Self { cloud, fields } = *self;
        let mut bytes = Vec::new();
        for field in fields {
            options.monitor.check()?;
            (0..cloud.len()).for_each(|i| field.put(cloud, i, &mut bytes));
        }
        let packed = lzf::pack(&bytes);
        let [Ok(packed_size), Ok(size)] = [packed.len(), bytes.len()].map(u32::try_from) else {
            let reason =
                format!("{} bytes do not fit binary_compressed PCD (4 GiB); write it uncompressed", bytes.len());
            return Err(Error::Unsupported { path: path.to_path_buf(), reason });
        };
        file.write_all(&packed_size.to_le_bytes())?;
        file.write_all(&size.to_le_bytes())?;
        file.write_all(&packed)
    }
}

fn fields(cloud: &Cloud) -> Vec<Field<'_>> {
    let single = (0..cloud.len()).all(|i| cloud.xyz(i).iter().all(|v| v.is_nan() || is_single(*v)));
    let mut fields: Vec<Field<'_>> = (0..3)
        .map(|a| Field {
            name: ["x", "y", "z"][a].into(),
            letter: 'F',
            size: if single { 4 } else { 8 },
            part: Part::Axis(a),
        })
        .collect();
    let colours = names::COLOUR.map(|name| match cloud.column(name).map(|c| &c.values) {
        Some(Values::U8(v)) => Some(&v[..]),
        _ => None,
    });
    let packed = match colours {
        [Some(red), Some(green), Some(blue)] => Some([red, green, blue]),
        _ => None,
    };
    for column in cloud.columns() {
        match packed {
            Some(colours) if names::COLOUR.contains(&&column.name[..]) => {
                if column.name == names::COLOUR[0] {
                    fields.push(Field { name: "rgb".into(), letter: 'F', size: 4, part: Part::Colour(colours) });
                }
            }
            _ => fields.push(field(column)),
        }
    }
    fields
}

#[expect(clippy::float_cmp, reason = "whether nothing is lost is an exact question")]
fn is_single(v: f64) -> bool {
    f64::from(v as f32) == v
}

fn field(column: &Column) -> Field<'_> {
    let name = column.name.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).collect::<String>();
    // Names with a special meaning in PCD.
    let taken = ["_", "", "rgb", "rgba", "x", "y", "z"].iter().any(|t| name.eq_ignore_ascii_case(t));
    let letter = match column.values {
        Values::U8(_) | Values::U16(_) | Values::U32(_) | Values::U64(_) => 'U',
        Values::I8(_) | Values::I16(_) | Values::I32(_) | Values::I64(_) => 'I',
        Values::F32(_) | Values::F64(_) => 'F',
    };
    let size = number::Kind::of(&column.values).size();
    Field { name: if taken { format!("{name}_") } else { name }, letter, size, part: Part::Value(&column.values) }
}

fn head(fields: &[Field<'_>], points: usize, compressed: bool) -> String {
    let join = |words: Vec<String>| words.join(" ");
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {}\n",
        join(fields.iter().map(|f| f.name.clone()).collect()),
        join(fields.iter().map(|f| f.size.to_string()).collect()),
        join(fields.iter().map(|f| f.letter.to_string()).collect()),
        join(fields.iter().map(|_| "1".to_string()).collect()),
        if compressed { "binary_compressed" } else { "binary" },
    )
}

impl Field<'_> {
    /// Appends the bytes of point `i`.
    fn put(&self, cloud: &Cloud, i: usize, bytes: &mut Vec<u8>) {
        match &self.part {
            Part::Axis(a) if self.size == 4 => bytes.extend((cloud.xyz(i)[*a] as f32).to_le_bytes()),
            Part::Axis(a) => bytes.extend(cloud.xyz(i)[*a].to_le_bytes()),
            Part::Colour([red, green, blue]) => bytes.extend([blue[i], green[i], red[i], 255]),
            Part::Value(values) => number::put(values, i, bytes),
        }
    }
}
