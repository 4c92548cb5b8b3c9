//! Meaning of labels in files of different schemes, classes that a model learns, and comparison of different codes.

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io;
use scansion_tests::street;
use std::path::Path;
use std::process::{Command, Output};

fn scansion(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_scansion-under-test")).args(arguments).current_dir(folder).output().unwrap()
}

/// Stdout and stderr of a run that succeeds.
fn done(folder: &Path, arguments: &[&str]) -> (String, String) {
    // Tests write the same names again.
    let again: &[&str] = if arguments.contains(&"--overwrite") { &[] } else { &["--overwrite"] };
    let output = scansion(folder, &[arguments, again].concat());
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {err}");
    (out, err)
}

/// Stderr of a run that fails.
fn fails(folder: &Path, arguments: &[&str]) -> String {
    let output = scansion(folder, arguments);
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(matches!(output.status.code(), Some(2 | 4)), "{arguments:?}: {:?} {err}", output.status);
    assert!(err.contains("error"), "{err}");
    err
}

fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

const QUICK: [&str; 6] =
    ["--set", "features.pyramid.first_scale=0.5", "--set", "features.pyramid.levels=3", "--set", "forest.trees=5"];

/// A street whose classes 2, 5, 6 carry other codes.
fn coded(size: f64, seed: u64, codes: [i16; 3]) -> Cloud {
    let mut cloud = street(size, seed);
    let old = cloud.column("Classification").unwrap().values.to_f64();
    let new = old.iter().map(|&c| codes[if c < 3.0 { 0 } else { c as usize - 4 }]).collect();
    cloud.set_column(Column::new("Classification", Values::I16(new))).unwrap();
    cloud
}

/// Writes a cloud; the codes as bytes if none is negative.
fn write(path: &Path, mut cloud: Cloud) {
    let values = cloud.column("Classification").unwrap().values.to_f64();
    if values.iter().all(|&v| v >= 0.0) {
        let codes = Values::U8(values.iter().map(|&v| v as u8).collect());
        cloud.set_column(Column::new("Classification", codes)).unwrap();
    }
    io::write(path, &cloud, &Default::default()).unwrap();
}

/// Semantic3D: `x y z i r g b`, and the labels beside it.
fn write_semantic3d(folder: &Path, name: &str, cloud: &Cloud) {
    let row = |i: usize| {
        let [x, y, z] = cloud.xyz(i);
        format!("{x} {y} {z} -900 10 20 30\n")
    };
    std::fs::write(folder.join(format!("{name}.txt")), (0..cloud.len()).map(row).collect::<String>()).unwrap();
    let codes = cloud.column("Classification").unwrap().values.to_f64();
    let lines: String = codes.iter().map(|c| format!("{c}\n")).collect();
    std::fs::write(folder.join(format!("{name}.labels")), lines).unwrap();
}

/// Codes of the classes that training reports, and the points without a label.
fn learned(folder: &Path, arguments: &[&str]) -> (Vec<u64>, u64) {
    let all = [&["train"], arguments, &["-o", "t.model", "--format", "json"], &QUICK[..]].concat();
    let report = json(&done(folder, &all).0);
    let codes = report["classes"].as_array().unwrap().iter().map(|c| c["code"].as_u64().unwrap()).collect();
    (codes, report["unlabelled"].as_u64().unwrap())
}

/// Points of a cloud with this code.
fn count(cloud: &Cloud, code: f64) -> u64 {
    cloud.column("Classification").unwrap().values.to_f64().iter().filter(|&&c| (c - code).abs() < 0.5).count() as u64
}

