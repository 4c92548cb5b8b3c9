//! Files of lines in space, for drawing programs (DXF), geographic information systems (GeoPackage, GeoJSON) and
//! viewers (OBJ, PLY).

mod dxf;
mod geojson_lines;
mod geopackage_lines;
mod obj;
mod ply_edges;
mod read;
#[cfg(test)]
mod tests;

pub use read::read_lines;

use super::Georeference;
use super::atomic;
use super::check_output;
use super::format::extension;
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor};
use serde_json::{Map, Value, json};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Lines, and where they lie on earth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// The lines, in the order of the file.
    pub lines: Vec<DrawnLine>,
    /// Their reference system and unit.
    pub place: Georeference,
}

/// A line through places.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawnLine {
    /// At least two places (three of a closed line), finite, in the unit of the reference system; the first is not
    /// repeated at the end of a closed line.
    pub vertices: Vec<[f64; 3]>,
    /// What is drawn: `roof-wall`, `contour`. Formats that allow fewer characters get others.
    pub layer: String,
    /// Whether a last piece leads from the last place to the first.
    pub closed: bool,
    /// Red, green and blue, sRGB; in DXF the nearest colour of its table, in OBJ left out.
    pub colour: [u8; 3],
    /// Names and values, kept by GeoPackage and GeoJSON; of `confidence`, a number, PLY keeps it too.
    pub properties: Map<String, Value>,
}

impl DrawnLine {
    /// The places in order, the first once more at the end of a closed line.
    fn path(&self) -> impl Iterator<Item = &[f64; 3]> {
        self.vertices.iter().chain(self.vertices.first().filter(|_| self.closed))
    }

    /// The properties, with the layer and the colour (`#rrggbb`) unless they have a property of that name.
    fn attributes(&self) -> Map<String, Value> {
        let mut all = self.properties.clone();
        let [r, g, b] = self.colour;
        for (name, value) in [("layer", json!(self.layer)), ("colour", json!(format!("#{r:02x}{g:02x}{b:02x}")))] {
            all.entry(name).or_insert(value);
        }
        all
    }
}

impl Drawing {
    fn check(&self, monitor: &Monitor) -> Result<()> {
        let mut looks = Looks::at(monitor);
        for (number, line) in self.lines.iter().enumerate() {
            looks.steps(line.vertices.len())?;
            let least = if line.closed { 3 } else { 2 };
            let (count, layer) = (line.vertices.len(), &line.layer);
            if count < least {
                let kind = if line.closed { "closed line" } else { "line" };
                let message =
                    format!("line {number} of layer {layer:?} has {count} vertices; a {kind} has {least} or more");
                return Err(Error::input(message));
            }
            if let Some(at) = line.vertices.iter().position(|at| !at.iter().all(|v| v.is_finite())) {
                let place = line.vertices[at];
                return Err(Error::input(format!(
                    "line {number} of layer {layer:?}: vertex {at} is not finite: {place:?}"
                )));
            }
        }
        Ok(())
    }

    /// The layers in the order in which they first occur, each with a name that a format allows; names that become
    /// equal get numbers. Returns the names, and that of each line.
    fn layers(&self, allowed: impl Fn(&str) -> String) -> (Vec<String>, Vec<usize>) {
        let (mut names, mut of_lines) = (Vec::new(), Vec::with_capacity(self.lines.len()));
        let mut places: HashMap<&str, usize> = HashMap::new();
        let mut used: HashSet<String> = HashSet::new();
        // The last number given to a name.
        let mut last: HashMap<String, usize> = HashMap::new();
        for line in &self.lines {
            let place = *places.entry(&line.layer).or_insert_with(|| {
                let plain = allowed(&line.layer);
                let number = last.entry(plain.clone()).or_default();
                let mut name = String::new();
                while name.is_empty() || used.contains(&name) {
                    *number += 1;
                    name = if *number == 1 { plain.clone() } else { format!("{plain}_{number}") };
                }
                used.insert(name.clone());
                names.push(name);
                names.len() - 1
            });
            of_lines.push(place);
        }
        (names, of_lines)
    }
}

/// Fails if a drawing could not be written to this path later: its extension, or [`check_output`]. To be called before
/// long work.
///
/// # Errors
/// If the extension is neither `.dxf`, `.gpkg`, `.geojson`, `.json`, `.obj` nor `.ply`, or the file could not be
/// written.
pub fn check_drawing_output(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "dxf" | "gpkg" | "geojson" | "json" | "obj" | "ply" => check_output(path),
        _ => Err(Error::OutputName {
            path: path.to_path_buf(),
            reason:
                "lines are written as DXF (.dxf), GeoPackage (.gpkg), GeoJSON (.geojson, .json), OBJ (.obj) or PLY \
                     (.ply)"
                    .into(),
        }),
    }
}

/// Writes lines in the format of the path's extension. A drawing without lines gives a valid file without lines.
/// O(vertices).
///
/// | Extension | Lines | Layers | Colours | Properties | Reference system |
/// |---|---|---|---|---|---|
/// | `.dxf` (R12) | 3D polylines | yes, upper case | nearest of 240 | no | no |
/// | `.gpkg` | LineString with z | column | column | columns | yes |
/// | `.geojson`, `.json` | LineString with z | property | property | yes | EPSG code |
/// | `.obj` | `l` | groups | no | no | no |
/// | `.ply` | vertices and edges | no | of vertices | `confidence` | no |
///
/// GeoPackage and GeoJSON round to a thousandth of the unit, DXF and OBJ to a millionth, PLY not at all. The reference
/// system is that of x and y; that of heights, if there is one, is warned of.
///
/// # Errors
/// As [`check_drawing_output`]; if a line has fewer than two vertices (three if it is closed) or one that is not
/// finite; if the unit is not above 0, or the system contradicts itself; if the work was cancelled.
pub fn write_drawing(path: &Path, drawing: &Drawing, monitor: &Monitor) -> Result<()> {
    let kind = extension(path);
    if !["dxf", "gpkg", "geojson", "json", "obj", "ply"].contains(&kind.as_str()) {
        return check_drawing_output(path);
    }
    drawing.place.check()?;
    drawing.check(monitor)?;
    drawing.place.warn_of_loss(path, monitor);
    if ["gpkg", "geojson", "json"].contains(&kind.as_str()) {
        drawing.place.warn_of_heights(path, monitor);
    }
    let bytes = match kind.as_str() {
        "dxf" => dxf::text(drawing, monitor)?.into_bytes(),
        "obj" => obj::text(drawing, monitor)?.into_bytes(),
        "ply" => ply_edges::bytes(drawing, monitor)?,
        "gpkg" => {
            let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
            geopackage_lines::bytes(&stem, drawing, monitor)?
        }
        _ => geojson_lines::text(drawing, monitor)?.into_bytes(),
    };
    atomic::write_bytes(path, &bytes)
}
