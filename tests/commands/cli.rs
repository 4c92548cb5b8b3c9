//! Command line tests: exit codes, streams and files.

use scansion_tests::{demo_scan, street};
use std::path::Path;
use std::process::Command;

scansion_tests::program!(scansion, done, ends, fails);

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Points that `classify` left unclassified get a class again, with a warning, unless they are kept.
fn kept_points_stay_unclassified(f: &Path, model: &[&str]) {
    done(f, &[model, &["-o", "some.laz", "--probabilities", "--abstain", "0.95"]].concat());
    let unclassified = |name: &str| {
        let cloud = scansion_core::io::read(&f.join(name)).unwrap();
        let codes = cloud.column("Classification").unwrap().values.to_f64();
        codes.iter().map(|&code| code == 1.0).collect::<Vec<bool>>()
    };
    let open = unclassified("some.laz");
    let number = open.iter().filter(|&&open| open).count();
    assert!(number > 10 && number < open.len());
    let (_, warned) = ends(f, &["regularize", "some.laz", "-o", "every.laz"], 0);
    let expected = format!("have no probability were replaced: 1 unclassified ({number} points); --keep 1 keeps them");
    assert!(warned.contains(&expected), "{warned}");
    assert!(!unclassified("every.laz").contains(&true));
    let (_, warned) = ends(f, &["regularize", "some.laz", "-o", "kept.laz", "--keep", "1"], 0);
    assert!(!warned.contains("replaced"), "{warned}");
    assert!(unclassified("kept.laz") == open);
    let (_, warned) = ends(f, &["regularize", "some.laz", "-o", "wrong.laz", "--keep", "17"], 0);
    assert!(warned.contains("--keep 17: no point"), "{warned}");
}

/// `regularize` of written probabilities gives what `classify --regularize` gives, but for what rounding does.
fn neighbours_agree_afterwards_as_in_one_step(f: &Path) {
    let keys =
        ["features.pyramid.first_scale=0.2", "features.pyramid.levels=1", "forest.trees=3", "regularise.method=none"];
    let mut train = vec!["train", "b.ply", "-o", "poor.model"];
    train.extend(keys.iter().flat_map(|key| ["--set", key]));
    done(f, &train);
    let model = ["classify", "a.laz", "-m", "poor.model"];
    done(f, &[&model[..], &["-o", "alone.laz", "--probabilities", "--regularize", "none"]].concat());
    done(f, &[&model[..], &["-o", "once.laz", "--regularize", "point-crf", "--set", "regularise.strength=2"]].concat());
    let said = done(
        f,
        &["regularize", "alone.laz", "-o", "twice.laz", "--method", "point-crf", "--strength", "2", "--format", "json"],
    );
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(said["changed"].as_u64().unwrap() > 10 && said["energy"].as_f64().unwrap() > 0.0, "{said}");
    let [alone, once, twice] = ["alone.laz", "once.laz", "twice.laz"].map(|name| {
        let cloud = scansion_core::io::read(&f.join(name)).unwrap();
        cloud.column("Classification").unwrap().values.to_f64()
    });
    let different = |a: &[f64], b: &[f64]| a.iter().zip(b).filter(|(a, b)| a != b).count() as u64;
    assert_eq!(different(&alone, &twice), said["changed"].as_u64().unwrap());
    assert!(different(&once, &twice) * 1000 < once.len() as u64, "{}", different(&once, &twice));
    done(
        f,
        &["regularize", "alone.laz", "-o", "own.laz", "--to", "Smooth", "--probabilities", "P_class_6=6,P_class_2=2"],
    );
    kept_points_stay_unclassified(f, &model);
    let wrong = fails(f, &["regularize", "c.txt", "-o", "x.laz"], 4);
    assert!(wrong.contains("at least 2"), "{wrong}");
    let wrong = fails(f, &["regularize", "alone.laz", "-o", "x.laz", "--probabilities", "P_roof=6,P_class_2=2"], 4);
    assert!(wrong.contains("no dimension P_roof"), "{wrong}");
}

