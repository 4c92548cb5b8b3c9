//! The formats in which outlines are written.

use super::geojson::geojson;
use super::geopackage::geopackage;
use super::{Georeference, Outline, refused};
use crate::error::Result;
use crate::io::atomic;
use crate::io::check_output;
use crate::io::format::extension;
use crate::parallel::Monitor;
use std::path::Path;

/// Fails if outlines could not be written to this path later. To be called before long work.
///
/// # Errors
/// If the extension is neither `.geojson`, `.json` nor `.gpkg`, or the file could not be written.
pub fn check_outline_output(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "geojson" | "json" | "gpkg" => check_output(path),
        _ => refused(path, "outlines are written as GeoJSON (.geojson) or as GeoPackage (.gpkg)"),
    }
}

/// Writes polygons whose coordinates are in the unit of the reference system, rounded to a thousandth of it, as GeoJSON or
/// as GeoPackage with one table that has the name of the file, by the extension.
///
/// # Errors
/// As [`check_outline_output`], if the unit is not above 0, or the system contradicts itself.
pub fn write_outlines(path: &Path, outlines: &[Outline], place: &Georeference, monitor: &Monitor) -> Result<()> {
    place.check()?;
    place.warn_of_loss(path, monitor);
    let bytes = match extension(path).as_str() {
        "geojson" | "json" => geojson(outlines, place).into_bytes(),
        "gpkg" => {
            let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
            geopackage(&stem.unwrap_or_default(), outlines, place)?
        }
        _ => return check_outline_output(path),
    };
    atomic::write_bytes(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::super::geojson::outlines_of;
    use super::*;
    use serde_json::{Map, Value, json};

    fn square(properties: Map<String, Value>) -> Outline {
        Outline { rings: vec![vec![[0.0, 0.0], [10.0, 0.0], [10.0, 10.0004]]], properties }
    }

    #[test]
    fn geojson_is_closed_and_has_its_system_and_properties() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.geojson");
        let mut properties = Map::new();
        properties.insert("area".into(), json!(100.0));
        let outline = square(properties);
        let dutch = Georeference { crs: Some("EPSG:7415".into()), metres_per_unit: Some(1.0) };
        write_outlines(&path, &[outline.clone(), outline.clone()], &dutch, &Monitor::default()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(read["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::28992");
        assert_eq!(read["features"].as_array().unwrap().len(), 2);
        assert_eq!(read["features"][1]["properties"]["area"], 100.0);
        let ring = json!([[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 0.0]]]);
        assert_eq!(read["features"][0]["geometry"]["coordinates"], ring);
        let back = outlines_of(&text).unwrap();
        assert_eq!((back.outlines.len(), back.place.crs.as_deref()), (2, Some("EPSG:28992")));
        assert_eq!(back.outlines[0].rings, [[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]]);
        assert_eq!(back.outlines[0].properties, outline.properties);
        write_outlines(&path, &[], &Georeference::default(), &Monitor::default()).unwrap();
        let read: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert!(read.get("crs").is_none() && read["features"].as_array().unwrap().is_empty());
        assert!(write_outlines(&folder.path().join("a.shp"), &[], &dutch, &Monitor::default()).is_err());
        assert!(outlines_of("{}").is_err());
    }

    #[test]
    fn a_geopackage_is_a_database_of_whole_pages() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("houses.gpkg");
        write_outlines(&path, &[square(Map::new())], &Georeference::default(), &Monitor::default()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.starts_with(b"SQLite format 3\0") && bytes[68..72] == *b"GPKG");
        let pages = u32::from_be_bytes([bytes[28], bytes[29], bytes[30], bytes[31]]);
        assert_eq!(bytes.len(), 4096 * pages as usize);
    }
}
