//! Options have an effect in every command that takes them, and values that do not fit are not changed in silence.

use scansion_core::cloud::{Cloud, Column, Values, crs, names};
use scansion_core::io::{self, WriteOptions};
use scansion_tests::street;
use std::path::Path;

scansion_tests::program!(done, ends, fails);

fn save(folder: &Path, name: &str, cloud: &Cloud) {
    io::write(&folder.join(name), cloud, &WriteOptions::default()).unwrap();
}

/// Ten rows without names: class, x, y, z; x is 0 to 9, y ten times and z a hundred times that.
fn without_names(folder: &Path, name: &str) {
    let rows = (0..10).map(|i| format!("{} {}.0 {}.5 {}.25\n", 2 + 4 * (i % 2), i, 10 * i, 100 * i));
    std::fs::write(folder.join(name), rows.collect::<String>()).unwrap();
}

#[test]
fn names_of_columns_count_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    without_names(f, "a.txt");
    without_names(f, "b.txt");
    let with = |rest: &[&str]| done(f, &[rest, &["--columns", "class,x,y,z"]].concat());
    let check = |name: &str, count: usize| {
        let cloud = io::read(&f.join(name)).unwrap();
        assert_eq!(cloud.len(), count, "{name}");
        let last = cloud.xyz(count - 1);
        assert!((last[1] - 10.0 * last[0] - 0.5).abs() < 1e-9 && last[2] == 100.0 * last[0] + 0.25, "{name}: {last:?}");
        let class = cloud.column(names::CLASSIFICATION).unwrap().values.get(count - 1);
        assert_eq!(class, 2.0 + 4.0 * (last[0] % 2.0), "{name}");
    };
    with(&["convert", "a.txt", "convert.las"]);
    check("convert.las", 10);
    with(&["convert", "a.txt", "convert.csv"]);
    assert_eq!(io::read(&f.join("convert.csv")).unwrap().xyz(3), [3.0, 30.5, 300.25]);
    with(&["merge", "a.txt", "b.txt", "-o", "merge.las"]);
    check("merge.las", 20);
    with(&["filter", "a.txt", "-o", "bounds.las", "--bounds", "0,0,4.5,100"]);
    check("bounds.las", 5);
    with(&["filter", "a.txt", "-o", "classes.las", "--classes", "6"]);
    check("classes.las", 5);
    // LAS has columns of its own; coordinates and classes are equal.
    let (told, _) = ends(f, &["diff", "a.txt", "convert.las", "--columns", "class,x,y,z"], 1);
    assert!(told.contains("only new") && !told.contains("Classification differ"), "{told}");
    let rows =
        "class,east,north,up\n".to_string() + &std::fs::read_to_string(f.join("a.txt")).unwrap().replace(' ', ",");
    std::fs::write(f.join("c.csv"), rows).unwrap();
    for name in ["a.txt", "c.csv"] {
        let told = with(&["info", "--stats", name]);
        assert!(told.contains("Classification") && told.contains("class 6"), "{told}");
    }
}

#[test]
fn a_file_of_labels_alone_is_a_complete_output() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.las", &street(10.0, 1));
    for output in ["a.labels", "a.label"] {
        done(f, &["convert", "a.las", output]);
        assert!(f.join(output).is_file());
    }
}

#[test]
fn classes_above_255_are_never_taken_for_255() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(10.0, 2);
    let count = cloud.len();
    let codes = (0..count).map(|i| if i < 600 { 259 } else { 1 }).collect();
    cloud.set_column(Column::new(names::CLASSIFICATION, Values::U16(codes))).unwrap();
    save(f, "a.ply", &cloud);
    let text = fails(f, &["classify", "a.ply", "-o", "b.ply", "--force", "--only-unclassified"], 4);
    assert!(text.contains("class 259") && !f.join("b.ply").exists(), "{text}");
    let told = done(f, &["info", "--stats", "a.ply"]);
    assert!(told.contains("600 points have classes above 255") && !told.contains("class 255"), "{told}");
    let less = Values::U16((0..count).map(|i| if i < 600 { 2 } else { 1 }).collect());
    cloud.set_column(Column::new(names::CLASSIFICATION, less)).unwrap();
    save(f, "c.ply", &cloud);
    let (told, _) = ends(f, &["diff", "a.ply", "c.ply", "--format", "json"], 1);
    assert!(told.contains("\"from\": 1") && !told.contains("\"from\": 255"), "{told}");
}

