//! Writing PLY with vertices and edges, as MeshLab, CloudCompare and Blender read it.
//!
//! Lines share no vertices, so that colour and confidence of a line can be stored at its vertices, where readers look
//! for them: some readers refuse edges with more properties than the numbers of their two vertices.

use super::Drawing;
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor};

/// The bytes of a binary file: vertices with double x y z, a colour, and a confidence if a line has one (not a number
/// where it is missing); and edges with the numbers of two vertices.
pub(super) fn bytes(drawing: &Drawing, monitor: &Monitor) -> Result<Vec<u8>> {
    let lines = &drawing.lines;
    let vertices: usize = lines.iter().map(|line| line.vertices.len()).sum();
    let edges: usize = lines.iter().map(|line| line.vertices.len() - usize::from(!line.closed)).sum();
    if i32::try_from(vertices).is_err() {
        return Err(Error::input(format!("{vertices} vertices; a PLY file with edges has at most {}", i32::MAX)));
    }
    let confident = lines.iter().any(|line| line.properties.contains_key("confidence"));
    let mut header =
        format!("ply\nformat binary_little_endian 1.0\ncomment written by scansion\nelement vertex {vertices}\n");
    header += "property double x\nproperty double y\nproperty double z\n";
    header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    header += if confident { "property float confidence\n" } else { "" };
    header += &format!("element edge {edges}\nproperty int vertex1\nproperty int vertex2\nend_header\n");
    let mut looks = Looks::at(monitor);
    let mut bytes = header.into_bytes();
    for line in lines {
        looks.steps(line.vertices.len())?;
        let confidence = line.properties.get("confidence").and_then(serde_json::Value::as_f64);
        let confidence = confidence.map_or(f32::NAN, |v| v as f32).to_le_bytes();
        for at in &line.vertices {
            at.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend(line.colour);
            bytes.extend(if confident { &confidence[..] } else { &[] });
        }
    }
    let mut first = 0;
    for line in lines {
        looks.steps(line.vertices.len())?;
        let count = line.vertices.len();
        for start in 0..count - usize::from(!line.closed) {
            [start, (start + 1) % count].iter().for_each(|end| bytes.extend(((first + end) as i32).to_le_bytes()));
        }
        first += count;
    }
    Ok(bytes)
}
