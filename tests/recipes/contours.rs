//! The command `contours`: files, classes, training on lines, and what it refuses.

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io;
use scansion_core::parallel::Monitor;
use scansion_core::synthetic::{SceneKind, SceneParams, scene};
use std::path::Path;

scansion_tests::program!(done, fails);

/// A synthetic room with its classes, and its true edges as an OBJ file.
fn room(folder: &Path) {
    let params = SceneParams { seed: 5, rays: 40_000, ..SceneParams::of(SceneKind::Indoor) };
    let made = scene(&params, &Monitor::default()).unwrap();
    let rows: Vec<[f64; 3]> = made.positions.iter().map(|at| at.map(f64::from)).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(made.codes))).unwrap();
    cloud.crs = Some("EPSG:25832".into());
    io::write(&folder.join("room.laz"), &cloud, &Default::default()).unwrap();
    let mut text = String::new();
    for (number, [a, b]) in made.edges.iter().enumerate() {
        for [x, y, z] in [a, b] {
            text += &format!("v {x} {y} {z}\n");
        }
        text += &format!("l {} {}\n", 2 * number + 1, 2 * number + 2);
    }
    std::fs::write(folder.join("edges.obj"), text).unwrap();
}

#[test]
fn a_room_is_drawn_in_all_formats_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    room(f);
    for name in ["a.dxf", "a.gpkg", "a.geojson", "a.obj", "a.ply"] {
        let table = done(f, &["contours", "room.laz", "-o", name]);
        assert!(table.contains("layer") && table.contains("candidates"), "{table}");
    }
    let lines = io::read_lines(&f.join("a.geojson")).unwrap();
    assert!(lines.len() > 30, "{}", lines.len());
    assert_eq!(io::read_lines(&f.join("a.obj")).unwrap().len(), lines.len());
    done(f, &["contours", "room.laz", "-o", "one.geojson", "-j", "1"]);
    done(f, &["contours", "room.laz", "-o", "three.geojson", "-j", "3"]);
    let read = |name: &str| std::fs::read(f.join(name)).unwrap();
    assert!(read("one.geojson") == read("a.geojson") && read("three.geojson") == read("a.geojson"));
    let text = String::from_utf8(read("a.geojson")).unwrap();
    assert!(text.contains("EPSG::25832") && text.contains("\"confidence\"") && text.contains("class_a"));
}

#[test]
fn lines_can_be_left_out_and_a_model_learns_from_lines() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    room(f);
    let count = |arguments: &[&str]| {
        let all = [&["contours", "room.laz", "--format", "json", "--overwrite", "-o", "a.ply"], arguments].concat();
        let report: serde_json::Value = serde_json::from_str(&done(f, &all)).unwrap();
        report["lines"].as_array().unwrap().len()
    };
    let all = count(&[]);
    assert!(count(&["--min-confidence", "0.9"]) < all);
    assert!(count(&["--without", "2,6"]) < all);
    assert!(count(&["--set", "trace.tidy.least_length=1"]) < all);
    let small = ["--set", "forest.trees=4", "--set", "candidate_forest.trees=4", "--set", "training.max_samples=4000"];
    let train = ["train", "room.laz", "--recipe", "contours", "--edges", "edges.obj", "-o", "own.model"];
    let table = done(f, &[&train[..], &small, &["--set", "boosting.rounds=5"]].concat());
    assert!(table.contains("contour") && table.contains("candidates") && table.contains(" and "), "{table}");
    assert!(count(&["-m", "own.model"]) > 10);
    done(f, &["classify", "room.laz", "-m", "own.model", "-o", "named.laz"]);
}

