use super::*;

const KINDS: [&str; 6] = ["dxf", "gpkg", "geojson", "json", "obj", "ply"];

fn line(layer: &str, closed: bool) -> DrawnLine {
    let mut properties = Map::new();
    properties.insert("confidence".into(), json!(0.75));
    let vertices = vec![[85_000.5, 446_000.25, 1.0], [85_010.0, 446_000.0, 2.5], [85_010.0, 446_008.0, -3.125]];
    DrawnLine { vertices, layer: layer.into(), closed, colour: [255, 0, 0], properties }
}

fn drawing() -> Drawing {
    let lines = vec![line("roof-wall", false), line("a b", true), line("roof-wall", true), line("a*b", false)];
    Drawing { lines, place: Georeference { crs: Some("EPSG:28992".into()), metres_per_unit: Some(1.0) } }
}

fn written(kind: &str, drawing: &Drawing) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("lines.{kind}"));
    let result = write_drawing(&path, drawing, &Monitor::default());
    assert_eq!(result.is_ok(), path.exists());
    result.map(|()| std::fs::read(&path).unwrap())
}

fn text(kind: &str, drawing: &Drawing) -> String {
    String::from_utf8(written(kind, drawing).unwrap()).unwrap()
}

#[test]
fn dxf_has_pairs_of_lines_with_the_vertices_of_each_polyline() {
    let text = text("dxf", &drawing());
    let rows: Vec<&str> = text.lines().collect();
    let pairs: Vec<(u8, &str)> = rows.chunks(2).map(|pair| (pair[0].trim().parse().unwrap(), pair[1])).collect();
    let count = |wanted: (u8, &str)| pairs.iter().filter(|&&pair| pair == wanted).count();
    assert_eq!(
        [(0, "POLYLINE"), (0, "VERTEX"), (0, "SEQEND"), (0, "SECTION"), (0, "ENDSEC")].map(count),
        [4, 12, 4, 4, 4]
    );
    // The polylines, their vertices and ends, and the table of layers.
    assert_eq!([(8, "ROOF-WALL"), (8, "A_B"), (8, "A_B_2"), (2, "A_B_2"), (2, "0")].map(count), [10, 5, 5, 1, 1]);
    assert_eq!([(70, "9"), (70, "8"), (62, "1"), (30, "-3.125000")].map(count), [2, 2, 7, 5]);
    assert_eq!(pairs.last(), Some(&(0, "EOF")));
}

#[test]
fn obj_closes_lines_and_counts_vertices_through_all_groups() {
    let text = text("obj", &drawing());
    let rows = |start: &str| text.lines().filter(|row| row.starts_with(start)).collect::<Vec<_>>();
    assert_eq!(rows("g "), ["g roof-wall", "g a_b", "g a*b"]);
    assert_eq!(rows("l "), ["l 1 2 3", "l 4 5 6 4", "l 7 8 9 7", "l 10 11 12"]);
    assert_eq!((rows("v ").len(), rows("v ")[0]), (12, "v 85000.500000 446000.250000 1.000000"));
}