#[test]
fn what_is_unlabelled_depends_on_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let scene = coded(14.0, 1, [0, 1, 2]);
    let (zeros, ones, n) = (count(&scene, 0.0), count(&scene, 1.0), scene.len() as u64);
    write_semantic3d(f, "semantic", &scene);
    for name in ["rooms.ply", "rooms.npz", "scan.laz"] {
        write(&f.join(name), scene.clone());
    }
    // Semantic3D: 0 is unlabelled, 1 is man-made terrain.
    assert_eq!(learned(f, &["semantic.txt"]), (vec![1, 2], zeros));
    // S3DIS: 0 is the ceiling, 1 the floor.
    assert_eq!(learned(f, &["rooms.ply"]), (vec![0, 1, 2], 0));
    assert_eq!(learned(f, &["rooms.npz"]), (vec![0, 1, 2], 0));
    // ASPRS: 0 is never classified, 1 unclassified: one class is left, and that is an error.
    let message = fails(f, &["train", "scan.laz", "-o", "one.model"]);
    assert!(
        message.contains("only one class to learn, code 2 (ground)") && message.contains("unlabelled"),
        "{message}"
    );
    assert!(!f.join("scan.model").exists() && !f.join("one.model").exists());
    // An explicit request overrides the default, in all formats.
    assert_eq!(learned(f, &["scan.laz", "--unlabelled", "none"]), (vec![0, 1, 2], 0));
    assert_eq!(learned(f, &["scan.laz", "--unlabelled", "1"]), (vec![0, 2], ones));
    assert_eq!(learned(f, &["rooms.ply", "--unlabelled", "0"]), (vec![1, 2], zeros));
    assert_eq!(learned(f, &["scan.laz", "--classes", "1,2"]), (vec![1, 2], zeros));
    assert!(fails(f, &["train", "scan.laz", "-o", "t.model", "--unlabelled", "nothing"]).contains("nothing"));
    // The program reports it.
    let train = |input| done(f, &[&["train", input, "-o", "t.model", "--unlabelled", "auto"], &QUICK[..]].concat());
    let (table, said) = train("semantic.txt");
    assert!(said.contains("code 0 counts as unlabelled") && said.contains("--unlabelled none"), "{said}");
    assert!(said.contains(&format!("{zeros} of {n} points")), "{said}");
    assert!(table.contains("man-made terrain") && table.contains("natural terrain"), "{table}");
    let (table, said) = train("rooms.ply");
    assert!(said.contains("every code is a class, 0 too") && said.contains("--unlabelled 0"), "{said}");
    assert!(!table.contains("ground") && table.contains("class 2"), "{table}");
}

#[test]
fn negative_values_are_unlabelled_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let scene = coded(14.0, 2, [0, -1, 2]);
    let open = count(&scene, -1.0);
    write(&f.join("a.ply"), scene.clone());
    assert_eq!(learned(f, &["a.ply"]), (vec![0, 2], open));
    let mut other = coded(14.0, 2, [2, 5, 6]);
    other.set_column(Column::new("mine", scene.column("Classification").unwrap().values.clone())).unwrap();
    write(&f.join("a.laz"), other);
    // A dimension other than Classification has codes of its own, in LAS too.
    assert_eq!(learned(f, &["a.laz", "--label-dimension", "mine"]), (vec![0, 2], open));
}

#[test]
fn every_verb_takes_the_same_points_as_labelled() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let scene = coded(20.0, 3, [1, 0, 2]);
    write_semantic3d(f, "s", &scene);
    write(&f.join("s.npz"), scene.clone());
    let (n, zeros) = (scene.len() as u64, count(&scene, 0.0));
    for (file, points) in [("s.txt", n - zeros), ("s.npz", n)] {
        let scores = json(&done(f, &["evaluate", file, file, "--format", "json"]).0);
        let support: u64 = scores["labels"].as_array().unwrap().iter().map(|l| l["support"].as_u64().unwrap()).sum();
        assert_eq!(support, points, "evaluate {file}");
        for recipe in ["pyramid", "weak", "objects"] {
            let quick: &[&str] = if recipe == "pyramid" { &QUICK } else { &["--set", "forest.trees=3"] };
            let all = [&["train", file, "-o", "m.model", "--recipe", recipe, "--format", "json"], quick].concat();
            let report = json(&done(f, &all).0);
            assert_eq!(report["unlabelled"].as_u64(), Some(n - points), "train {recipe} {file}");
        }
        let (_, said) = done(f, &["segment", file, "-o", "o.ply", "--strength", "0.1"]);
        assert!(said.contains(&format!("{} of {n} points are unlabelled", n - points)), "segment {file}: {said}");
    }
    // Folds are squares of 50 m.
    write_semantic3d(f, "wide", &coded(60.0, 3, [1, 0, 2]));
    let (shown, _) = done(f, &[&["train", "wide.txt", "-o", "m.model", "--cross-validate", "2"], &QUICK[..]].concat());
    assert!(shown.contains("2-fold accuracy"), "{shown}");
}