#[test]
fn training_takes_any_code_and_unit_and_refuses_lines_that_lie_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    room(f);
    let small = ["--set", "forest.trees=4", "--set", "candidate_forest.trees=4", "--set", "training.max_samples=4000"];
    let train = ["train", "room.laz", "--recipe", "contours", "--edges", "edges.obj", "-o", "own.model", "--overwrite"];
    for own in ["code=5", "code=0", "features.metres_per_unit=0.3048"] {
        let table = done(f, &[&train[..], &small, &["--set", own]].concat());
        assert!(table.contains("contour") && table.contains("candidates"), "{own}: {table}");
    }
    // With synthetic scenes, which are in metres, in addition to a cloud in feet.
    let more = ["--synthetic", "1", "--set", "features.metres_per_unit=0.3048"];
    assert!(done(f, &[&train[..], &small, &more].concat()).contains("candidates"));
    let lines = std::fs::read_to_string(f.join("edges.obj")).unwrap();
    let far: Vec<String> = lines
        .lines()
        .map(|row| match row.strip_prefix("v ") {
            Some(rest) => {
                let at: Vec<f64> = rest.split(' ').map(|v| v.parse().unwrap()).collect();
                format!("v {} {} {}", at[0] + 4e5, at[1] + 5e6, at[2])
            }
            None => row.to_string(),
        })
        .collect();
    std::fs::write(f.join("edges.obj"), far.join("\n")).unwrap();
    assert!(fails(f, &[&train[..], &small].concat(), 4).contains("reference system"));
}

#[test]
fn lines_are_drawn_over_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    room(f);
    done(f, &["render", "room.laz", "-o", "without.png", "--view", "oblique"]);
    done(f, &["render", "room.laz", "-o", "with.png", "--view", "oblique", "--contours", "edges.obj"]);
    let read = |name: &str| std::fs::read(f.join(name)).unwrap();
    assert!(read("with.png") != read("without.png"));
    assert!(fails(f, &["render", "room.laz", "-o", "a.png", "--contours", "absent.obj"], 4).contains("absent.obj"));
    std::fs::write(f.join("far.obj"), "v 900 900 900\nv 901 900 900\nl 1 2\n").unwrap();
    assert!(fails(f, &["render", "room.laz", "-o", "a.png", "--contours", "far.obj"], 4).contains("picture"));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    room(f);
    assert!(fails(f, &["contours", "room.laz", "-o", "a.dwg"], 2).contains("dxf"));
    assert!(fails(f, &["contours", "absent.laz", "-o", "a.dxf"], 4).contains("absent.laz"));
    assert!(fails(f, &["contours", "room.laz", "-o", "a.dxf", "--min-confidence", "2"], 2).contains("0 to 1"));
    assert!(fails(f, &["contours", "room.laz", "-o", "a.dxf", "--voxel", "0"], 2).contains("voxel"));
    assert!(fails(f, &["train", "room.laz", "--edges", "edges.obj", "-o", "m"], 2).contains("contours"));
    let train =
        ["train", "room.laz", "--recipe", "contours", "-o", "m", "--edges", "edges.obj", "--edges", "edges.obj"];
    assert!(fails(f, &train, 2).contains("one each"));
    let mut empty = Cloud::from_rows(&[]).unwrap();
    empty.set_column(Column::new("Classification", Values::U8(vec![]))).unwrap();
    io::write(&f.join("empty.las"), &empty, &Default::default()).unwrap();
    assert!(fails(f, &["contours", "empty.las", "-o", "a.dxf"], 4).contains("no point"));
}

#[test]
fn points_without_a_class_are_not_those_of_class_0() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    room(f);
    let mut cloud = io::read(&f.join("room.laz")).unwrap();
    let values = &cloud.column("Classification").unwrap().values;
    let first = values.get(0);
    let open = |i: usize| if values.get(i) == first { -1 } else { values.get(i).max(1.0) as i16 };
    let codes = Values::I16((0..cloud.len()).map(open).collect());
    cloud.set_column(Column::new("Classification", codes)).unwrap();
    io::write(&f.join("open.ply"), &cloud, &Default::default()).unwrap();
    let table = done(f, &["contours", "open.ply", "-o", "all.geojson"]);
    assert!(!table.contains("class 0"), "{table}");
    done(f, &["contours", "open.ply", "-o", "without.geojson", "--without", "0"]);
    let read = |name: &str| std::fs::read_to_string(f.join(name)).unwrap();
    assert!(read("all.geojson") == read("without.geojson") && read("all.geojson").contains("LineString"));
}
