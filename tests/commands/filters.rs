//! The command `filter`: what is kept of files, marks, tables, and what it refuses.

use scansion_core::Cloud;
use scansion_core::cloud::{Column, Values, names};
use scansion_core::io::{self, Selection, inspect};
use scansion_tests::street;
use std::path::Path;

scansion_tests::program!(scansion, done, fails);

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A street in UTM with classes 2, 5 and 6, an extra dimension, and three birds above it (the last three points).
fn scan() -> Cloud {
    let cloud = street(40.0, 3);
    let mut rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i)).collect();
    rows.extend([[5.0, 5.0, 40.0], [20.0, 30.0, 45.0], [35.0, 10.0, 50.0]]);
    let moved: Vec<[f64; 3]> = rows.iter().map(|p| [p[0] + 500_000.0, p[1] + 5_000_000.0, p[2] + 100.0]).collect();
    let mut moved = Cloud::from_rows(&moved).unwrap();
    let codes = &cloud.column(names::CLASSIFICATION).unwrap().values;
    let codes = (0..moved.len()).map(|i| if i < cloud.len() { codes.get(i) as u8 } else { 1 }).collect();
    moved.set_column(Column::new(names::CLASSIFICATION, Values::U8(codes))).unwrap();
    moved.set_column(Column::new("Own", Values::F64((0..moved.len()).map(|i| i as f64 * 0.1).collect()))).unwrap();
    moved.crs = Some("EPSG:25832".into());
    moved
}

/// Writes the points of a file that have this truth with the core, for comparison.
fn write_kept(from: &Path, to: &Path, keep: impl Fn(usize) -> bool) {
    let points = inspect(from).unwrap().points as usize;
    let kept: Vec<bool> = (0..points).map(keep).collect();
    io::select(from, to, &Selection { kept: Some(&kept), edits: &[] }, &Default::default()).unwrap();
}

#[test]
fn noise_is_removed_or_marked_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = scan();
    let birds = cloud.len() - 3;
    io::write(&f.join("a.laz"), &cloud, &Default::default()).unwrap();
    write_kept(&f.join("a.laz"), &f.join("expected.laz"), |i| i < birds);
    let arguments = ["filter", "a.laz", "--outliers", "statistical,radius", "--multiplier", "20"];
    let table = done(f, &[&arguments[..], &["-o", "one.laz", "-j", "1"]].concat());
    done(f, &[&arguments[..], &["-o", "four.laz", "-j", "4"]].concat());
    let bytes = |name: &str| std::fs::read(f.join(name)).unwrap();
    assert!(bytes("one.laz") == bytes("expected.laz") && bytes("one.laz") == bytes("four.laz"));
    assert!(table.contains("statistical outliers") && table.contains("radius outliers"), "{table}");
    let report = done(f, &[&arguments[..], &["--mark", "-o", "marked.laz", "--format", "json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let marks: u64 = report["steps"].as_array().unwrap().iter().map(|step| step["marked"].as_u64().unwrap()).sum();
    assert_eq!((marks, report["kept"].as_u64().unwrap()), (3, cloud.len() as u64), "{report}");
    let diff = text(&scansion(f, &["diff", "a.laz", "marked.laz"]).stdout);
    assert!(diff.starts_with("only Classification in 3 points"), "{diff}");
    let read = io::read(&f.join("marked.laz")).unwrap();
    let codes = &read.column(names::CLASSIFICATION).unwrap().values;
    assert!((birds..cloud.len()).all(|i| codes.get(i) == 7.0));
}

#[test]
fn classes_heights_boxes_and_polygons_are_kept_with_all_their_fields() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = scan();
    io::write(&f.join("a.laz"), &cloud, &Default::default()).unwrap();
    let place = |i: usize| [0, 1].map(|a| cloud.xyz(i)[a] - [500_000.0, 5_000_000.0][a]);
    let code = |i: usize| cloud.column(names::CLASSIFICATION).unwrap().values.get(i) as u8;
    let square = "POLYGON ((500010 5000010, 500030 5000010, 500030 5000030, 500010 5000030))";
    let file = r#"{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates":
        [[[500010, 5000010], [500030, 5000010], [500030, 5000030], [500010, 5000030], [500010, 5000010]]]}}"#;
    std::fs::write(f.join("square.geojson"), file).unwrap();
    let inside = |i: usize| place(i).iter().all(|v| (10.0..30.0).contains(v));
    type Keep<'a> = &'a dyn Fn(usize) -> bool;
    let runs: [(&[&str], Keep<'_>); 7] = [
        (&["--classes", "2,6"], &|i| [2, 6].contains(&code(i))),
        (&["--drop-classes", "2,1"], &|i| ![2, 1].contains(&code(i))),
        (&["--polygon", square], &inside),
        (&["--polygon", "square.geojson"], &inside),
        (&["--polygon", "square.geojson", "--outside", "--classes", "6"], &|i| !inside(i) && code(i) == 6),
        (&["--bounds", "500000,5000000,500015,5000040"], &|i| place(i)[0] <= 15.0),
        (&["--height", "30.."], &|i| code(i) == 1),
    ];
    for (arguments, keep) in runs {
        done(f, &[&["filter", "a.laz", "-o", "b.laz"], arguments].concat());
        write_kept(&f.join("a.laz"), &f.join("expected.laz"), keep);
        let bytes = |name: &str| std::fs::read(f.join(name)).unwrap();
        assert!(bytes("b.laz") == bytes("expected.laz"), "{arguments:?}");
    }
    done(f, &["height", "a.laz", "-o", "h.laz"]);
    let from = |input: &str| done(f, &["filter", input, "-o", "c.laz", "--height=-1..3.5", "--format", "csv"]);
    assert_eq!(from("a.laz"), from("h.laz"));
    let printed = text(&scansion(f, &["filter", "h.laz", "-o", "d.laz", "--height", "2.."]).stderr);
    assert!(printed.contains("dimension HeightAboveGround"), "{printed}");
}

