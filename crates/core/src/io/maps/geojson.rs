//! Outlines as GeoJSON.
//!
//! RFC 7946 knows WGS 84 only. Coordinates are written as they are in the cloud, and the reference system in the member
//! `crs` of the older GeoJSON 2008, as GDAL writes and reads it.

use super::{Georeference, Outline};
use crate::cloud::crs::codes_of;
use crate::error::{Error, Result};
use serde::Deserialize;
use serde_json::{Map, Value, json};

/// The text of a GeoJSON file: coordinates are rounded to a thousandth of their unit; one line per polygon.
pub fn geojson(outlines: &[Outline], place: &Georeference) -> String {
    collection(&outlines.iter().map(polygon).collect::<Vec<_>>(), place)
}

/// Whether the file would tell nothing of the system, which it can only give as an EPSG code.
pub(super) fn loses(place: &Georeference) -> bool {
    place.crs.as_ref().is_some_and(|crs| codes_of(crs).horizontal.is_none())
}

/// The text of a file with these features.
pub(in crate::io) fn collection(features: &[String], place: &Georeference) -> String {
    let code = place.crs.as_deref().and_then(|crs| codes_of(crs).horizontal);
    let system = code.map_or(String::new(), |code| {
        let name = json!({"type": "name", "properties": {"name": format!("urn:ogc:def:crs:EPSG::{code}")}});
        format!("\"crs\": {name},\n")
    });
    format!("{{\n\"type\": \"FeatureCollection\",\n{system}\"features\": [\n{}\n]\n}}\n", features.join(",\n"))
}

/// The text of a feature, from the kind of its geometry and the text of its coordinates.
pub(in crate::io) fn feature(kind: &str, coordinates: &str, properties: &Map<String, Value>) -> String {
    let properties = serde_json::to_string(properties).unwrap_or_default();
    format!(
        "{{\"type\": \"Feature\", \"properties\": {properties}, \"geometry\": {{\"type\": \"{kind}\", \"coordinates\": {coordinates}}}}}"
    )
}

/// The text of places: `[[x, y], ...]`.
pub(in crate::io) fn places<'a, const N: usize>(places: impl Iterator<Item = &'a [f64; N]>) -> String {
    let place = |at: &[f64; N]| format!("[{}]", at.map(|v| format!("{v:.3}")).join(", "));
    format!("[{}]", places.map(place).collect::<Vec<_>>().join(", "))
}

fn polygon(outline: &Outline) -> String {
    let rings: Vec<String> = outline.rings.iter().map(|ring| places(ring.iter().chain(ring.first()))).collect();
    feature("Polygon", &format!("[{}]", rings.join(", ")), &outline.properties)
}

/// Outlines, and where they lie on earth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outlines {
    /// The polygons.
    pub outlines: Vec<Outline>,
    /// Their reference system, if it is known.
    pub place: Georeference,
}

/// The outlines in a text of [`geojson()`].
///
/// # Errors
/// If it is not a collection of features that are polygons in two dimensions.
pub fn outlines_of(text: &str) -> Result<Outlines> {
    let found: Collection = serde_json::from_str(text).map_err(|e| Error::input(format!("GeoJSON: {e}")))?;
    let name = found.crs.pointer("/properties/name").and_then(Value::as_str);
    let code = name.and_then(|name| name.rsplit_once(':')).and_then(|(_, code)| code.parse::<u16>().ok());
    let outline = |Feature { properties, geometry: Geometry::Polygon { mut coordinates } }| {
        coordinates.iter_mut().filter(|ring| ring.len() > 1 && ring.first() == ring.last()).for_each(|ring| {
            ring.pop();
        });
        Outline { rings: coordinates, properties }
    };
    let outlines = found.features.into_iter().map(outline).collect();
    let place = Georeference { crs: code.map(|code| format!("EPSG:{code}")), metres_per_unit: None };
    Ok(Outlines { outlines, place })
}

#[derive(Deserialize)]
struct Collection {
    features: Vec<Feature>,
    #[serde(default)]
    crs: Value,
}

#[derive(Deserialize)]
struct Feature {
    #[serde(default)]
    properties: Map<String, Value>,
    geometry: Geometry,
}

#[derive(Deserialize)]
#[serde(tag = "type")]
enum Geometry {
    Polygon { coordinates: Vec<Vec<[f64; 2]>> },
}
