//! Writing features as GeoPackage 1.3 (OGC 12-128r17): a table of polygons or lines in a SQLite database.
//!
//! The time of the last change is the beginning of 1970, so that equal features give equal bytes. There is no spatial
//! index; GIS programs make one when they are asked to.

use super::sqlite::{Kind, Row, Table, Value, database};
use super::{Georeference, Outline};
use crate::cloud::crs::{codes_of, wkt_of};
use crate::error::Result;
use serde_json::{Map, Value as Json};

/// `GPKG`, and version 1.3.
const KIND: Kind = Kind { application: 0x4750_4b47, version: 10300 };
/// Number of a system that has no EPSG code.
const OWN_SYSTEM: i64 = 100_000;
/// Number of the system of plane coordinates without any other information.
const PLANE: i64 = -1;

/// What is drawn in a file: features of one kind.
pub(in crate::io) struct Layer<'a> {
    /// Name of the table.
    pub(in crate::io) name: &'a str,
    /// `POLYGON`, `LINESTRING`.
    pub(in crate::io) kind: &'static str,
    /// Whether all places have heights.
    pub(in crate::io) heights: bool,
    pub(in crate::io) features: Vec<Feature<'a>>,
}

/// A geometry with properties.
pub(in crate::io) struct Feature<'a> {
    /// Lowest and highest x and y: `[min x, min y, max x, max y]`.
    pub(in crate::io) bounds: Option<[f64; 4]>,
    /// Well-known binary, little-endian.
    pub(in crate::io) shape: Vec<u8>,
    pub(in crate::io) properties: &'a Map<String, Json>,
}

/// The bytes of a GeoPackage with these polygons in a table of that name.
pub(super) fn geopackage(name: &str, outlines: &[Outline], place: &Georeference) -> Result<Vec<u8>> {
    let features = outlines.iter().map(feature_of).collect();
    written(&Layer { name, kind: "POLYGON", heights: false, features }, place)
}

fn feature_of(Outline { rings, properties }: &Outline) -> Feature<'_> {
    let rings: Vec<Vec<[f64; 2]>> = rings.iter().map(|ring| ring.iter().map(rounded).collect()).collect();
    Feature { bounds: bounds(rings.iter().flatten()), shape: polygon(&rings), properties }
}

/// The bytes of a GeoPackage with one layer.
///
/// # Errors
/// If the names of the properties do not fit into one page of the database.
pub(in crate::io) fn written(layer: &Layer<'_>, place: &Georeference) -> Result<Vec<u8>> {
    let system = System::of(place);
    let columns = columns(&layer.features);
    let features = features(layer, &columns, system.id);
    database(&[systems(&system), contents(layer, system.id), geometry_columns(layer, system.id), features], KIND)
}

/// Coordinates rounded to a thousandth of their unit, as in GeoJSON.
pub(in crate::io) fn rounded<const N: usize>(at: &[f64; N]) -> [f64; N] {
    at.map(|v| (v * 1000.0).round() / 1000.0)
}

/// A reference system.
struct System {
    id: i64,
    name: String,
    organization: &'static str,
    code: i64,
    definition: String,
}

impl System {
    fn of(place: &Georeference) -> Self {
        let Some(crs) = &place.crs else { return Self::undefined(PLANE, "Undefined Cartesian") };
        let code = codes_of(crs).horizontal;
        let wkt = code.and_then(wkt_of).or_else(|| Some(crs.clone()).filter(|crs| crs.contains('[')));
        let definition = wkt.unwrap_or_else(|| "undefined".into());
        match code.map(i64::from) {
            Some(id) => Self { id, name: format!("EPSG:{id}"), organization: "EPSG", code: id, definition },
            None => {
                Self { id: OWN_SYSTEM, name: "of the cloud".into(), organization: "NONE", code: OWN_SYSTEM, definition }
            }
        }
    }

    fn undefined(id: i64, name: &str) -> Self {
        Self { id, name: name.into(), organization: "NONE", code: id, definition: "undefined".into() }
    }

    fn row(&self) -> Row {
        let values = vec![
            text(&self.name),
            Value::Null,
            text(self.organization),
            Value::Integer(self.code),
            text(&self.definition),
            Value::Null,
        ];
        Row { id: self.id, values }
    }
}

/// The table of reference systems: those that every GeoPackage has, and that of the features.
fn systems(own: &System) -> Table {
    let world = Georeference { crs: Some("EPSG:4326".into()), metres_per_unit: None };
    let fixed = [
        System::undefined(PLANE, "Undefined Cartesian"),
        System::undefined(0, "Undefined geographic"),
        System::of(&world),
    ];
    let others = Some(own).filter(|own| fixed.iter().all(|known| known.id != own.id));
    let mut rows: Vec<Row> = fixed.iter().chain(others).map(System::row).collect();
    rows.sort_by_key(|row| row.id);
    let columns = "srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL, \
                   organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT";
    table("gpkg_spatial_ref_sys", columns, rows)
}