#[test]
fn the_main_job_runs_from_training_to_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for (name, seed) in [("a.laz", 1), ("b.ply", 2), ("c.txt", 3)] {
        scansion_core::io::write(&f.join(name), &street(30.0, seed), &Default::default()).unwrap();
    }
    let sets =
        ["--set", "features.pyramid.first_scale=0.4", "--set", "features.pyramid.levels=5", "--set", "forest.trees=10"];
    let trained =
        done(f, &[&["train", "a.laz", "b.ply", "-o", "my.model", "--seed", "3", "-j", "2"], &sets[..]].concat());
    assert!(trained.contains("building") && trained.contains("out-of-bag"), "{trained}");
    assert!(trained.contains("held-out patches") && trained.contains("\nchosen: "), "{trained}");
    done(f, &["classify", "a.laz", "c.txt", "-m", "my.model", "-o", "named", "--probabilities"]);
    let scores = done(f, &["evaluate", "c.txt", "named/c.txt", "--format", "json", "-o", "s.csv", "-o", "s.png"]);
    let scores: serde_json::Value = serde_json::from_str(&scores).unwrap();
    assert!(scores["overall_accuracy"].as_f64().unwrap() > 0.95, "{scores}");
    neighbours_agree_afterwards_as_in_one_step(f);
    let info = done(f, &["info", "named/a.laz", "--stats", "--format", "json"]);
    assert!(info.contains("P_building") && info.contains("Confidence") && info.contains("Entropy"), "{info}");
    done(f, &["render", "named/a.laz", "-o", "map.png"]);
    done(f, &["render", "named/a.laz", "-o", "side.png", "--view", "oblique", "--by", "Confidence"]);
    for picture in ["map.png", "side.png", "s.png"] {
        assert!(std::fs::read(f.join(picture)).unwrap().starts_with(b"\x89PNG"), "{picture}");
    }
    assert!(f.join("map.pgw").exists());
    let shown = done(f, &["model", "show", "my.model"]);
    assert!(shown.contains("most important features") && shown.contains("\nregularisation: "), "{shown}");
    assert!(done(f, &["model", "show", "my.model", "--recipe"]).contains("levels = 5"));
    let left: Vec<_> = std::fs::read_dir(f)
        .unwrap()
        .filter(|e| text(e.as_ref().unwrap().file_name().as_encoded_bytes()).contains("partial"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn the_demo_and_the_built_in_model_need_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let table = done(folder.path(), &["demo"]);
    assert!(table.contains("mean IoU") && table.contains("What to do next"), "{table}");
    for name in ["scan.laz", "classified.laz", "map.png", "oblique.png", "scores.json"] {
        assert!(folder.path().join("scansion-demo").join(name).exists(), "{name}");
    }
    assert!(done(folder.path(), &["model", "show"]).contains("building"));
    let f = folder.path();
    done(f, &["predict", "scansion-demo/scan.laz", "-o", "again.laz", "--no-extra", "-q"]);
    let scores = done(f, &["eval", "scansion-demo/classified.laz", "again.laz", "--format", "csv"]);
    assert!(scores.contains("overall_accuracy,1,1"), "{scores}");
}

#[test]
fn cars_are_learned_beside_a_model() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    // The built-in model does not learn from the place of the demo.
    let demo = scansion_core::io::read(&demo_scan()).unwrap();
    let rows: Vec<[f64; 3]> = (0..demo.len()).map(|i| demo.xyz(i)).map(|[x, y, z]| [x + 1000.0, y, z]).collect();
    let mut moved = scansion_core::cloud::Cloud::from_rows(&rows).unwrap();
    moved.set_column(demo.column("Classification").unwrap().clone()).unwrap();
    scansion_core::io::write(&f.join("moved.laz"), &moved, &Default::default()).unwrap();
    let shown = done(f, &["model", "show"]);
    assert!(shown.contains("cars are found, and left unclassified: gbt, 250 trees"), "{shown}");
    // Vegetation in the place of cars.
    let learn = ["train", "moved.laz", "--add-cars-to", "built-in", "-o", "cars.model"];
    let said = done(f, &[&learn[..], &["--cars", "5"]].concat());
    assert!(said.contains("points of cars; learned from ") && said.contains("model: cars.model"), "{said}");
    done(
        f,
        &["classify", "moved.laz", "-m", "cars.model", "-o", "named.laz", "--set", "classes.cars.points=0", "--force"],
    );
    let none = fails(f, &[&learn[..5], &["none.model", "--cars", "99"]].concat(), 4);
    assert!(none.contains("0 samples of cars (code 99)"), "{none}");
    assert!(fails(f, &["train", "moved.laz", "--cars", "5", "-o", "x.model"], 2).contains("--add-cars-to"));
    assert!(fails(f, &[&learn[..], &["--cars", "5", "--recipe", "pyramid"]].concat(), 2).contains("--recipe"));
}