#[test]
fn maps_and_lists_of_classes_count_for_picked_labels() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = street(20.0, 3);
    save(f, "a.las", &cloud);
    let codes = cloud.column(names::CLASSIFICATION).unwrap();
    let mut table = "x,y,z,class\n".to_string();
    for i in (0..cloud.len()).step_by(20) {
        let [x, y, z] = cloud.xyz(i);
        table += &format!("{x},{y},{z},{}\n", codes.values.get(i));
    }
    std::fs::write(f.join("l.csv"), table).unwrap();
    let train = |rest: &[&str]| {
        let first = ["train", "a.las", "--weak-labels", "l.csv", "-o", "o.model", "--overwrite"];
        done(f, &[&first[..], rest, &["--set", "forest.trees=2", "--set", "features.pyramid.levels=2"]].concat());
        done(f, &["model", "show", "o.model"])
    };
    let all = train(&[]);
    assert!(all.contains("building") && !all.contains("64"), "{all}");
    let mapped = train(&["--map", "6=64"]);
    assert!(mapped.contains("64"), "{mapped}");
    let some = train(&["--classes", "2,6"]);
    assert!(some.contains("building") && !some.contains("egetation"), "{some}");
}

#[test]
fn settings_of_regularize_count_and_flags_count_more() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(10.0, 4);
    let share: Vec<f32> = (0..cloud.len()).map(|i| if i % 3 == 0 { 0.4 } else { 0.7 }).collect();
    let rest = share.iter().map(|p| 1.0 - p).collect();
    cloud.set_column(Column::new("P_ground", Values::F32(share))).unwrap();
    cloud.set_column(Column::new("P_building", Values::F32(rest))).unwrap();
    save(f, "a.ply", &cloud);
    let energy = |rest: &[&str]| {
        let first = ["regularize", "a.ply", "-o", "b.ply", "--overwrite", "--format", "json"];
        let told = done(f, &[&first[..], rest].concat());
        told.split("\"energy\":").nth(1).unwrap().split([',', '}']).next().unwrap().to_string()
    };
    assert_eq!(energy(&["--set", "regularise.method=none"]), "null");
    assert_ne!(energy(&[]), "null");
    assert_ne!(energy(&["--set", "regularise.method=none", "--method", "point-crf"]), "null");
    let weak = ["--method", "point-crf", "--set", "regularise.strength=0.001"];
    assert_ne!(energy(&weak), energy(&[&weak[..], &["--strength", "5"]].concat()));
}

#[test]
fn a_point_far_away_is_not_drawn_and_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let rows = (0..500).map(|i| format!("{},{},{}\n", i % 25, i / 25, i % 3)).collect::<String>();
    std::fs::write(f.join("a.csv"), format!("x,y,z\n{rows}1e300,5,0\n3.4e38,-1e290,0\n")).unwrap();
    done(f, &["render", "a.csv", "-o", "a.png", "--by", "height"]);
    assert!(f.join("a.png").is_file());
}

#[test]
fn a_lost_reference_system_is_told_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(10.0, 5);
    cloud.crs = Some("EPSG:2056".into());
    save(f, "a.laz", &cloud);
    save(f, "b.laz", &cloud);
    for command in
        [&["merge", "a.laz", "b.laz", "-o", "c.ply"][..], &["filter", "a.laz", "-o", "d.ply", "--classes", "2"]]
    {
        let output = PROGRAM.run(f, command);
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && text.contains("not kept: the coordinate reference system"), "{text}");
    }
    let told = |input: &str, product: &str| {
        let output = PROGRAM.run(f, &["terrain", input, "--ground-filter", "--overwrite", "-o", product]);
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(!told("a.laz", "a.tif").contains("reference system"));
    assert!(told("a.laz", "a.asc").contains(".asc files have no reference system"));
    // A system that GeoTIFF cannot hold is warned of; one that only tells a unit is none.
    let own = r#"PROJCRS["own",BASEGEOGCRS["WGS 84",DATUM["WGS 84",ELLIPSOID["WGS 84",6378137,298.257223563]]],CS[Cartesian,2],LENGTHUNIT["metre",1]]"#;
    for (name, crs, lost) in [("own.laz", own.to_string(), true), ("feet.laz", crs::local(0.3048), false)] {
        cloud.crs = Some(crs);
        save(f, name, &cloud);
        for product in ["b.tif", "b.asc"] {
            assert_eq!(told(name, product).contains("reference system"), lost, "{name} {product}");
        }
    }
}