/// The table of tables, with the bounds of the features.
fn contents(layer: &Layer<'_>, system: i64) -> Table {
    let name = layer.name;
    let bounds = layer.features.iter().filter_map(|feature| feature.bounds).reduce(around);
    let bounds = bounds.map_or(vec![Value::Null; 4], |b| b.into_iter().map(Value::Real).collect());
    let mut values = vec![text(name), text("features"), text(name), text(""), text("1970-01-01T00:00:00.000Z")];
    values.extend(bounds);
    values.push(Value::Integer(system));
    let columns = "table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE, \
                   description TEXT DEFAULT '', \
                   last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')), min_x DOUBLE, \
                   min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER, \
                   CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id)";
    Table { keys: vec![vec![0], vec![2]], ..table("gpkg_contents", columns, vec![Row { id: 1, values }]) }
}

/// The table that says which column has the geometries.
fn geometry_columns(layer: &Layer<'_>, system: i64) -> Table {
    let [system, heights, none] = [system, layer.heights.into(), 0].map(Value::Integer);
    let values = vec![text(layer.name), text("geom"), text(layer.kind), system, heights, none];
    let columns = "table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, \
                   srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL, \
                   CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), \
                   CONSTRAINT uk_gc_table_name UNIQUE (table_name), \
                   CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name), \
                   CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id)";
    Table { keys: vec![vec![0, 1], vec![0]], ..table("gpkg_geometry_columns", columns, vec![Row { id: 1, values }]) }
}

/// A column of properties.
struct Property {
    name: String,
    kind: &'static str,
}

/// The properties of all features: whole numbers, other numbers, or text.
fn columns(features: &[Feature<'_>]) -> Vec<Property> {
    let mut columns: Vec<Property> = Vec::new();
    for (name, value) in features.iter().flat_map(|feature| feature.properties) {
        let kind = match value {
            Json::Null => "",
            Json::Number(number) if number.is_i64() => "INTEGER",
            Json::Number(_) => "DOUBLE",
            _ => "TEXT",
        };
        let own = ["fid", "geom"].contains(&name.to_ascii_lowercase().as_str());
        match columns.iter_mut().find(|column| column.name.eq_ignore_ascii_case(name)) {
            Some(known) => known.kind = wider(known.kind, kind),
            None if own => {}
            None => columns.push(Property { name: name.clone(), kind }),
        }
    }
    columns.iter_mut().filter(|column| column.kind.is_empty()).for_each(|column| column.kind = "TEXT");
    columns
}

/// The type that holds values of both types.
fn wider(a: &'static str, b: &'static str) -> &'static str {
    match (a, b) {
        (kind, "") | ("", kind) => kind,
        (a, b) if a == b => a,
        ("TEXT", _) | (_, "TEXT") => "TEXT",
        _ => "DOUBLE",
    }
}

/// The table of the features.
fn features(layer: &Layer<'_>, columns: &[Property], system: i64) -> Table {
    let mut sql = format!("fid INTEGER PRIMARY KEY NOT NULL, geom {}", layer.kind);
    columns.iter().for_each(|column| sql += &format!(", {} {}", quoted(&column.name), column.kind));
    let row = |(feature, id): (&Feature<'_>, i64)| {
        let of = |column: &Property| value(feature.properties.get(&column.name), column.kind);
        let geometry = Value::Blob(binary(feature, system));
        Row { id, values: [Value::Null, geometry].into_iter().chain(columns.iter().map(of)).collect() }
    };
    table(layer.name, &sql, layer.features.iter().zip(1..).map(row).collect())
}

fn value(json: Option<&Json>, kind: &str) -> Value {
    match (json, kind) {
        (None | Some(Json::Null), _) => Value::Null,
        (Some(Json::String(text)), _) => Value::Text(text.clone()),
        (Some(json), "INTEGER") => json.as_i64().map_or(Value::Null, Value::Integer),
        (Some(json), "DOUBLE") => json.as_f64().map_or(Value::Null, Value::Real),
        (Some(json), _) => Value::Text(json.to_string()),
    }
}

/// A geometry as GeoPackage binary: a header with its bounds, then well-known binary, both little-endian.
fn binary(feature: &Feature<'_>, system: i64) -> Vec<u8> {
    let mut bytes = b"GP\0\x03".to_vec();
    bytes.extend((system as i32).to_le_bytes());
    let [low_x, low_y, high_x, high_y] = feature.bounds.unwrap_or([f64::NAN; 4]);
    [low_x, high_x, low_y, high_y].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes.extend(&feature.shape);
    bytes
}

/// A polygon as well-known binary.
fn polygon(rings: &[Vec<[f64; 2]>]) -> Vec<u8> {
    let mut bytes = vec![1];
    bytes.extend(3u32.to_le_bytes());
    bytes.extend((rings.len() as u32).to_le_bytes());
    for ring in rings {
        bytes.extend((ring.len() as u32 + 1).to_le_bytes());
        ring.iter().chain(ring.first()).flatten().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// Lowest and highest x and y: `[min x, min y, max x, max y]`.
pub(in crate::io) fn bounds<'a, const N: usize>(corners: impl Iterator<Item = &'a [f64; N]>) -> Option<[f64; 4]> {
    corners.map(|at| [at[0], at[1], at[0], at[1]]).reduce(around)
}

fn around(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

fn table(name: &str, columns: &str, rows: Vec<Row>) -> Table {
    let sql = format!("CREATE TABLE {} ({columns})", quoted(name));
    Table { name: name.into(), sql, rows, keys: Vec::new() }
}

fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}

fn text(text: &str) -> Value {
    Value::Text(text.into())
}
