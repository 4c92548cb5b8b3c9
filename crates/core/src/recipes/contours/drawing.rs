//! Lines as a drawing: a layer for each pair of classes.

use super::{ContourLine, Contours};
use crate::classes::ClassTable;
use crate::cloud::Cloud;
use crate::io::{Drawing, DrawnLine, Georeference};
use serde_json::{Map, Value, json};

/// The layer of lines without classes.
const LAYER: &str = "contour";
/// Colour of its lines.
const COLOUR: [u8; 3] = [255, 200, 0];

impl Contours {
    /// The lines as a drawing in the reference system of the cloud. Lines with classes lie on a layer named after both, as
    /// `ground-building`, in the colour of the class with the higher code; properties are `length` (metres), `confidence`,
    /// `class_a` and `class_b`.
    pub fn drawing(&self, cloud: &Cloud) -> Drawing {
        let codes: Vec<u8> = self.lines.iter().filter_map(|line| line.classes).flatten().collect();
        let table = ClassTable::named(&codes, cloud.scheme, &cloud.class_names);
        let lines = self.lines.iter().map(|line| line.drawn(&table)).collect();
        Drawing { lines, place: Georeference::of(cloud) }
    }
}

impl ContourLine {
    fn drawn(&self, table: &ClassTable) -> DrawnLine {
        let mut properties = Map::new();
        properties.insert("length".into(), json!((self.length * 1000.0).round() / 1000.0));
        properties.insert("confidence".into(), json!((f64::from(self.confidence) * 1000.0).round() / 1000.0));
        let (mut layer, mut colour) = (LAYER.to_string(), COLOUR);
        if let Some([a, b]) = self.classes {
            let class = |code: u8| table.classes().iter().find(|class| class.code == code);
            let name = |code: u8| class(code).map_or_else(|| format!("class {code}"), |class| class.name.clone());
            layer = format!("{}-{}", name(a), name(b));
            colour = class(b).map_or(COLOUR, |class| class.colour);
            properties.insert("class_a".into(), Value::from(name(a)));
            properties.insert("class_b".into(), Value::from(name(b)));
        }
        DrawnLine { vertices: self.vertices.clone(), layer, closed: self.closed, colour, properties }
    }
}