#[test]
fn truth_and_prediction_have_maps_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    // Truth in codes 0, 1, 2; prediction in 2, 5, 6: ten of the ground are called building, five are left open.
    let truth = coded(14.0, 4, [0, 1, 2]);
    let mut named = coded(14.0, 4, [2, 5, 6]);
    let mut codes: Vec<i16> =
        named.column("Classification").unwrap().values.to_f64().iter().map(|&c| c as i16).collect();
    let ground: Vec<usize> = (0..codes.len()).filter(|&i| codes[i] == 2).take(15).collect();
    ground[..10].iter().for_each(|&i| codes[i] = 6);
    ground[10..].iter().for_each(|&i| codes[i] = -1);
    named.set_column(Column::new("Classification", Values::I16(codes))).unwrap();
    let n = truth.len() as f64;
    let by_hand = (n - 15.0) / n;
    write(&f.join("truth.ply"), truth);
    write(&f.join("named.ply"), named);
    let accuracy = |arguments: &[&str]| {
        let all = [&["evaluate", "truth.ply", "named.ply", "--format", "json"], arguments].concat();
        json(&done(f, &all).0)["overall_accuracy"].as_f64().unwrap()
    };
    const MAP: &str = "0=2,1=5,2=6";
    assert!((accuracy(&["--map-truth", MAP]) - by_hand).abs() < 1e-9);
    assert!((accuracy(&["--map-of", "truth.ply:0=2,1=5,2=6"]) - by_hand).abs() < 1e-9);
    assert!((accuracy(&["--map-predicted", "2=0,5=1,6=2"]) - by_hand).abs() < 1e-9);
    assert!((accuracy(&["--map-of", "named.ply:2=0,5=1,6=2"]) - by_hand).abs() < 1e-9);
    // Merged on both sides: the ten errors are between ground and building.
    let both = accuracy(&["--map-truth", "0=1,2=1,1=5", "--map-predicted", "2=1,6=1"]);
    assert!((both - (n - 5.0) / n).abs() < 1e-9, "{both}");
    // The old flag is refused where its meaning is unclear.
    let message = fails(f, &["evaluate", "truth.ply", "named.ply", "--map", MAP]);
    assert!(
        message.contains("--map-truth") && message.contains("--map-predicted") && message.contains("code 2"),
        "{message}"
    );
    assert!((accuracy(&["--map", "0=2,1=5"]) - accuracy(&["--map-truth", "0=2,1=5"])).abs() < 1e-12);
}

#[test]
fn map_of_must_name_one_input_once() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::create_dir(f.join("sub")).unwrap();
    for name in ["a.laz", "b.laz", "sub/a.laz"] {
        write(&f.join(name), coded(20.0, 5, [2, 5, 6]));
    }
    let train =
        |arguments: &[&str]| fails(f, &[&["train", "a.laz", "b.laz", "-o", "m.model"], arguments, &QUICK[..]].concat());
    let message = train(&["--map-of", "c.laz:1=5"]);
    assert!(message.contains("a.laz, b.laz") && message.contains("c.laz:1=5"), "{message}");
    assert!(train(&["--map-of", "a.laz"]).contains("FILE:OLD=NEW"));
    assert!(train(&["--map-of", "a.laz:1=5", "--map-of", "a.laz:2=5"]).contains("one map an input"));
    let message = fails(f, &["evaluate", "a.laz", "sub/a.laz", "--map-of", "a.laz:2=5"]);
    assert!(message.contains("sub/a.laz") && message.contains("folders"), "{message}");
    done(f, &["evaluate", "a.laz", "sub/a.laz", "--map-of", "sub/a.laz:2=5"]);
    let report = json(
        &done(
            f,
            &[&["train", "a.laz", "b.laz", "-o", "m.model", "--map-of", "b.laz:6=9", "--format", "json"], &QUICK[..]]
                .concat(),
        )
        .0,
    );
    let codes: Vec<u64> = report["classes"].as_array().unwrap().iter().map(|c| c["code"].as_u64().unwrap()).collect();
    assert_eq!(codes, [2, 5, 6, 9]);
}

#[test]
fn a_class_that_is_asked_for_and_absent_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    write(&f.join("a.laz"), coded(12.0, 6, [2, 5, 6]));
    let message = fails(f, &[&["train", "a.laz", "-o", "m.model", "--classes", "2,6,17"], &QUICK[..]].concat());
    assert!(message.contains("17") && message.contains("found: 2, 6"), "{message}");
    let (_, said) = done(f, &["evaluate", "a.laz", "a.laz", "--classes", "2,6,17"]);
    assert!(said.contains("warning") && said.contains("17"), "{said}");
    let message = fails(f, &["evaluate", "a.laz", "a.laz", "--classes", "17"]);
    assert!(message.contains("no point to score: all") && message.contains("unlabelled"), "{message}");
    let (table, _) = done(f, &["evaluate", "a.laz", "a.laz", "--classes", "6"]);
    assert!(table.contains("kappa -"), "{table}");
    let (out, _) = done(f, &["evaluate", "a.laz", "a.laz", "--classes", "6", "--format", "json"]);
    assert!(json(&out)["kappa"].is_null(), "{out}");
}

