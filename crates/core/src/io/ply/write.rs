//! Writing PLY.

use crate::cloud::{Cloud, Column, Values, names};
use crate::error::Result;
use crate::io::WriteOptions;
use crate::io::atomic::AtomicFile;
use std::path::Path;

/// Points that are put together at once.
const SLAB: usize = 16_384;

/// Writes binary little-endian PLY: double x y z, colours of 8 bits as uchar, all other columns as float `scalar_NAME`.
pub(in crate::io) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let mut header =
        format!("ply\nformat binary_little_endian 1.0\ncomment written by scansion\nelement vertex {}\n", cloud.len());
    header += "property double x\nproperty double y\nproperty double z\n";
    let is_colour = |c: &Column| names::COLOUR.contains(&c.name.as_str()) && matches!(c.values, Values::U8(_));
    for column in cloud.columns() {
        let plain: String = column.name.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).collect();
        header += &match is_colour(column) {
            true => format!("property uchar {}\n", plain.to_lowercase()),
            false => format!("property float scalar_{plain}\n"),
        };
    }
    header += "end_header\n";
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
            for column in cloud.columns() {
                match (&column.values, is_colour(column)) {
                    (Values::U8(v), true) => buffer.push(v[i]),
                    (values, _) => buffer.extend((values.get(i) as f32).to_le_bytes()),
                }
            }
        }
        file.write_all(&buffer)?;
        buffer.clear();
    }
    file.finish()
}