#[test]
fn geojson_has_heights_properties_and_the_system() {
    let read: Value = serde_json::from_str(&text("geojson", &drawing())).unwrap();
    assert_eq!(read["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::28992");
    let second = &read["features"][1];
    assert_eq!(second["geometry"]["type"], "LineString");
    assert_eq!(second["geometry"]["coordinates"].as_array().unwrap().len(), 4);
    assert_eq!(second["geometry"]["coordinates"][3], json!([85_000.5, 446_000.25, 1.0]));
    assert_eq!(second["properties"], json!({"layer": "a b", "colour": "#ff0000", "confidence": 0.75}));
}

#[test]
fn ply_has_an_edge_for_each_piece() {
    let bytes = written("ply", &drawing()).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(header.contains("element vertex 12\n") && header.contains("element edge 10\n"), "{header}");
    assert_eq!(bytes.len() - end, 12 * 31 + 10 * 8);
    let [vertex, edges] = [&bytes[end..][..31], &bytes[end + 12 * 31..]];
    assert_eq!(vertex[..8], 85_000.5f64.to_le_bytes());
    assert_eq!((&vertex[24..27], &vertex[27..]), (&[255, 0, 0][..], &0.75f32.to_le_bytes()[..]));
    let ends: Vec<i32> = edges.chunks(4).map(|at| i32::from_le_bytes(at.try_into().unwrap())).collect();
    assert_eq!(ends[..10], [0, 1, 1, 2, 3, 4, 4, 5, 5, 3]);
}

#[test]
fn a_drawing_without_lines_is_a_valid_file() {
    for kind in KINDS {
        assert!(!written(kind, &Drawing::default()).unwrap().is_empty(), "{kind}");
    }
}

#[test]
fn lines_that_cannot_be_drawn_are_refused_with_their_number() {
    let with = |change: fn(&mut DrawnLine)| {
        let mut all = drawing();
        change(&mut all.lines[1]);
        KINDS.map(|kind| written(kind, &all).unwrap_err().to_string())
    };
    assert!(with(|l| l.vertices[2][1] = f64::NAN).iter().all(|m| m.contains("line 1") && m.contains("vertex 2")));
    assert!(with(|l| l.vertices[0][2] = f64::INFINITY).iter().all(|m| m.contains("not finite")));
    assert!(with(|l| l.vertices.truncate(2)).iter().all(|m| m.contains("a closed line has 3")));
    assert!(with(|l| l.vertices.clear()).iter().all(|m| m.contains("0 vertices")));
    for bad in ["shp", "dwg", ""] {
        assert!(written(bad, &drawing()).unwrap_err().to_string().contains(".dxf"), "{bad}");
        assert!(check_drawing_output(Path::new(&format!("lines.{bad}"))).is_err());
    }
}

#[test]
fn what_a_map_does_not_tell_of_heights_and_units_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let warnings = |kind: &str, crs: &str, metres| {
        let monitor = Monitor::default();
        let place = Georeference { crs: Some(crs.into()), metres_per_unit: Some(metres) };
        write_drawing(&folder.path().join(format!("a.{kind}")), &Drawing { place, ..drawing() }, &monitor).unwrap();
        monitor.take_warnings().join("; ")
    };
    for kind in ["gpkg", "geojson"] {
        assert_eq!(warnings(kind, "EPSG:26910", 1.0), "");
        let told = warnings(kind, "EPSG:26910+8228", 1.0);
        assert!(told.ends_with("not kept: the system of heights (EPSG:8228, unit 0.3048 m)"), "{told}");
        let told = warnings(kind, "EPSG:26910", 0.3048);
        assert!(told.ends_with("the unit of 0.3048 m; the file tells a reference system in units of 1 m"), "{told}");
    }
    assert_eq!(warnings("dxf", "EPSG:26910+8228", 0.3048), "");
    // Nothing is written with two systems of heights.
    let place = Georeference { crs: Some("EPSG:7405+5703".into()), metres_per_unit: None };
    for kind in KINDS {
        let path = folder.path().join(format!("b.{kind}"));
        let refused = write_drawing(&path, &Drawing { place: place.clone(), ..drawing() }, &Monitor::default());
        assert!(refused.unwrap_err().to_string().contains("EPSG:27700+5703") && !path.exists());
    }
    let path = folder.path().join("b.gpkg");
    assert!(crate::io::write_outlines(&path, &[], &place, &Monitor::default()).is_err() && !path.exists());
}

#[test]
fn cancelled_work_writes_nothing() {
    let monitor = Monitor::default();
    monitor.cancel();
    let folder = tempfile::tempdir().unwrap();
    for kind in KINDS {
        let path = folder.path().join(format!("lines.{kind}"));
        assert!(matches!(write_drawing(&path, &drawing(), &monitor), Err(Error::Interrupted)));
        assert!(!path.exists());
    }
}