/// A scene with this many points of class 7 at one position above it.
fn with_strays(size: f64, seed: u64, strays: usize) -> Cloud {
    let scene = street(size, seed);
    let mut codes: Vec<u8> = scene.column("Classification").unwrap().values.to_f64().iter().map(|&c| c as u8).collect();
    let mut rows: Vec<[f64; 3]> = (0..scene.len()).map(|i| scene.xyz(i)).collect();
    for i in 0..strays {
        rows.push([3.0 + 0.1 * i as f64, 4.0, 30.0]);
        codes.push(7);
    }
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
    cloud
}

#[test]
fn a_few_stray_points_of_a_class_do_not_throttle_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    write(&f.join("other.laz"), street(30.0, 9));
    for strays in [0, 1, 12] {
        write(&f.join("in.laz"), with_strays(60.0, 8, strays));
        let train = |more: &[&str]| {
            let all = [&["train", "in.laz", "-o", "m.model", "--format", "json"], more, &QUICK[..]].concat();
            let (out, err) = done(f, &all);
            let samples = |code: u64| {
                let report = json(&out);
                let found = report["classes"].as_array().unwrap().iter().find(|c| c["code"] == code).cloned();
                found.map_or(0, |c| c["samples"].as_u64().unwrap())
            };
            (samples(2), samples(7), err)
        };
        let (ground, rare, said) = train(&[]);
        assert!(ground >= 10_000 && rare == 0, "{strays}: {ground}, {rare}");
        assert_eq!(said.contains("class 7 low noise is left out"), strays > 0, "{said}");
        assert_eq!(said.contains("training.rare"), strays > 0, "{said}");
        let scores = json(&done(f, &["evaluate", "other.laz", "--model", "m.model", "--format", "json"]).0);
        assert!(scores["overall_accuracy"].as_f64().unwrap() > 0.95, "{strays}: {scores}");
        if strays == 12 {
            let (ground, rare, said) = train(&["--set", "training.rare=keep"]);
            assert!(ground >= 10_000 && rare == 12 && said.contains("each weighs"), "{ground}, {rare}: {said}");
            let csv = done(f, &[&["train", "in.laz", "-o", "m.model", "--format", "csv"], &QUICK[..]].concat()).0;
            assert!(
                csv.starts_with("code,points,samples,weight,class\n") && csv.contains("7,12,0,0,low noise"),
                "{csv}"
            );
            let (table, _) = done(f, &[&["train", "in.laz", "-o", "m.model"], &QUICK[..]].concat());
            assert!(table.contains("low noise") && table.contains("left out"), "{table}");
        }
    }
    let message = fails(f, &[&["train", "in.laz", "-o", "two.model", "--classes", "2,7"], &QUICK[..]].concat());
    assert!(message.contains("only one class") && message.contains("class 7 low noise is left out"), "{message}");
}

#[test]
fn grids_tiles_and_folders_are_reached_from_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let west = coded(15.0, 1, [2, 5, 6]);
    let moved: Vec<[f64; 3]> = (0..west.len()).map(|i| west.xyz(i)).map(|[x, y, z]| [x + 100.0, y, z]).collect();
    let mut east = Cloud::from_rows(&moved).unwrap();
    east.set_column(west.column("Classification").unwrap().clone()).unwrap();
    // Twenty points of each class: the first file of positions has those of the west and some of the east.
    let mut rows = [String::from("x,y,z,class\n"), String::from("x,y,z,class\n")];
    for code in [2.0, 5.0, 6.0] {
        let members = (0..west.len()).filter(|&i| west.column("Classification").unwrap().values.get(i) == code);
        for (n, i) in members.step_by(7).take(20).enumerate() {
            let [x, y, z] = if n % 2 == 0 { west.xyz(i) } else { moved[i] };
            rows[usize::from(n > 10)] += &format!("{x},{y},{z},{code}\n");
        }
    }
    for (name, text) in ["one.csv", "two.csv"].iter().zip(&rows) {
        std::fs::write(f.join(name), text).unwrap();
    }
    write(&f.join("west.laz"), west);
    write(&f.join("east.laz"), east);
    let quick = |arguments: &[&'static str]| [arguments, &QUICK].concat();
    let grid = ["-q", "--format", "json", "train", "west.laz", "-o", "grid.model", "--cross-validate", "2", "--grid"];
    let (out, err) = done(f, &quick(&[&grid[..], &["forest.max_depth=1,9"]].concat()));
    let report = json(&out);
    assert!(err.is_empty() && report["search"]["tried"].as_array().unwrap().len() == 2, "{out}");
    assert!(report["search"]["tried"][1]["scores"]["labels"][2]["f1_score"].as_f64().unwrap() > 0.5);
    let plain = ["-q", "--format", "json", "train", "west.laz", "-o", "plain.model", "--cross-validate", "2"];
    let report = json(&done(f, &quick(&plain)).0);
    assert_eq!(report["depths"][0]["classes"].as_array().unwrap().len(), 3);
    assert!(report["block"].as_f64().unwrap() < 15.0);
    // The recipe weak has no cross-validation of its own.
    let weak = ["--weak", "--set", "neighbourhood.k_max=20", "--set", "features.pyramid.levels=2"];
    let tiles =
        ["train", "west.laz", "east.laz", "-o", "weak.model", "--weak-labels", "one.csv", "--weak-labels", "two.csv"];
    let (out, _) = done(f, &[&tiles[..], &weak, &["--cross-validate", "2"]].concat());
    assert!(out.contains("2-fold cross-validation on squares"), "{out}");
    let message = fails(f, &[&["train", "west.laz", "-o", "w.model", "--weak-labels", "two.csv"][..], &weak].concat());
    assert!(message.contains("two.csv"), "{message}");
    done(f, &["classify", "west.laz", "-m", "weak.model", "-o", "named/", "--map", "5=4", "--map", "6=17"]);
    let codes = io::read(&f.join("named/west.laz")).unwrap().column("Classification").unwrap().values.to_f64();
    assert!(codes.contains(&4.0) && codes.contains(&17.0) && !codes.contains(&5.0) && !codes.contains(&6.0));
    let message = fails(f, &["classify", "west.laz", "east.laz", "-m", "weak.model", "-o", "both.laz"]);
    assert!(message.contains("name a folder") && !f.join("both.laz").exists(), "{message}");
    let message = fails(f, &["classify", "west.laz", "-m", "grid.model", "-o", "w.laz", "--set", "forest.trees=9"]);
    assert!(message.contains("only has an effect in training"), "{message}");
}