#[test]
fn features_are_listed_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    assert!(done(f, &["features", "--list"]).contains("SurfaceVariation"));
    scansion_core::io::write(&f.join("a.las"), &street(6.0, 1), &Default::default()).unwrap();
    let few =
        ["--only", "Planarity", "--set", "features.pyramid.first_scale=0.5", "--set", "features.pyramid.levels=2"];
    done(f, &[&["features", "a.las", "-o", "a.npy"], &few[..]].concat());
    assert!(std::fs::read(f.join("a.npy")).unwrap().starts_with(b"\x93NUMPY"));
    done(f, &[&["features", "a.las", "-o", "b.laz"], &few[..]].concat());
    assert!(done(f, &["info", "b.laz"]).contains("Planarity_r0p5 Planarity_r1"));
}

#[test]
fn what_goes_wrong_is_said_with_the_documented_code() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("a.laz"), &street(6.0, 1), &Default::default()).unwrap();
    std::fs::write(f.join("empty.las"), b"").unwrap();
    std::fs::write(f.join("cut.las"), b"LASF").unwrap();
    std::fs::write(f.join("bad.model"), b"no model").unwrap();
    std::fs::write(f.join("r.toml"), "[forest]\ntreees = 3\n").unwrap();
    assert!(fails(f, &["classify", "absent.laz", "-o", "x.laz"], 4).contains("absent.laz"));
    assert!(fails(f, &["classify", "empty.las", "-o", "x.laz"], 4).contains("empty file"));
    assert!(fails(f, &["info", "cut.las"], 4).contains("LAS: header at byte 0"));
    assert!(fails(f, &["classify", "a.laz", "-m", "bad.model", "-o", "x.laz"], 4).contains("bad.model"));
    assert!(fails(f, &["train", "a.laz", "-o", "m", "--recipe", "r.toml"], 4).contains("did you mean `trees`"));
    assert!(fails(f, &["train", "a.laz", "-o", "m", "--set", "forest.trees=0"], 2).contains("trees"));
    assert!(fails(f, &["classify", "a.laz", "-o", "a.laz"], 2).contains("--overwrite"));
    assert!(fails(f, &["classify", "a.laz", "-o", "no/where/x.laz"], 1).contains("no/where"));
    assert!(fails(f, &["classify", "a.laz", "empty.las", "-o", "out"], 3).contains("1 of 2 inputs failed"));
    assert!(f.join("out/a.laz").exists());
    assert!(fails(f, &["evaluate", "a.laz", "a.laz", "--map", "2=300"], 2).contains("300"));
    assert_eq!(scansion(f, &["classify"]).status.code(), Some(2));
    assert_eq!(scansion(f, &["--version"]).status.code(), Some(0));
    done(f, &["classify", "a.laz", "-o", "a.laz", "--overwrite"]);
}

#[test]
fn only_unclassified_and_skipped_points_are_respected() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::copy(demo_scan(), f.join("scan.laz")).unwrap();
    done(f, &["classify", "scan.laz", "-o", "u.laz", "--only-unclassified", "-q"]);
    let codes =
        |name: &str| scansion_core::io::read(&f.join(name)).unwrap().column("Classification").unwrap().values.to_f64();
    let (before, after) = (codes("scan.laz"), codes("u.laz"));
    assert!(before.iter().zip(&after).all(|(b, a)| *b <= 1.0 || a == b));
    // What is left are cars.
    let unclassified = |codes: &[f64]| codes.iter().filter(|&&code| code <= 1.0).count();
    assert!(unclassified(&after) * 2 < unclassified(&before), "{}", unclassified(&after));
    done(f, &["classify", "scan.laz", "-o", "all.laz", "-u", "-q", "--set", "classes.cars.points=0"]);
    assert_eq!(unclassified(&codes("all.laz")), 0);
    done(f, &["classify", "scan.laz", "-o", "s.laz", "--skip", "6", "-q"]);
    assert!(before.iter().zip(&codes("s.laz")).all(|(b, a)| *b != 6.0 || *a == 6.0));
}

