//! The command `normals`: values, what it keeps, stray points, units, and what it refuses.

use scansion_core::Cloud;
use scansion_core::cloud::{Column, Points, Values, names};
use scansion_core::graph::{NormalParams, Orientation};
use scansion_core::io;
use scansion_core::parallel::Monitor;
use scansion_tests::street;
use std::path::Path;

scansion_tests::program!(scansion, done, fails);

/// The normals in a file, one a point.
fn normals(path: &Path) -> Vec<[f64; 3]> {
    let cloud = io::read(path).unwrap();
    let axes = names::NORMAL.map(|name| {
        let values = &cloud.column(name).unwrap().values;
        assert_eq!(values.type_name(), "f4");
        values.to_f64()
    });
    (0..cloud.len()).map(|i| [0, 1, 2].map(|a| axes[a][i])).collect()
}

/// The plane z = 0.5 x - 0.25 y in UTM, every half metre, with classes.
fn plane() -> Cloud {
    let rows: Vec<[f64; 3]> = (0..900)
        .map(|i| [f64::from(i % 30) * 0.5, f64::from(i / 30) * 0.5])
        .map(|[x, y]| [500_000.0 + x, 5_000_000.0 + y, 100.0 + 0.5 * x - 0.25 * y])
        .collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud
        .set_column(Column::new(names::CLASSIFICATION, Values::U8((0..900).map(|i| (i % 7) as u8).collect())))
        .unwrap();
    cloud.crs = Some("EPSG:25832".into());
    cloud
}

/// The unit normal of that plane: (-dz/dx, -dz/dy, 1) / length.
fn upward() -> [f64; 3] {
    let length = (0.25f64 + 0.0625 + 1.0).sqrt();
    [-0.5 / length, 0.25 / length, 1.0 / length]
}

fn all_are(found: &[[f64; 3]], expected: [f64; 3]) {
    for (i, normal) in found.iter().enumerate() {
        assert!((0..3).all(|a| (normal[a] - expected[a]).abs() < 2e-3), "{i}: {normal:?}, not {expected:?}");
    }
}

#[test]
fn a_tilted_plane_has_the_normal_of_its_equation() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &plane(), &Default::default()).unwrap();
    done(f, &["normals", "a.laz", "-o", "n.laz"]);
    all_are(&normals(&f.join("n.laz")), upward());
    // From a sensor below, the other side is seen.
    let below = ["--orientation", "500007,5000007,-900", "--neighbours", "6"];
    done(f, &[&["normals", "a.laz", "-o", "b.ply"], &below[..]].concat());
    all_are(&normals(&f.join("b.ply")), upward().map(|part| -part));
    done(f, &["normals", "a.laz", "-o", "s.npz", "--orientation", "spanning-tree", "--neighbours", "32"]);
    all_are(&normals(&f.join("s.npz")), upward());
}

#[test]
fn normals_are_those_of_the_core_and_nothing_else_changes() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(20.0, 3);
    cloud.set_column(Column::new("Own", Values::F64((0..cloud.len()).map(|i| i as f64 * 0.1).collect()))).unwrap();
    io::write(&f.join("a.laz"), &cloud, &Default::default()).unwrap();
    let before = io::read(&f.join("a.laz")).unwrap();
    let points = Points::from_cloud(&before, 1.0);
    for (word, orientation) in [
        ("up", Orientation::Up),
        ("spanning-tree", Orientation::SpanningTree),
        ("-5,2.5,30", Orientation::Sensor([-5.0, 2.5, 30.0])),
    ] {
        let params = NormalParams { neighbours: 9, orientation };
        let expected = params.find(&points, &Monitor::default()).unwrap().directions;
        let expected: Vec<[f64; 3]> = expected.iter().map(|normal| normal.map(f64::from)).collect();
        for [name, threads] in [["one.laz", "1"], ["three.laz", "3"]] {
            done(f, &["normals", "a.laz", "-o", name, "--neighbours", "9", "--orientation", word, "-j", threads]);
            assert!(normals(&f.join(name)) == expected, "{word}");
        }
        assert!(std::fs::read(f.join("one.laz")).unwrap() == std::fs::read(f.join("three.laz")).unwrap());
    }
    let after = io::read(&f.join("one.laz")).unwrap();
    assert_eq!((after.len(), after.columns().len()), (before.len(), before.columns().len() + 3));
    assert!(before.columns().iter().all(|column| after.column(&column.name) == Some(column)));
    assert!((0..before.len()).all(|i| before.xyz(i) == after.xyz(i)));
    let diff = String::from_utf8(scansion(f, &["diff", "a.laz", "one.laz"]).stdout).unwrap();
    assert!(diff.contains("only in the second: NormalX NormalY NormalZ\n") && diff.lines().count() == 4, "{diff}");
    // Normals that are there are replaced, also in the file itself.
    assert!(fails(f, &["normals", "a.laz", "-o", "a.laz"], 2).contains("--overwrite"));
    done(f, &["normals", "a.laz", "-o", "a.laz", "--overwrite"]);
    done(f, &["normals", "one.laz", "-o", "again.laz"]);
    assert!(normals(&f.join("a.laz")) == normals(&f.join("again.laz")));
}