/// Segments with a colour each; labels of some of their points, as a field and as polygons, name all of them.
#[test]
fn labels_of_a_few_points_are_spread_over_coloured_segments() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = street(40.0, 5);
    write(&f.join("street.laz"), cloud.clone());
    let segment = ["segment", "street.laz", "-o", "parts.laz", "--method", "clusters", "--colour"];
    let (_, notes) = done(f, &segment);
    assert!(notes.contains("colours: point format 6 became 7"), "{notes}");
    let parts = io::read(&f.join("parts.laz")).unwrap();
    let values = |name: &str| parts.column(name).unwrap().values.to_f64();
    let (ids, red, green) = (values("ClusterID"), values("Red"), values("Green"));
    assert_eq!(values("Classification"), cloud.column("Classification").unwrap().values.to_f64());
    // One colour a segment, and different ones for the largest.
    let colour = |id: f64| {
        let own: Vec<usize> = (0..ids.len()).filter(|&i| ids[i] == id).collect();
        assert!(own.iter().all(|&i| red[i] == red[own[0]] && green[i] == green[own[0]]));
        [red[own[0]] as u32, green[own[0]] as u32]
    };
    assert!(
        colour(1.0) != colour(2.0) && colour(2.0) != colour(3.0) && colour(1.0).iter().any(|&v| v % 257 == 0 && v > 0)
    );

    // Every hundredth point of a segment is labelled.
    let truth = values("Classification");
    let few: Vec<u8> = (0..ids.len()).map(|i| if i % 100 == 0 { truth[i] as u8 } else { 0 }).collect();
    let mut labelled = parts.clone();
    labelled.set_column(Column::new("Label", Values::U8(few))).unwrap();
    io::write(&f.join("few.laz"), &labelled, &Default::default()).unwrap();
    let train = |extra: &[&str]| {
        let own = ["train", "few.laz", "-o", "few.model", "--format", "json"];
        json(&done(f, &[&own[..], extra, &QUICK].concat()).0)
    };
    let field = ["--label-dimension", "Label", "--unlabelled", "0"];
    let [alone, spread] = [&field[..], &[&field[..], &["--spread-over", "ClusterID"]].concat()].map(|arguments| {
        let points = |class: &serde_json::Value| class["points"].as_u64().unwrap();
        train(arguments)["classes"].as_array().unwrap().iter().map(points).sum::<u64>()
    });
    assert!(alone < 1000 && spread > 90 * alone, "{alone} {spread}");
    let absent = [&["train", "few.laz", "-o", "x.model", "--spread-over", "Segment"][..], &QUICK].concat();
    assert!(fails(f, &absent).contains("Segment"));

    // Polygons: a strip of ground between the houses, and a roof.
    let square = |class: u8, [x, y]: [f64; 2]| {
        let (right, up) = (x + 2.0, y + 2.0);
        let ring = format!("[[{x},{y}],[{right},{y}],[{right},{up}],[{x},{up}],[{x},{y}]]");
        format!(
            r#"{{"type":"Feature","properties":{{"class":{class}}},"geometry":{{"type":"Polygon","coordinates":[{ring}]}}}}"#
        )
    };
    let features = [square(6, [5.0, 6.0]), square(2, [5.0, 16.0])].join(",");
    let collection = format!(r#"{{"type":"FeatureCollection","features":[{features}]}}"#);
    std::fs::write(f.join("areas.geojson"), collection).unwrap();
    let found = train(&["--weak-labels", "areas.geojson", "--spread-over", "ClusterID"]);
    let classes = found["classes"].as_array().unwrap();
    let codes: Vec<u64> = classes.iter().map(|class| class["code"].as_u64().unwrap()).collect();
    assert_eq!(codes, [2, 6]);
    assert!(classes.iter().all(|class| class["points"].as_u64().unwrap() > 300), "{found}");
}

