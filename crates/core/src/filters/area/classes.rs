//! Polygons with a class each, from GeoJSON.

use super::Area;
use crate::classes::LabelMap;
use crate::error::{Error, Result};
use crate::io::open;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Names of the property that holds the class, by preference.
const NAMES: [&str; 4] = ["class", "Class", "Classification", "code"];

/// An area and the class of the points in it.
#[derive(Clone, Debug)]
pub struct ClassArea {
    /// The area.
    pub area: Area,
    /// Class code.
    pub code: u8,
}

impl ClassArea {
    /// Reads the features of a GeoJSON file whose property `class` (or `Class`, `Classification`, `code`) is a class code.
    /// Features without a geometry or without a class are left out. Codes become those of the map; above 255 they need an
    /// entry.
    ///
    /// # Errors
    /// If the file cannot be read, is no collection of features with polygons, a class is no code, or none has a class.
    pub fn read_mapped(path: &Path, map: &LabelMap) -> Result<Vec<Self>> {
        let text = open::text(path, open::MOST_TABLE)?;
        areas(&text, map).map_err(|e| Error::input(format!("{}: {e}", path.display())))
    }
}

fn areas(text: &str, map: &LabelMap) -> Result<Vec<ClassArea>> {
    let value: Value = serde_json::from_str(text).map_err(|e| Error::input(format!("GeoJSON: {e}")))?;
    let Some(features) = value.get("features").and_then(Value::as_array) else {
        return Err(Error::input("GeoJSON: found no features; expected a FeatureCollection of polygons with a class"));
    };
    let mut found = Vec::new();
    for (number, feature) in (1..).zip(features) {
        let geometry = feature.get("geometry").filter(|geometry| !geometry.is_null());
        let class = feature.get("properties").and_then(Value::as_object).and_then(class_of);
        let (Some(geometry), Some(class)) = (geometry, class) else { continue };
        let code = value_of(class).and_then(|value| map.of_value(value)).ok_or_else(|| {
            let expected = "a code 0..255; larger ones need a --map";
            Error::input(format!("GeoJSON: feature {number}: found class {class}, expected {expected}"))
        })?;
        let alone = json!({ "type": "Feature", "crs": value.get("crs"), "geometry": geometry });
        let area = alone.to_string().parse().map_err(|e| Error::input(format!("feature {number}: {e}")))?;
        found.push(ClassArea { area, code });
    }
    match found.is_empty() {
        true => Err(Error::input(format!("GeoJSON: no feature has one of the properties {}", NAMES.join(", ")))),
        false => Ok(found),
    }
}

/// The property with the class, unless it is empty.
fn class_of(properties: &Map<String, Value>) -> Option<&Value> {
    let value = NAMES.iter().find_map(|name| properties.get(*name))?;
    (!value.is_null() && value.as_str() != Some("")).then_some(value)
}

/// A class code, as a number or as text.
fn value_of(class: &Value) -> Option<f64> {
    match class {
        Value::String(text) => text.trim().parse::<u32>().ok().map(f64::from),
        _ => class.as_f64(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = r#"{"type":"Polygon","coordinates":[[[0,0],[2,0],[2,2],[0,2],[0,0]]]}"#;

    fn collection(features: &[(&str, &str)]) -> String {
        let feature = |(properties, geometry): &(&str, &str)| {
            format!(r#"{{"type":"Feature","properties":{properties},"geometry":{geometry}}}"#)
        };
        let features: Vec<String> = features.iter().map(feature).collect();
        let crs = r#"{"type":"name","properties":{"name":"EPSG:2154"}}"#;
        format!(r#"{{"type":"FeatureCollection","crs":{crs},"features":[{}]}}"#, features.join(","))
    }

    #[test]
    fn features_with_a_class_are_read_and_others_left_out() {
        let text = collection(&[
            (r#"{"class":6}"#, SQUARE),
            (r#"{"Classification":"5"}"#, SQUARE),
            (r#"{"class":null}"#, SQUARE),
            (r#"{"class":""}"#, SQUARE),
            ("null", SQUARE),
            (r#"{"class":2}"#, "null"),
        ]);
        let found = areas(&text, &LabelMap::default()).unwrap();
        assert_eq!(found.iter().map(|area| area.code).collect::<Vec<_>>(), [6, 5]);
        assert!(found.iter().all(|area| area.area.code == Some(2154) && area.area.holds([1.0, 1.0])));
    }

    #[test]
    fn what_is_wrong_is_told_with_the_feature() {
        let message = |text: &str| areas(text, &LabelMap::default()).unwrap_err().to_string();
        assert!(message(SQUARE).contains("FeatureCollection"));
        assert!(message(&collection(&[(r#"{"name":"roof"}"#, SQUARE)])).contains("Classification"));
        let bad = collection(&[(r#"{"class":6}"#, SQUARE), (r#"{"class":6.5}"#, SQUARE)]);
        assert!(message(&bad).contains("feature 2: found class 6.5"), "{}", message(&bad));
        let large = collection(&[(r#"{"class":1004}"#, SQUARE), (r#"{"class":"6"}"#, SQUARE)]);
        assert!(message(&large).contains("feature 1: found class 1004"), "{}", message(&large));
        let mapped = areas(&large, &"1004=6,6=2".parse().unwrap()).unwrap();
        assert_eq!(mapped.iter().map(|area| area.code).collect::<Vec<_>>(), [6, 2]);
        let point = collection(&[(r#"{"class":6}"#, r#"{"type":"Point","coordinates":[0,0]}"#)]);
        assert!(message(&point).contains("feature 1"), "{}", message(&point));
    }
}
