//! Lines as GeoPackage, with z.

use super::Drawing;
use crate::error::Result;
use crate::io::maps::{Feature, Layer, bounds, rounded, written};
use crate::parallel::{Looks, Monitor};

/// Well-known binary's number of a line with z.
const LINE: u32 = 1002;

/// The bytes of a file with one table of that name.
pub(super) fn bytes(name: &str, drawing: &Drawing, monitor: &Monitor) -> Result<Vec<u8>> {
    let mut looks = Looks::at(monitor);
    let attributes: Vec<_> = drawing.lines.iter().map(super::DrawnLine::attributes).collect();
    let mut features = Vec::with_capacity(drawing.lines.len());
    for (line, properties) in drawing.lines.iter().zip(&attributes) {
        looks.steps(line.vertices.len())?;
        let places: Vec<[f64; 3]> = line.path().map(rounded).collect();
        let mut shape = vec![1];
        shape.extend(LINE.to_le_bytes());
        shape.extend((places.len() as u32).to_le_bytes());
        places.iter().flatten().for_each(|v| shape.extend(v.to_le_bytes()));
        features.push(Feature { bounds: bounds(places.iter()), shape, properties });
    }
    written(&Layer { name, kind: "LINESTRING", heights: true, features }, &drawing.place)
}