/// Classes that the model does not know are replaced with a warning that counts them; they can be kept, or the result
/// written beside them; the summary is JSON and CSV, and the file tells what made its classes.
#[test]
fn what_is_replaced_is_told_and_the_file_knows_its_model() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = street(40.0, 3);
    write(&f.join("street.laz"), cloud.clone());
    done(f, &[&["train", "street.laz", "-o", "street.model"][..], &QUICK].concat());
    let mut bridged = cloud.clone();
    let old = cloud.column("Classification").unwrap().values.to_f64();
    let code = |i: usize| {
        if i < 300 {
            17
        } else if i < 340 {
            65
        } else {
            old[i] as u8
        }
    };
    let codes: Vec<u8> = (0..old.len()).map(code).collect();
    bridged.set_column(Column::new("Classification", Values::U8(codes.clone()))).unwrap();
    io::write(&f.join("bridge.laz"), &bridged, &Default::default()).unwrap();

    let run = |output: &str, extra: &[&str]| {
        let own = ["classify", "bridge.laz", "-m", "street.model", "--regularize", "none", "-o", output];
        done(f, &[&own[..], extra].concat())
    };
    let (out, err) = run("a.laz", &["--format", "json"]);
    assert!(err.contains("17 bridge deck (300 points)") && err.contains("--keep 17,65"), "{err}");
    let found = json(&out);
    assert_eq!(found["replaced"][0]["points"], 300);
    let points: u64 = found["classes"].as_array().unwrap().iter().map(|c| c["points"].as_u64().unwrap()).sum();
    assert_eq!(points, old.len() as u64);
    let (out, _) = run("b.laz", &["--keep", "17,65", "--format", "csv"]);
    assert!(out.contains("\"b.laz\",17,\"bridge deck\",300,"), "{out}");
    let kept = io::read(&f.join("b.laz")).unwrap().column("Classification").unwrap().values.to_f64();
    assert!((0..340).all(|i| kept[i] == f64::from(codes[i])));
    assert!(!run("b.laz", &["--keep", "17", "--map", "5=4"]).1.contains("warning: --"));
    let (_, err) = run("b.laz", &["--keep", "17,99", "--map", "99=4,5=3", "--map", "1004=6"]);
    assert!(
        err.contains("--keep 99: no point of the input") && err.contains("--map changes no point of 99, 1004"),
        "{err}"
    );
    assert!(err.contains("the model's classes are 2 ground"), "{err}");
    let (_, err) = run("c.laz", &["--to", "PredictedClassification"]);
    assert!(!err.contains("replaced"), "{err}");
    let both = io::read(&f.join("c.laz")).unwrap();
    assert_eq!(both.column("Classification").unwrap().values, Values::U8(codes));
    let predicted = both.column("PredictedClassification").unwrap().values.to_f64();
    let plain = io::read(&f.join("a.laz")).unwrap().column("Classification").unwrap().values.to_f64();
    assert_eq!(predicted, plain);

    // Classified again, the file tells of the last model only.
    let told = |file: &str| json(&done(f, &["info", file, "--json"]).0)[0]["provenance"].as_str().map(json);
    let first = told("a.laz").unwrap();
    assert_eq!(
        (&first["model"], &first["recipe"], &first["regularise"]),
        (&"street.model".into(), &"pyramid".into(), &"none".into())
    );
    assert_eq!(first["checksum"].as_str().unwrap().len(), 64);
    done(f, &["classify", "a.laz", "-m", "street.model", "-o", "d.laz", "--regularize", "local"]);
    assert_eq!(told("d.laz").unwrap()["regularise"], "local");
    assert!(told("bridge.laz").is_none());
    let text = done(f, &["info", "d.laz"]).0;
    assert_eq!(text.matches("scansion 1").count(), 1, "{text}");
    // Formats without such a record have a file beside them; one of another program is not shown.
    done(f, &["convert", "a.laz", "e.ply"]);
    assert!(told("e.ply").is_none());
    done(f, &["classify", "e.ply", "-m", "street.model", "-o", "g.ply"]);
    assert_eq!(told("g.ply").unwrap()["checksum"], first["checksum"]);
    assert!(f.join("g.ply.json").is_file());
    std::fs::write(f.join("e.ply.json"), "{\"program\": \"other\"}").unwrap();
    assert!(told("e.ply").is_none());
    done(f, &["classify", "e.ply", "-m", "street.model", "-o", "g.laz"]);
    assert_eq!(io::read(&f.join("g.laz")).unwrap().class_names.len(), 3, "names of classes go from PLY to LAZ");
}

