//! Polygons from GeoJSON (RFC 7946), whose coordinates are those of the cloud; the member `crs` of GeoJSON 2008 names
//! their reference system, as GDAL writes it.

use super::Parsed;
use super::polygon::Ring;
use crate::error::{Error, Result};
use serde::Deserialize;
use serde_json::Value;

/// A GeoJSON object.
#[derive(Deserialize)]
#[serde(tag = "type")]
enum Object {
    FeatureCollection { features: Vec<Object> },
    Feature { geometry: Option<Box<Object>> },
    GeometryCollection { geometries: Vec<Object> },
    Polygon { coordinates: Vec<Vec<Position>> },
    MultiPolygon { coordinates: Vec<Vec<Vec<Position>>> },
    Point,
    MultiPoint,
    LineString,
    MultiLineString,
}

/// x, y and perhaps z.
#[derive(Deserialize)]
struct Position(Vec<f64>);

/// The polygons of a text.
pub(super) fn parsed(text: &str) -> Result<Parsed> {
    let wrong = |e: serde_json::Error| Error::input(format!("GeoJSON: {e}"));
    let value: Value = serde_json::from_str(text).map_err(wrong)?;
    let name = value.pointer("/crs/properties/name").and_then(Value::as_str);
    let mut parsed = Parsed { code: name.and_then(code), ..Parsed::default() };
    add(serde_json::from_value(value).map_err(wrong)?, &mut parsed)?;
    match parsed.polygons.is_empty() {
        true => Err(Error::input("GeoJSON: found no polygon")),
        false => Ok(parsed),
    }
}

/// The EPSG code of `urn:ogc:def:crs:EPSG::25832` or `EPSG:25832`.
fn code(name: &str) -> Option<u16> {
    let (before, number) = name.rsplit_once(':')?;
    before.contains("EPSG").then(|| number.parse().ok())?
}

/// Adds the polygons of an object; its depth is limited by the JSON parser.
fn add(object: Object, parsed: &mut Parsed) -> Result<()> {
    let mut polygon = |rings: Vec<Vec<Position>>| {
        let rings = rings.into_iter().map(|ring| ring.into_iter().map(place).collect::<Result<Ring>>());
        parsed.polygons.push(rings.collect::<Result<_>>()?);
        Ok(())
    };
    match object {
        Object::Polygon { coordinates } => polygon(coordinates),
        Object::MultiPolygon { coordinates } => coordinates.into_iter().try_for_each(polygon),
        Object::Feature { geometry } => geometry.map_or(Ok(()), |geometry| add(*geometry, parsed)),
        Object::FeatureCollection { features: all } | Object::GeometryCollection { geometries: all } => {
            all.into_iter().try_for_each(|object| add(object, parsed))
        }
        Object::Point | Object::MultiPoint | Object::LineString | Object::MultiLineString => {
            Err(Error::input("GeoJSON: found points or lines, expected polygons only"))
        }
    }
}

fn place(Position(numbers): Position) -> Result<[f64; 2]> {
    match numbers[..] {
        [x, y, ..] => Ok([x, y]),
        _ => Err(Error::input(format!("GeoJSON: found a position of {} numbers, expected x and y", numbers.len()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str =
        r#"{"type":"Polygon","coordinates":[[[0,0,7],[2,0,7],[2,2,7],[0,2,7],[0,0,7]],[[0.5,0.5],[1,0.5],[1,1]]]}"#;

    #[test]
    fn polygons_are_found_in_features_and_collections() {
        let feature = format!(r#"{{"type":"Feature","properties":{{"a":[1]}},"geometry":{SQUARE}}}"#);
        let empty = r#"{"type":"Feature","properties":null,"geometry":null}"#;
        let crs = r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::2154"}}"#;
        let all = format!(r#"{{"type":"FeatureCollection",{crs},"features":[{feature},{empty},{feature}]}}"#);
        let both = format!(r#"{{"type":"GeometryCollection","geometries":[{SQUARE},{SQUARE}]}}"#);
        let many = r#"{"type":"MultiPolygon","coordinates":[[[[0,0],[1,0],[1,1]]],[[[5,5],[6,5],[6,6]]]]}"#;
        for (text, count, code) in
            [(SQUARE, 1, None), (&feature, 1, None), (&all, 2, Some(2154)), (&both, 2, None), (many, 2, None)]
        {
            let found = parsed(text).unwrap();
            assert_eq!((found.polygons.len(), found.code), (count, code), "{text}");
        }
        let found = parsed(SQUARE).unwrap();
        assert_eq!((found.polygons[0].len(), found.polygons[0][0][2]), (2, [2.0, 2.0]));
    }

    #[test]
    fn what_is_no_polygon_is_refused() {
        let deep = r#"{"type":"GeometryCollection","geometries":["#.repeat(10_000);
        for (text, said) in [
            ("{", "GeoJSON"),
            (r#"{"type":"Point","coordinates":[0,0]}"#, "polygons only"),
            (r#"{"type":"Polygon","coordinates":[[[0],[1],[2]]]}"#, "1 numbers"),
            (r#"{"type":"Polygon","coordinates":[[["a",0],[1,0],[2,1]]]}"#, "GeoJSON"),
            (r#"{"type":"FeatureCollection","features":[]}"#, "no polygon"),
            (r#"{"type":"Circle","coordinates":[0,0]}"#, "Circle"),
            (&deep, "GeoJSON"),
        ] {
            let message = parsed(text).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
    }
}
