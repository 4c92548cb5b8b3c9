//! Writing PLY.

use super::header::LONGEST;
use super::read::Reader;
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::{Error, Result};
use crate::io::atomic::AtomicFile;
use crate::io::{WriteOptions, verify};
use crate::parallel::{Monitor, watched};
use std::path::Path;

/// Number of points assembled at once.
const SLAB: usize = 16_384;

/// How a column is written.
#[derive(Clone, Copy)]
enum Kind {
    Colour,
    Single,
    Double,
}

impl Kind {
    fn of(column: &Column, monitor: &Monitor) -> Result<Self> {
        let rounds = |v: f64| f64::from(v as f32).to_bits() != v.to_bits() && !v.is_nan();
        match &column.values {
            Values::U8(_) if names::COLOUR.contains(&column.name.as_str()) => return Ok(Self::Colour),
            Values::U8(_) | Values::I8(_) | Values::U16(_) | Values::I16(_) | Values::F32(_) => {}
            values => {
                for points in watched(values.len(), monitor) {
                    if points?.any(|i| rounds(values.get(i))) {
                        return Ok(Self::Double);
                    }
                }
            }
        }
        Ok(Self::Single)
    }
}

/// Writes binary little-endian PLY: double x y z, colours of 8 bits as uchar, all other columns as
/// float `scalar_NAME`, or double if a value needs it.
pub(in crate::io) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let mut header =
        format!("ply\nformat binary_little_endian 1.0\ncomment written by scansion\nelement vertex {}\n", cloud.len());
    header += "property double x\nproperty double y\nproperty double z\n";
    let kinds = cloud.columns().iter().map(|c| Kind::of(c, &options.monitor)).collect::<Result<Vec<_>>>()?;
    for (column, kind) in cloud.columns().iter().zip(&kinds) {
        let plain: String = column.name.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).collect();
        header += &match kind {
            Kind::Colour => format!("property uchar {}\n", plain.to_lowercase()),
            Kind::Single => format!("property float scalar_{plain}\n"),
            Kind::Double => format!("property double scalar_{plain}\n"),
        };
    }
    header += "end_header\n";
    if header.len() as u64 > LONGEST {
        let columns = cloud.columns().len();
        let reason = format!("the names of {columns} columns make a longer header than PLY files may have (1 MiB)");
        return Err(Error::Unsupported { path: path.to_path_buf(), reason: format!("{reason}; use .npz or .csv") });
    }
    let mut file = AtomicFile::create(path)?;
    file.write_all(header.as_bytes())?;
    options.monitor.stage("write", cloud.len() as u64);
    let mut buffer = Vec::new();
    for first in (0..cloud.len()).step_by(SLAB) {
        options.monitor.check()?;
        let points = first..(first + SLAB).min(cloud.len());
        options.monitor.advance(points.len() as u64);
        for i in points {
            cloud.xyz(i).iter().for_each(|v| buffer.extend(v.to_le_bytes()));
            for (column, kind) in cloud.columns().iter().zip(&kinds) {
                match (&column.values, kind) {
                    (Values::U8(v), Kind::Colour) => buffer.push(v[i]),
                    (values, Kind::Double) => buffer.extend(values.get(i).to_le_bytes()),
                    (values, _) => buffer.extend((values.get(i) as f32).to_le_bytes()),
                }
            }
        }
        file.write_all(&buffer)?;
        buffer.clear();
    }
    verify::finish(file, cloud, options, Reader::open)
}