/// A street with own codes and an unknown list.
fn tram_street(folder: &Path) {
    write(&folder.join("a.laz"), coded(24.0, 3, [2, 15, 64]));
    write(&folder.join("a.ply"), coded(24.0, 3, [1, 6, 4]));
}

#[test]
fn classes_have_the_names_of_the_user_the_file_the_model_or_the_list() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    tram_street(f);
    // The user's names go into the model, and with its result into the record of LAS.
    let train = ["train", "a.laz", "-o", "a.model", "--names", "15=pole,64=tram", "--format", "json"];
    let (out, _) = done(f, &[&train[..], &QUICK].concat());
    assert!(out.contains("\"tram\"") && out.contains("\"pole\"") && !out.contains("transmission"), "{out}");
    done(f, &["classify", "a.laz", "-m", "a.model", "-o", "b.laz", "--probabilities"]);
    let read = io::read(&f.join("b.laz")).unwrap();
    assert_eq!(read.class_names[&64].name, "tram");
    assert!(read.column("P_pole").is_some() && read.column("P_tram").is_some());
    // Whatever reads the file knows them, unless it is told others.
    let (out, _) = done(f, &["info", "b.laz", "--stats"]);
    assert!(out.contains("pole") && out.contains("tram"), "{out}");
    let (out, _) = done(f, &["evaluate", "a.laz", "b.laz", "--format", "json", "--names", "64=tramway"]);
    assert!(out.contains("tramway") && out.contains("transmission tower"), "of a.laz, which has no names: {out}");
    let (out, _) = done(f, &["evaluate", "b.laz", "a.laz", "--format", "json"]);
    assert!(out.contains("\"tram\"") && out.contains("\"pole\""), "{out}");
    // New names replace those in the file, and a list that is asked for comes before them.
    done(f, &["classify", "b.laz", "-m", "a.model", "-o", "c.laz", "--names", "64=metro"]);
    let renamed = io::read(&f.join("c.laz")).unwrap().class_names;
    assert_eq!((renamed[&64].name.as_str(), renamed[&15].name.as_str()), ("metro", "pole"));
    let (out, _) = done(f, &["info", "b.laz", "--stats", "--scheme", "asprs"]);
    assert!(out.contains("transmission tower") && out.contains("vehicle"), "{out}");
    let (out, _) = done(f, &["evaluate", "a.laz", "b.laz", "--format", "json", "--scheme", "asprs"]);
    assert!(out.contains("vehicle"), "{out}");
    // Lists by name, or from a file.
    let (out, _) = done(f, &["evaluate", "a.ply", "a.ply", "--scheme", "Toronto-3D", "--format", "json"]);
    assert!(out.contains("\"pole\"") && out.contains("\"building\""), "{out}");
    std::fs::write(f.join("own.toml"), "classes = [{ code = 6, name = \"mast\", colour = [1, 2, 3] }]\n").unwrap();
    let own = ["--scheme", "own.toml", "--names", "4=house"];
    let (out, _) = done(f, &[&["evaluate", "a.ply", "a.ply", "--format", "json"], &own[..]].concat());
    assert!(out.contains("\"mast\"") && out.contains("\"house\"") && out.contains("\"class 1\""), "{out}");
    done(f, &[&["render", "a.ply", "-o", "a.png"], &own[..]].concat());
    assert!(fails(f, &["info", "a.ply", "--scheme", "toronto"]).contains("toronto-3d"));
    std::fs::write(f.join("bad.toml"), "classes = 3").unwrap();
    assert!(fails(f, &["info", "a.ply", "--scheme", "bad.toml"]).contains("bad.toml"));
    assert!(fails(f, &["info", "a.ply", "--names", "pole"]).contains("CODE=NAME"));
}

