//! Lines of files: GeoJSON, and OBJ.

use crate::error::{Error, Result};
use crate::io::format::extension;
use crate::io::open;
use serde_json::Value;
use std::path::Path;

/// Bytes of a file, at most.
const MOST: u64 = 1 << 30;

/// The lines of a GeoJSON file (`LineString` and `MultiLineString` with heights) or of an OBJ file (elements `l`).
///
/// # Errors
/// If the extension is neither `.geojson`, `.json` nor `.obj`, the file is damaged, a line has no heights, or there is no
/// line.
pub fn read_lines(path: &Path) -> Result<Vec<Vec<[f64; 3]>>> {
    let text = open::text(path, MOST)?;
    let lines = match extension(path).as_str() {
        "geojson" | "json" => of_geojson(&text),
        "obj" => of_obj(&text),
        _ => Err("lines are read from GeoJSON (.geojson) and OBJ (.obj)".into()),
    };
    let refused = |reason: String| Error::Unsupported { path: path.to_path_buf(), reason };
    let lines = lines.map_err(refused)?;
    match lines.is_empty() {
        true => Err(refused("there is no line in it".into())),
        false => Ok(lines),
    }
}

fn of_geojson(text: &str) -> std::result::Result<Vec<Vec<[f64; 3]>>, String> {
    let file: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let features = file["features"].as_array().ok_or("it is no collection of features")?;
    let mut lines = Vec::new();
    for (number, feature) in features.iter().enumerate() {
        let (kind, all) = (&feature["geometry"]["type"], &feature["geometry"]["coordinates"]);
        match kind.as_str() {
            Some("LineString") => lines.push(line_of(all, number)?),
            Some("MultiLineString") => {
                for part in all.as_array().into_iter().flatten() {
                    lines.push(line_of(part, number)?);
                }
            }
            _ => {}
        }
    }
    Ok(lines)
}

fn line_of(coordinates: &Value, feature: usize) -> std::result::Result<Vec<[f64; 3]>, String> {
    let wrong =
        || format!("feature {feature}: found a line without three finite coordinates a vertex, and two vertices");
    let place = |at: &Value| -> Option<[f64; 3]> { Some([at[0].as_f64()?, at[1].as_f64()?, at[2].as_f64()?]) };
    let line: Option<Vec<[f64; 3]>> = coordinates.as_array().ok_or_else(wrong)?.iter().map(place).collect();
    line.filter(|line| line.len() > 1).ok_or_else(wrong)
}

fn of_obj(text: &str) -> std::result::Result<Vec<Vec<[f64; 3]>>, String> {
    let (mut vertices, mut lines): (Vec<[f64; 3]>, Vec<Vec<[f64; 3]>>) = (Vec::new(), Vec::new());
    for (number, row) in text.lines().enumerate() {
        let wrong = || format!("line {}: found {row:?}", number + 1);
        let mut words = row.split_whitespace();
        match words.next() {
            Some("v") => {
                let all: Vec<f64> = words.take(3).filter_map(|word| word.parse().ok()).collect();
                let place = <[f64; 3]>::try_from(all).ok().filter(|at| at.iter().all(|v| v.is_finite()));
                vertices.push(place.ok_or_else(wrong)?);
            }
            Some("l") => {
                let vertex = |word: &str| -> Option<[f64; 3]> {
                    let at: i64 = word.split('/').next()?.parse().ok()?;
                    let place = if at < 0 { vertices.len() as i64 + at } else { at - 1 };
                    vertices.get(usize::try_from(place).ok()?).copied()
                };
                let line: Option<Vec<[f64; 3]>> = words.map(vertex).collect();
                lines.push(line.filter(|line| line.len() > 1).ok_or_else(wrong)?);
            }
            _ => {}
        }
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Drawing, DrawnLine, write_drawing};
    use crate::parallel::Monitor;

    #[test]
    fn lines_that_were_written_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let line = |vertices: Vec<[f64; 3]>| DrawnLine { vertices, layer: "a".into(), ..DrawnLine::default() };
        let lines =
            vec![line(vec![[0.0; 3], [1.0, 2.0, 3.5]]), line(vec![[5.0, 5.0, 5.0], [6.0, 5.0, 5.0], [7.0, 6.0, 5.0]])];
        let drawing = Drawing { lines, ..Drawing::default() };
        for name in ["a.geojson", "a.obj"] {
            let path = folder.path().join(name);
            write_drawing(&path, &drawing, &Monitor::default()).unwrap();
            let expected: Vec<Vec<[f64; 3]>> = drawing.lines.iter().map(|line| line.vertices.clone()).collect();
            assert_eq!(read_lines(&path).unwrap(), expected, "{name}");
        }
    }

    #[test]
    fn damaged_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let message = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            read_lines(&path).unwrap_err().to_string()
        };
        assert!(message("a.dxf", "").contains("GeoJSON"));
        assert!(message("a.json", "{}").contains("collection"));
        assert!(message("b.json", "{\"features\": []}").contains("no line"));
        let flat = r#"{"features": [{"geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}}]}"#;
        assert!(message("c.json", flat).contains("feature 0"));
        assert!(message("a.obj", "v 0 0 0\nl 1 2\n").contains("line 2"));
        assert!(message("b.obj", "v 0 x 0\n").contains("line 1"));
    }
}