#[test]
fn options_that_would_have_no_effect_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.laz", &street(10.0, 6));
    fails(f, &["evaluate", "a.laz", "-m", "a.model", "--prediction-dimension", "Other"], 2);
    let edges = ["train", "a.laz", "--recipe", "contours", "--edges", "e.geojson", "-o", "o.model"];
    fails(f, &[&edges[..], &["--weak-labels", "l.csv"]].concat(), 2);
    fails(f, &[&edges[..], &["--map", "1=2"]].concat(), 2);
    fails(f, &["filter", "a.laz", "-o", "b.laz", "--classes", "2", "--window", "9"], 2);
    fails(f, &["terrain", "a.laz", "-o", "b.tif", "--interval", "2"], 2);
    fails(f, &["terrain", "a.laz", "-o", "b.tif", "--alpha", "2"], 2);
    let text = fails(f, &["suggest", "a.laz", "--labelled", "--label-dimension", "Nope", "-o", "s.csv"], 4);
    assert!(text.contains("no dimension Nope"), "{text}");
    let depths = ["train", "a.laz", "-o", "o.model", "--classifier", "linear", "--cross-validate", "2", "--block", "5"];
    let text = fails(f, &[&depths[..], &["--grid-depth", "3,5"]].concat(), 2);
    assert!(text.contains("depth"), "{text}");
    let text = fails(f, &["classify", "a.laz", "-o", "b.laz", "--map", "9-3=2"], 2);
    assert!(text.contains("9-3=2"), "{text}");
}

#[test]
fn points_in_degrees_are_compared_in_their_own_order_only() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let row =
        |i: usize| format!("{:.7},{:.7},400,{}\n", 7.0 + 1e-5 * i as f64, 47.0 - 2e-5 * i as f64, 2 + 4 * (i % 2));
    let table = |rows: &mut dyn Iterator<Item = usize>| format!("x,y,z,class\n{}", rows.map(row).collect::<String>());
    std::fs::write(f.join("a.csv"), table(&mut (0..100))).unwrap();
    std::fs::write(f.join("b.csv"), table(&mut (0..100).rev())).unwrap();
    for name in ["a", "b"] {
        done(f, &["convert", &format!("{name}.csv"), &format!("{name}.las"), "--scale", "1e-7,1e-7,0.001"]);
    }
    done(f, &["evaluate", "a.las", "a.las"]);
    let text = fails(f, &["evaluate", "a.las", "b.las"], 4);
    assert!(text.contains("the same points in the same order"), "{text}");
}

#[test]
fn each_class_has_its_own_probability_also_with_equal_names() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.ply", &street(20.0, 7));
    let names = ["--names", "2=x y,5=x-y,6=x_y"];
    let train = ["train", "a.ply", "-o", "a.model", "--set", "forest.trees=2", "--set", "features.pyramid.levels=2"];
    done(f, &[&train[..], &names].concat());
    done(f, &["classify", "a.ply", "-m", "a.model", "-o", "b.ply", "--probabilities"]);
    let cloud = io::read(&f.join("b.ply")).unwrap();
    let columns: Vec<_> = cloud.columns().iter().filter(|c| c.name.starts_with("P_")).collect();
    let sum = |i: usize| columns.iter().map(|c| c.values.get(i)).sum::<f64>();
    assert!(columns.len() >= 3 && (0..cloud.len()).all(|i| (sum(i) - 1.0).abs() < 1e-5), "{} columns", columns.len());
}

#[test]
fn tables_of_commas_have_as_many_columns_as_their_header() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a, b.laz", &street(10.0, 8));
    let told = done(f, &["info", "--stats", "--format", "csv", "a, b.laz"]);
    let lines: Vec<&str> = told.lines().collect();
    assert!(lines[0].ends_with("duplicates,outside_bounds") && lines[1].starts_with("\"a, b.laz\","), "{told}");
    assert_eq!(lines[1].split(',').count(), lines[0].split(',').count() + 1, "{told}");
}