#[test]
fn a_few_labels_go_from_suggestions_to_a_named_scan() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let scene = street(25.0, 7);
    scansion_core::io::write(&f.join("a.laz"), &scene, &Default::default()).unwrap();
    let table = done(f, &["segment", "a.laz", "-o", "s.laz", "--segments-per-hectare", "400"]);
    assert!(table.contains("segments by cut-pursuit, strength") && table.contains("oracle accuracy"), "{table}");
    done(f, &["render", "s.laz", "-o", "s.png", "--by", "ClusterID"]);
    let said =
        done(f, &["suggest", "a.laz", "-n", "6", "-o", "l.csv", "-o", "l.html", "-o", "l.laz", "--format", "json"]);
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said.as_array().unwrap().len(), 6);
    let page = std::fs::read_to_string(f.join("l.html")).unwrap();
    assert!(page.contains(r#"[2,"ground"]"#) && page.contains("localStorage"), "the well-known classes");
    assert_eq!(page.matches("data:image/png;base64,").count(), 12);
    assert!(!page.contains("http"), "the page must not need the internet");
    // Fills in the table with the true classes.
    let list = std::fs::read_to_string(f.join("l.csv")).unwrap();
    let truth = &scene.column("Classification").unwrap().values;
    let mut filled = String::new();
    for (line, segment) in list.lines().zip(std::iter::once(None).chain(said.as_array().unwrap().iter().map(Some))) {
        let class = segment.map(|s| truth.get(s["point"].as_u64().unwrap() as usize).to_string());
        filled += &format!("{line}{}\n", class.unwrap_or_default());
    }
    std::fs::write(f.join("labels.csv"), filled).unwrap();
    let trained =
        done(f, &["train", "l.laz", "--weak", "--weak-labels", "labels.csv", "-o", "m.model", "--per-class", "50"]);
    assert!(trained.contains("strength of the field"), "{trained}");
    // The second round leaves out the segments of the first, which the cloud or the same segmentation names.
    let first: Vec<&serde_json::Value> = said.as_array().unwrap().iter().map(|s| &s["cluster_id"]).collect();
    for cloud in ["l.laz", "a.laz"] {
        let again = ["suggest", cloud, "-n", "4", "-m", "m.model", "--weak-labels", "labels.csv", "--format", "json"];
        let again = done(f, &[&again[..], &["-o", "2.html", "--offer", "2,64=tram"]].concat());
        let again: serde_json::Value = serde_json::from_str(&again).unwrap();
        assert!(again.as_array().unwrap().iter().all(|s| !first.contains(&&s["cluster_id"])), "{again}");
        assert!(!again.as_array().unwrap().is_empty() && again[0]["uncertainty"].as_f64().unwrap() < 1.0, "{again}");
    }
    assert!(std::fs::read_to_string(f.join("2.html")).unwrap().contains(r#"[[2,"ground"],[64,"tram"]]"#));
    fails(f, &["suggest", "a.laz", "-o", "x.csv", "--offer", "tram"], 2);
    done(f, &["classify", "a.laz", "-m", "m.model", "-o", "n.laz"]);
    let scores = done(f, &["evaluate", "a.laz", "n.laz", "--format", "json"]);
    let scores: serde_json::Value = serde_json::from_str(&scores).unwrap();
    assert!(scores["overall_accuracy"].as_f64().unwrap() > 0.85, "{scores}");
    done(f, &["render", "n.laz", "--truth", "a.laz", "-o", "errors.png"]);
    for way in ["none", "local", "point-crf", "consensus", "segment-crf"] {
        done(f, &["classify", "a.laz", "-o", "r.laz", "--regularize", way, "--set", "regularise.strength=0.5"]);
    }
    // Picked labels serve every recipe, a grid of ground heights only the weak one.
    let small = ["--set", "forest.trees=5", "--set", "features.pyramid.first_scale=0.5"];
    done(f, &[&["train", "l.laz", "--weak-labels", "labels.csv", "-o", "p.model"], &small[..]].concat());
    std::fs::write(f.join("dtm.asc"), "ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 30\n0\n").unwrap();
    done(f, &["classify", "a.laz", "-m", "m.model", "-o", "e.laz", "--elevation-model", "dtm.asc"]);
    let bytes = |name: &str| std::fs::read(f.join(name)).unwrap();
    assert!(bytes("e.laz") != bytes("n.laz"), "the grid has no effect");
    let text = fails(f, &["classify", "a.laz", "-m", "p.model", "-o", "x.laz", "--elevation-model", "dtm.asc"], 2);
    assert!(text.contains("elevation model") && text.contains("pyramid"), "{text}");
    std::fs::write(f.join("far.csv"), "x,y,z,class\n9000,0,0,2\n").unwrap();
    let far = fails(f, &["train", "a.laz", "--weak", "--weak-labels", "far.csv", "-o", "x.model"], 4);
    assert!(far.contains("far.csv:2") && far.contains("outside the cloud"), "{far}");
    // A label one unit above the highest point: too far in metres, near enough in feet.
    let codes = |i: usize| truth.get(i) as u8;
    let top = (0..scene.len()).max_by(|&a, &b| scene.xyz(a)[2].total_cmp(&scene.xyz(b)[2])).unwrap();
    let other = (0..scene.len()).find(|&i| codes(i) > 1 && codes(i) != codes(top)).unwrap();
    let line = |i: usize, up: f64| {
        let [x, y, z] = scene.xyz(i);
        format!("{x},{y},{},{}\n", z + up, codes(i))
    };
    std::fs::write(f.join("high.csv"), format!("x,y,z,class\n{}{}", line(top, 1.0), line(other, 0.0))).unwrap();
    let train = ["train", "a.laz", "--weak", "--weak-labels", "high.csv", "-o", "high.model"];
    assert!(fails(f, &train, 4).contains("high.csv:2"));
    done(f, &[&train[..], &["--set", "features.metres_per_unit=0.3048"]].concat());
    fails(f, &["train", "a.laz", "--per-class", "3", "-o", "x.model"], 2);
    fails(f, &["suggest", "a.laz", "-o", "x.docx"], 2);
}

#[test]
fn every_method_parts_a_scan_and_objects_are_learned_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("a.laz"), &street(25.0, 7), &Default::default()).unwrap();
    for method in [
        "felzenszwalb",
        "riemannian",
        "local-graph",
        "slic",
        "vccs",
        "region-growing",
        "octree-region-growing",
        "merge",
        "clusters",
    ] {
        let said = done(f, &["segment", "a.laz", "-o", "s.laz", "--method", method, "--format", "json"]);
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert_eq!(said["method"], method);
        assert!(said["segments"].as_u64().unwrap() > 1 && said["oracle_accuracy"].as_f64().unwrap() > 0.5, "{said}");
    }
    let said = done(f, &["segment", "a.laz", "-o", "c.laz", "--method", "clusters", "--set", "clusters.angle_deg=20"]);
    assert!(said.contains("angle 20 degrees: given") && said.contains("median distance to neighbour 16"), "{said}");
    let dimensions = done(f, &["info", "c.laz"]);
    assert!(["ClusterID_L1", "ClusterID_L4", "ClusterCentrality"].iter().all(|name| dimensions.contains(name)));
    let levels = done(f, &["segment", "a.laz", "-o", "l.laz", "--recipe", "riemannian", "--levels", "3,4"]);
    assert!(levels.contains("supervoxels") && levels.contains("cuts s"), "{levels}");
    assert!(done(f, &["info", "l.laz"]).contains("ClusterID_L2"));
    let sizes = ["1.5", "3"].map(|size| {
        let said =
            done(f, &["segment", "a.laz", "-o", "s.laz", "--method", "slic", "--size", size, "--format", "json"]);
        serde_json::from_str::<serde_json::Value>(&said).unwrap()["segments"].as_u64().unwrap()
    });
    assert!(sizes[0] > sizes[1]);
    fails(f, &["segment", "a.laz", "-o", "x.laz", "--method", "slic", "--strength", "1"], 2);
    fails(f, &["segment", "a.laz", "-o", "x.laz", "--size", "1"], 2);
    let wrong = fails(f, &["segment", "a.laz", "-o", "x.laz", "--set", "objects.slic.syze=1"], 4);
    assert!(wrong.contains("did you mean `size`"), "{wrong}");

    for classifier in ["rf", "gbt", "bagging", "linear"] {
        // A small scene has few segments: leaves must be small too.
        let keys = ["segments.slic.size=1", "training.share=0.8", "boosting.min_samples_leaf=2"];
        let mut train = vec!["train", "a.laz", "-o", "o.model", "--recipe", "objects", "--classifier", classifier];
        train.extend(keys.iter().flat_map(|key| ["--set", key]));
        let said = done(f, &train);
        assert!(said.contains("segments") && said.contains("oracle accuracy"), "{said}");
        done(f, &["classify", "a.laz", "-m", "o.model", "-o", "n.laz"]);
        let scores = done(f, &["evaluate", "a.laz", "n.laz", "--format", "json"]);
        let scores: serde_json::Value = serde_json::from_str(&scores).unwrap();
        assert!(scores["overall_accuracy"].as_f64().unwrap() > 0.7, "{classifier}: {scores}");
    }
    fails(f, &["train", "a.laz", "--recipe", "objects", "--per-class", "3", "-o", "x.model"], 2);
    let said = done(f, &["train", "a.laz", "--recipe", "objects", "--cross-validate", "2", "-o", "x.model"]);
    assert!(said.contains("2-fold cross-validation on squares"), "{said}");
    fails(f, &["train", "a.laz", "--recipe", "objects", "--grid-depth", "3", "-o", "x.model"], 2);
    fails(f, &["features", "a.laz", "--recipe", "objects", "-o", "x.npy"], 2);
}

#[test]
fn shells_complete_the_verbs_and_every_verb_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let help = done(f, &["--help"]);
    let list = help.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    // The description of a verb may go on in the next line, further to the right.
    let first = list.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let verbs: Vec<&str> = first.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(verbs.contains(&"classify") && verbs.contains(&"man"), "{verbs:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = done(f, &["completions", shell]);
        assert!(verbs.iter().all(|verb| script.contains(verb)), "{shell}");
        let values = script.contains("segment-crf");
        assert!(values || ["powershell", "elvish"].contains(&shell), "{shell}: values of options");
    }
    std::fs::write(f.join("complete.bash"), done(f, &["completions", "bash"])).unwrap();
    if let Ok(checked) = Command::new("bash").args(["-n", "complete.bash"]).current_dir(f).status() {
        assert!(checked.success());
    }
    assert!(fails(f, &["completions", "cmd"], 2).contains("bash"));
    done(f, &["man", "pages"]);
    for verb in verbs.iter().filter(|verb| **verb != "help") {
        let page = std::fs::read_to_string(f.join(format!("pages/scansion-{verb}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains(verb), "{verb}");
    }
    assert!(std::fs::read_to_string(f.join("pages/scansion.1")).unwrap().contains("scansion\\-classify"));
}

/// Runs with this on stdin; stdout and stderr.
fn piped(folder: &Path, arguments: &[&str], stdin: &[u8]) -> (Vec<u8>, String) {
    use std::io::Write;
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_scansion-under-test"))
        .args(arguments)
        .current_dir(folder)
        .env("TMPDIR", folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    let bytes = stdin.to_vec();
    let feeding = std::thread::spawn(move || pipe.write_all(&bytes));
    let output = child.wait_with_output().unwrap();
    let _ = feeding.join();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    (output.stdout, text(&output.stderr))
}

#[test]
fn clouds_come_from_stdin_and_go_to_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("a.laz"), &street(12.0, 1), &Default::default()).unwrap();
    let laz = std::fs::read(f.join("a.laz")).unwrap();
    done(f, &["convert", "a.laz", "b.las"]);
    let (las, said) = piped(f, &["convert", "-", "-"], &laz);
    assert_eq!(las, std::fs::read(f.join("b.las")).unwrap());
    assert!(said.contains("stdout: ") && !said.contains("scansion-"), "{said}");
    done(f, &["segment", "a.laz", "-o", "c.ply", "--size", "1", "--method", "slic"]);
    let segment = ["segment", "-", "-o", "-", "--size", "1", "--method", "slic", "--stdout-format", "ply"];
    let (ply, said) = piped(f, &segment, &las);
    assert_eq!(ply, std::fs::read(f.join("c.ply")).unwrap());
    assert!(said.contains("segments by slic"), "tables go to stderr: {said}");
    let (csv, _) = piped(f, &["features", "-", "-o", "-", "--set", "features.pyramid.levels=1"], &ply);
    assert!(text(&csv).starts_with("x,y,z,Sum_"), "{}", &text(&csv)[..40]);
    let rows = "x y z\n1 2 3\n4 5 6\n";
    let (info, _) = piped(f, &["info", "-"], rows.as_bytes());
    assert!(text(&info).starts_with("stdin\n"), "{}", text(&info));
    assert!(fails(f, &["diff", "-", "-"], 2).contains("once"));
    assert!(fails(f, &["info", "a.laz", "--stdout-format", "ply"], 2).contains("--stdout-format"));
    let left = std::fs::read_dir(f).unwrap().filter(|e| e.as_ref().unwrap().path().is_dir()).count();
    assert_eq!(left, 0, "no temporary folder is left");
}
