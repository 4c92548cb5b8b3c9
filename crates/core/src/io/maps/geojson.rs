//! Writing outlines as GeoJSON.
//!
//! RFC 7946 knows WGS 84 only. Coordinates are written as they are in the cloud, and the reference system in the member
//! `crs` of the older GeoJSON 2008, as GDAL writes and reads it.

use super::{Georeference, check_output, refused};
use crate::cloud::crs::codes_of;
use crate::error::Result;
use crate::io::atomic;
use crate::io::format::extension;
use serde_json::{Map, Value, json};
use std::path::Path;

/// A polygon with properties.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Corners of the outer ring (counter-clockwise), then of each hole (clockwise), not repeated at the end.
    pub rings: Vec<Vec<[f64; 2]>>,
    /// Names and values.
    pub properties: Map<String, Value>,
}

/// Fails if outlines could not be written to this path later. To be called before long work.
///
/// # Errors
/// If the extension is neither `.geojson` nor `.json`, or the file could not be written.
pub fn check_outline_output(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "geojson" | "json" => check_output(path),
        _ => refused(path, "outlines are written as GeoJSON (.geojson)"),
    }
}

/// Writes polygons whose coordinates are in the unit of the reference system, rounded to a thousandth of it. One line
/// per polygon.
///
/// # Errors
/// As [`check_outline_output`].
pub fn write_geojson(path: &Path, outlines: &[Outline], place: &Georeference) -> Result<()> {
    if !["geojson", "json"].contains(&extension(path).as_str()) {
        return check_outline_output(path);
    }
    atomic::write_bytes(path, geojson(outlines, place).as_bytes())
}

/// The text of [`write_geojson`].
pub fn geojson(outlines: &[Outline], place: &Georeference) -> String {
    let code = place.crs.as_deref().and_then(|crs| codes_of(crs).horizontal);
    let system = code.map_or(String::new(), |code| {
        let name = json!({"type": "name", "properties": {"name": format!("urn:ogc:def:crs:EPSG::{code}")}});
        format!("\"crs\": {name},\n")
    });
    let features: Vec<String> = outlines.iter().map(feature).collect();
    format!("{{\n\"type\": \"FeatureCollection\",\n{system}\"features\": [\n{}\n]\n}}\n", features.join(",\n"))
}

fn feature(outline: &Outline) -> String {
    let corner = |[x, y]: &[f64; 2]| format!("[{x:.3}, {y:.3}]");
    let ring = |ring: &Vec<[f64; 2]>| {
        let corners: Vec<String> = ring.iter().chain(ring.first()).map(corner).collect();
        format!("[{}]", corners.join(", "))
    };
    let rings: Vec<String> = outline.rings.iter().map(ring).collect();
    let properties = serde_json::to_string(&outline.properties).unwrap_or_default();
    format!(
        "{{\"type\": \"Feature\", \"properties\": {properties}, \"geometry\": {{\"type\": \"Polygon\", \"coordinates\": [{}]}}}}",
        rings.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_are_closed_and_have_their_system_and_properties() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.geojson");
        let mut properties = Map::new();
        properties.insert("area".into(), json!(100.0));
        let outline = Outline { rings: vec![vec![[0.0, 0.0], [10.0, 0.0], [10.0, 10.0004]]], properties };
        let dutch = Georeference { crs: Some("EPSG:7415".into()), metres_per_unit: Some(1.0) };
        write_geojson(&path, &[outline.clone(), outline], &dutch).unwrap();
        let read: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(read["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::28992");
        assert_eq!(read["features"].as_array().unwrap().len(), 2);
        assert_eq!(read["features"][1]["properties"]["area"], 100.0);
        let ring = json!([[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 0.0]]]);
        assert_eq!(read["features"][0]["geometry"]["coordinates"], ring);
        write_geojson(&path, &[], &Georeference::default()).unwrap();
        let read: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert!(read.get("crs").is_none() && read["features"].as_array().unwrap().is_empty());
        assert!(write_geojson(&folder.path().join("a.shp"), &[], &dutch).is_err());
    }
}