#[test]
fn an_elevation_model_elsewhere_is_warned_of_and_cells_are_square() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.laz", &street(20.0, 9));
    let grid = |x: i32, cell: &str| {
        let heights = vec!["0 ".repeat(30); 30].join("\n");
        format!("ncols 30\nnrows 30\nxllcorner {x}\nyllcorner -5\n{cell}\nNODATA_value -9999\n{heights}\n")
    };
    for (name, x, cell) in
        [("here.asc", -5, "cellsize 1"), ("far.asc", 900, "cellsize 1"), ("tall.asc", -5, "dx 1\ndy 2")]
    {
        std::fs::write(f.join(name), grid(x, cell)).unwrap();
    }
    let run = |name: &str| {
        let command = ["train", "a.laz", "--recipe", "weak", "-o", "o.model", "--overwrite", "--elevation-model", name];
        let output = PROGRAM.run(f, &command);
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, text) = run("here.asc");
    assert!(code == Some(0) && !text.contains("beyond the elevation model"), "{text}");
    let (code, text) = run("far.asc");
    assert!(code == Some(0) && text.contains("beyond the elevation model"), "{text}");
    let (code, text) = run("tall.asc");
    assert!(code == Some(4) && text.contains("dy"), "{text}");
    // A grid is in the unit of the cloud, whatever that is.
    let command = [
        "train",
        "a.laz",
        "--weak",
        "-o",
        "u.model",
        "--elevation-model",
        "here.asc",
        "--unit",
        "3",
        "--per-class",
        "20",
    ];
    let output = PROGRAM.run(f, &command);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !text.contains("beyond the elevation model"), "{text}");
}

#[test]
fn training_reports_its_trials_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.laz", &street(20.0, 9));
    let train = |rest: &[&str]| done(f, &[&["train", "a.laz", "-o", "o.model", "--overwrite"], rest].concat());
    let csv = ["--format", "csv", "--block", "5"];
    let small = ["--set", "forest.trees=3", "--set", "features.pyramid.first_scale=0.5"];
    let told = train(&[&csv[..], &small[..], &["--grid-depth", "3,9"]].concat());
    assert!(told.contains("\n\nmax_depth,code,precision,recall,f1_score,class\n3,2,"), "{told}");
    let told = train(&[&csv[..], &small[..], &["--grid", "forest.max_depth=3,9", "--cross-validate", "3"]].concat());
    assert!(told.contains("\n\nsettings,code,precision,recall,f1_score,class\nforest.max_depth=3,2,"), "{told}");
    let quick = ["--set", "neighbourhood.k_step=10", "--set", "forest.trees=20"];
    let weak = [&["--weak", "--per-class", "20", "--grid-strength", "0.5,1"], &quick[..]].concat();
    let told = train(&[&csv[..2], &weak[..]].concat());
    assert!(told.contains("\n\nstrength,accuracy\n0.5,"), "{told}");
    // The folds are those of both trials. A third of the labels is wrong, so that scores depend on the folds.
    let mut cloud = street(20.0, 9);
    let values = cloud.column(names::CLASSIFICATION).unwrap().values.to_f64();
    let wrong = |i: usize| if i.is_multiple_of(3) { values[(7 * i + 1) % values.len()] } else { values[i] } as u8;
    cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8((0..values.len()).map(wrong).collect()))).unwrap();
    save(f, "n.laz", &cloud);
    let strengths = |k: &str| {
        let folds = ["--format", "json", "--cross-validate", k, "--block", "4"];
        done(f, &[&["train", "n.laz", "-o", "o.model", "--overwrite"], &weak[..], &folds[..]].concat())
    };
    let [few, many] = ["2", "9"].map(strengths);
    let scores = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap()["strengths"].clone();
    assert!(scores(&few).is_array() && scores(&few) != scores(&many), "{few} {many}");
}