#[test]
fn stray_points_are_set_aside_and_points_without_place_have_no_normal() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = plane();
    let rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i)).collect();
    let strayed = Cloud::from_rows(&[&rows[..], &[[0.0; 3]]].concat()).unwrap();
    io::write(&f.join("clean.laz"), &cloud, &Default::default()).unwrap();
    io::write(&f.join("a.laz"), &strayed, &Default::default()).unwrap();
    done(f, &["normals", "clean.laz", "-o", "c.laz"]);
    let run = scansion(f, &["normals", "a.laz", "-o", "n.laz"]);
    let told = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success() && told.contains("number 900") && told.contains("set aside"), "{told}");
    let found = normals(&f.join("n.laz"));
    assert!(found[..900] == normals(&f.join("c.laz"))[..]);
    assert!(found.len() == 901 && found[900].iter().all(|part| part.is_nan()), "{:?}", found.last());
    std::fs::write(f.join("nan.xyz"), "0 0 0\n1 0 0\nnan 0 0\n0 1 0\n1 1 0\n").unwrap();
    done(f, &["normals", "nan.xyz", "-o", "nan.ply"]);
    let found = normals(&f.join("nan.ply"));
    assert!(found[2].iter().all(|part| part.is_nan()) && found[3] == [0.0, 0.0, 1.0], "{found:?}");
}

/// Normals have no unit, but the sensor is in metres.
#[test]
fn a_cloud_in_feet_has_the_normals_of_the_cloud_in_metres() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let rows: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0]).collect();
    io::write(&f.join("a.laz"), &Cloud::from_rows(&rows).unwrap(), &Default::default()).unwrap();
    let level = |height: &str, unit: &str| {
        let sensor = format!("3,3,{height}");
        done(f, &["normals", "a.laz", "-o", "n.laz", "--orientation", &sensor, "--unit", unit]);
        normals(&f.join("n.laz"))
    };
    all_are(&level("1", "feet"), [0.0, 0.0, 1.0]);
    assert!(level("-1", "feet") == level("-1", "metres"));
}

#[test]
fn what_has_no_normals_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &plane(), &Default::default()).unwrap();
    let mut degrees = Cloud::from_rows(&[[2.35, 48.85, 30.0], [2.36, 48.86, 31.0]]).unwrap();
    degrees.crs = Some("EPSG:4326".into());
    io::write(&f.join("degrees.las"), &degrees, &Default::default()).unwrap();
    for (rest, said) in [
        (&["--neighbours", "1"][..], "2..=32"),
        (&["--neighbours", "33"], "2..=32"),
        (&["--neighbours", "many"], "many"),
        (&["--orientation", "down"], "spanning-tree"),
        (&["--orientation", "1,2"], "X,Y,Z"),
        (&["--orientation", "1,2,nan"], "finite"),
        (&["--scale", "1,2"], "scale"),
    ] {
        let message = fails(f, &[&["normals", "a.laz", "-o", "b.laz"], rest].concat(), 2);
        assert!(message.contains(said), "{rest:?}: {message}");
        assert!(!f.join("b.laz").exists(), "{rest:?}");
    }
    assert!(fails(f, &["normals", "degrees.las", "-o", "x.las"], 4).contains("degrees"));
    assert!(fails(f, &["normals", "a.laz", "-o", "x.png"], 2).contains("png"));
    fails(f, &["normals", "absent.laz", "-o", "x.laz"], 4);
    fails(f, &["normals", "a.laz"], 2);
}