#[test]
fn other_formats_keep_their_columns() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = scan();
    let codes: Vec<i32> = (0..cloud.len() as i32).map(|i| if i % 2 == 0 { -1 } else { 1000 + i }).collect();
    cloud.set_column(Column::new(names::CLASSIFICATION, Values::I32(codes.clone()))).unwrap();
    io::write(&f.join("a.ply"), &cloud, &Default::default()).unwrap();
    done(f, &["filter", "a.ply", "-o", "b.ply", "--outliers", "radius", "--mark"]);
    let read = io::read(&f.join("b.ply")).unwrap();
    let found = &read.column(names::CLASSIFICATION).unwrap().values;
    let birds = cloud.len() - 3;
    assert!(
        (0..birds).all(|i| found.get(i) == f64::from(codes[i])) && (birds..cloud.len()).all(|i| found.get(i) == 7.0)
    );
    done(f, &["filter", "a.ply", "-o", "b.npz", "--outliers", "radius"]);
    assert_eq!(
        io::read(&f.join("b.npz")).unwrap().column("Own").unwrap().values.get(birds - 1),
        (birds - 1) as f64 * 0.1
    );
}

#[test]
fn a_file_without_points_is_written_and_said_to_be_so() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &scan(), &Default::default()).unwrap();
    let output = scansion(f, &["filter", "a.laz", "-o", "none.laz", "--polygon", "POLYGON((9 45, 10 45, 10 46))"]);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("no point is left") && stderr.contains("reference system"), "{stderr}");
    assert!(io::read(&f.join("none.laz")).unwrap().is_empty());
    let all = ["--classes", "2", "--outliers", "statistical,radius", "--height", "2.."];
    let again = scansion(f, &[&["filter", "none.laz", "-o", "again.laz"], &all[..]].concat());
    assert_eq!(again.status.code(), Some(0), "{}", text(&again.stderr));
    assert!(io::read(&f.join("again.laz")).unwrap().is_empty());
}

#[test]
fn what_cannot_be_filtered_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &scan(), &Default::default()).unwrap();
    let mut degrees = Cloud::from_rows(&[[2.35, 48.85, 30.0], [2.36, 48.86, 31.0]]).unwrap();
    degrees.crs = Some("EPSG:4326".into());
    io::write(&f.join("d.ply"), &degrees, &Default::default()).unwrap();
    io::write(&f.join("d.laz"), &degrees, &Default::default()).unwrap();
    std::fs::write(f.join("line.json"), r#"{"type": "LineString", "coordinates": [[0, 0], [1, 1]]}"#).unwrap();
    let mine =
        r#"{"type": "Polygon", "crs": {"properties": {"name": "EPSG:2154"}}, "coordinates": [[[0,0],[1,0],[1,1]]]}"#;
    std::fs::write(f.join("2154.json"), mine).unwrap();
    let filter =
        |rest: &[&'static str], code: i32| fails(f, &[&["filter", "a.laz", "-o", "b.laz"], rest].concat(), code);
    for (rest, code, said) in [
        (&[][..], 2, "nothing to do"),
        (&["--outliers", "magic"], 2, "magic"),
        (&["--outliers", "radius", "--multiplier", "3"], 2, "statistical"),
        (&["--outliers", "radius", "--radius", "0"], 2, "radius"),
        (&["--outliers", "statistical", "--neighbours", "0"], 2, "neighbours"),
        (&["--mark", "--classes", "2"], 2, "--outliers"),
        (&["--classes", "2,6", "--drop-classes", "6"], 2, "drop_classes"),
        (&["--height", "5..2"], 2, "height"),
        (&["--outside", "--classes", "2"], 2, "--polygon"),
        (&["--bounds", "1,2,3"], 2, "3 numbers"),
        (&["--polygon", "absent.geojson"], 4, "absent.geojson"),
        (&["--polygon", "line.json"], 4, "polygons only"),
        (&["--polygon", "2154.json"], 4, "EPSG:25832"),
        (&["--polygon", "POLYGON ((0 0, 1 1))"], 4, "2 corners"),
        (&["--classes", "2", "--scale", "0.1"], 2, "scale"),
    ] {
        let message = filter(rest, code);
        assert!(message.contains(said), "{rest:?}: {message}");
        assert!(!f.join("b.laz").exists(), "{rest:?}");
    }
    assert!(fails(f, &["filter", "d.laz", "-o", "x.laz", "--outliers", "radius"], 4).contains("degrees"));
    assert!(fails(f, &["filter", "d.ply", "-o", "x.ply", "--classes", "2"], 4).contains("no classes"));
    done(f, &["filter", "d.laz", "-o", "x.laz", "--bounds", "2,48,2.355,49"]);
    assert!(fails(f, &["filter", "a.laz", "-o", "a.laz", "--classes", "2"], 2).contains("--overwrite"));
    std::fs::write(f.join("a.txt"), "POLYGON ((0 0, 1 0, 1 1))").unwrap();
    assert!(fails(f, &["filter", "a.laz", "-o", "a.txt", "--polygon", "a.txt"], 2).contains("--overwrite"));
    done(f, &["filter", "a.laz", "-o", "a.laz", "--classes", "2", "--overwrite"]);
}