#[test]
fn options_without_effect_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.laz", &street(10.0, 9));
    let train = ["train", "a.laz", "-o", "o.model"];
    for (rest, said) in [
        (&["--recipe", "weak", "--grid-depth", "3"][..], "does not try any"),
        (&["--recipe", "objects", "--grid-strength", "3"], "does not try any"),
        (&["--grid-strength", "3"], "does not try any"),
        (&["--set", "features.metres_per_unit=1", "--unit", "0.3048"], "metres_per_unit = 1"),
        (&["--recipe", "weak", "--checkpoint", "c.bin"], "writes none"),
    ] {
        let text = fails(f, &[&train[..], rest].concat(), 2);
        assert!(text.contains(said), "{rest:?}: {text}");
    }
    for (method, option, able) in [
        ("slic", ["--cutoff", "9"], "cut-pursuit, merge"),
        ("felzenszwalb", ["--cutoff", "9"], "cut-pursuit, merge"),
        ("vccs", ["--k-min", "20"], "cut-pursuit, merge, felzenszwalb"),
    ] {
        let text = fails(f, &[&["segment", "a.laz", "-o", "s.laz", "--method", method], &option[..]].concat(), 2);
        assert!(text.contains(able) && !text.contains(&format!("one of {able},")), "{text}");
    }
    let text = fails(f, &["regularize", "a.laz", "-o", "r.laz", "--method", "local", "--strength", "3"], 2);
    assert!(text.contains("point-crf"), "{text}");
    for (rest, said) in [(["--azimuth", "50"], "oblique"), (["--range", "0,1"], "height")] {
        let text = fails(f, &[&["render", "a.laz", "-o", "a.png"], &rest[..]].concat(), 2);
        assert!(text.contains(said), "{text}");
    }
    // Segments of every method are described by the neighbourhoods of their points.
    done(f, &["suggest", "a.laz", "-o", "s.csv", "--method", "slic", "--k-min", "12", "-n", "3"]);
    done(f, &["segment", "a.laz", "-o", "s.laz", "--method", "felzenszwalb", "--k-min", "12"]);
}

#[test]
fn the_filter_finds_the_ground_as_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(20.0, 9);
    let n = cloud.len();
    cloud.set_column(Column::new(names::HEIGHT_ABOVE_GROUND, Values::F32(vec![50.0; n]))).unwrap();
    save(f, "a.laz", &cloud);
    let filter = |rest: &[&str]| {
        done(f, &[&["filter", "a.laz", "-o", "o.laz", "--overwrite", "--height", "0..5"], rest].concat());
        io::read(&f.join("o.laz")).unwrap().len()
    };
    assert_eq!(filter(&[]), 0);
    assert!(filter(&["--ground-filter"]) > n / 4 && filter(&["--cell", "1"]) > n / 4);
    // Class 7 is noise in ASPRS codes, which `--scheme` says these are not. Below all else, it is no ground then.
    let classes = Values::U8((0..n).map(|i| if i % 2 == 0 { 7 } else { 2 }).collect());
    cloud.set_column(Column::new(names::CLASSIFICATION, classes)).unwrap();
    save(f, "a.laz", &cloud);
    let ground = ["--ground-classes", "7"];
    let text =
        fails(f, &[&["filter", "a.laz", "-o", "o.laz", "--overwrite", "--height", "0..5"], &ground[..]].concat(), 4);
    assert!(text.contains("ground"), "{text}");
    assert!(filter(&["--ground-classes", "7", "--scheme", "semantic3d"]) > 0);
}

#[test]
fn points_without_a_prediction_are_called_so() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(10.0, 9);
    let n = cloud.len();
    let codes = |missing: f64| Values::F64((0..n).map(|i| if i == 0 { missing } else { (i % 2) as f64 }).collect());
    cloud.set_column(Column::new("truth", codes(1.0))).unwrap();
    cloud.set_column(Column::new("guess", codes(f64::NAN))).unwrap();
    save(f, "a.ply", &cloud);
    let told = done(f, &["evaluate", "a.ply", "--label-dimension", "truth", "--prediction-dimension", "guess"]);
    assert!(told.contains("no prediction") && !told.contains("class 255"), "{told}");
}

#[test]
fn what_a_model_writes_is_told_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let told = done(folder.path(), &["model", "show", "--format", "json"]);
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    let codes: Vec<u64> =
        told["written_classes"].as_array().unwrap().iter().map(|class| class["code"].as_u64().unwrap()).collect();
    assert!([2, 3, 4, 5, 6].iter().all(|code| codes.contains(code)), "{codes:?}");
}