#[test]
fn codes_above_255_are_mapped_and_sweeps_of_semantic_kitti_are_learned() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::create_dir_all(f.join("velodyne")).unwrap();
    std::fs::create_dir_all(f.join("labels")).unwrap();
    let cloud = coded(24.0, 4, [40, 70, 256]);
    let codes = cloud.column("Classification").unwrap().values.to_f64();
    let floats = |i: usize| cloud.xyz(i).map(|v| v as f32).into_iter().chain([0.5]);
    let bytes: Vec<u8> = (0..cloud.len()).flat_map(floats).flat_map(f32::to_le_bytes).collect();
    std::fs::write(f.join("velodyne/000000.bin"), bytes).unwrap();
    let labels: Vec<u8> = codes.iter().flat_map(|&code| (3 << 16 | code as u32).to_le_bytes()).collect();
    std::fs::write(f.join("labels/000000.label"), &labels).unwrap();
    let (out, _) = done(f, &["info", "velodyne/000000.bin"]);
    assert!(out.contains("SemanticKITTI") && out.contains("Instance"), "{out}");
    let train = ["train", "velodyne/000000.bin", "-o", "k.model", "--format", "json"];
    let message = fails(f, &[&train[..], &QUICK].concat());
    assert!(message.contains("is 256") && message.contains("--map") && message.contains("256=5"), "{message}");
    let (out, _) = done(f, &[&train[..], &QUICK, &["--map", "252-259=10"]].concat());
    assert!(out.contains("\"road\"") && out.contains("\"vegetation\"") && out.contains("\"car\""), "{out}");
    done(f, &["classify", "velodyne/000000.bin", "-m", "k.model", "-o", "000000.label"]);
    let named = std::fs::read(f.join("000000.label")).unwrap();
    assert_eq!(named.len(), labels.len());
    let same = (0..cloud.len()).filter(|&i| {
        let [truth, found] = [&labels, &named].map(|b| u16::from_le_bytes([b[4 * i], b[4 * i + 1]]));
        found == if truth == 256 { 10 } else { truth } && named[4 * i + 2] == 3
    });
    assert!(same.count() as f64 > 0.9 * cloud.len() as f64, "classes are right, and instances stay");
}

#[test]
fn codes_of_maps_and_lists_that_no_point_has_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for (name, house) in [("a.ply", 6), ("b.ply", 9)] {
        write(&f.join(name), coded(16.0, 1, [2, 5, house]));
    }
    let told = |arguments: &[&str]| done(f, arguments).1;
    let train = [&["train", "a.ply", "b.ply", "-o", "m.model", "--map", "77=5,9=6"][..], &QUICK].concat();
    for (arguments, option) in [
        (&train[..], "--map"),
        (&["evaluate", "a.ply", "a.ply", "--map", "77=5"], "--map"),
        (&["evaluate", "a.ply", "b.ply", "--map-truth", "6=9,77=5"], "--map-truth"),
        (&["evaluate", "a.ply", "b.ply", "--map-predicted", "9=6,77=5"], "--map-predicted"),
        (&["segment", "a.ply", "-o", "s.ply", "--map", "77=5"], "--map"),
        (&["suggest", "a.ply", "-o", "s.csv", "--map", "77=5"], "--map"),
        (&["render", "a.ply", "--truth", "a.ply", "-o", "r.png", "--map", "77=5"], "--map"),
        (&["render", "a.ply", "--truth", "a.ply", "-o", "r.png", "--map-predicted", "77=5"], "--map-predicted"),
    ] {
        let text = told(arguments);
        assert!(
            text.contains(&format!("warning: {option} changes no point of 77 (found: 2, 5")),
            "{arguments:?}: {text}"
        );
    }
    let text = told(&["evaluate", "a.ply", "b.ply", "--map-truth", "6=9"]);
    assert!(!text.contains("changes no point"), "{text}");
    let text = told(&["render", "a.ply", "--truth", "a.ply", "--classes", "2,64", "-o", "r.png"]);
    assert!(text.contains("--classes asks for 64"), "{text}");
    let text = told(&["filter", "a.ply", "--drop-classes", "64,5", "-o", "f.ply"]);
    assert!(text.contains("no point has class 64"), "{text}");
    // A map for both sides that changes the drawn cloud is as unclear as in evaluate.
    for verb in [&["evaluate", "b.ply", "a.ply"][..], &["render", "a.ply", "--truth", "b.ply", "-o", "both.png"]] {
        let text = fails(f, &[verb, &["--map", "9=6,5=6"]].concat());
        assert!(text.contains("it has code 5") && text.contains("--map-truth 9=6,5=6"), "{text}");
        assert!(!f.join("both.png").exists());
    }
}
