//! Inputs and outputs: no input is overwritten, an output that cannot be written is reported before the work, and files
//! are not mistaken for what they are not.

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io::run::{Replace, Rules, run};
use scansion_core::io::{self, Edit, WriteOptions};
use scansion_core::recipes;
use scansion_tests::street;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

scansion_tests::program!(scansion, done, fails);

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = PROGRAM.command(folder, arguments);
    command.args(["--progress", "never", "-j", "2"]);
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// All files of a folder with their bytes.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap());
    let files = entries.filter(|e| e.path().is_file());
    let mut list: Vec<_> =
        files.map(|e| (e.file_name().to_string_lossy().into_owned(), std::fs::read(e.path()).unwrap())).collect();
    list.sort();
    list
}

/// Settings that make `train` fast.
const QUICK: [&str; 4] = ["--set", "forest.trees=2", "--set", "features.pyramid.levels=2"];

fn train(rest: &[&'static str]) -> Vec<&'static str> {
    [&["train"], rest, &QUICK].concat()
}

#[test]
fn no_command_writes_over_one_of_its_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = street(12.0, 1);
    for name in ["a.laz", "b.laz", "a.csv", "b.csv", "a.ply"] {
        io::write(&f.join(name), &cloud, &WriteOptions::default()).unwrap();
    }
    // The content decides what a file is.
    std::fs::copy(f.join("a.ply"), f.join("a.png")).unwrap();
    std::fs::write(f.join("r.toml"), "seed = 3\n").unwrap();
    std::fs::write(f.join("s.csv"), "classes = [{ code = 2, name = \"soil\" }]\n").unwrap();
    std::fs::write(f.join("l.csv"), "x,y,z,class\n1,1,0,2\n5,5,7,6\n").unwrap();
    done(f, &train(&["a.laz", "-o", "m.model"]));
    std::fs::copy(f.join("m.model"), f.join("m.laz")).unwrap();
    symlink("a.laz", f.join("soft.laz")).unwrap();
    std::fs::hard_link(f.join("a.laz"), f.join("hard.laz")).unwrap();
    symlink("a.csv", f.join("soft.csv")).unwrap();
    let before = contents(f);
    let runs: [(Vec<&str>, [&str; 2]); 28] = [
        (train(&["a.laz", "-o", "a.laz"]), ["a.laz"; 2]),
        (train(&["b.laz", "a.laz", "-o", "soft.laz"]), ["a.laz", "soft.laz"]),
        (train(&["a.laz", "-o", "hard.laz"]), ["a.laz", "hard.laz"]),
        (train(&["a.laz", "--recipe", "r.toml", "-o", "./r.toml"]), ["r.toml", "./r.toml"]),
        (train(&["a.laz", "--weak", "--weak-labels", "l.csv", "-o", "l.csv"]), ["l.csv"; 2]),
        (train(&["a.laz", "--recipe", "objects", "-o", "a.laz"]), ["a.laz"; 2]),
        (vec!["suggest", "a.csv", "-o", "a.csv"], ["a.csv"; 2]),
        (vec!["suggest", "a.csv", "-o", "soft.csv"], ["a.csv", "soft.csv"]),
        (vec!["suggest", "a.laz", "-o", "t.csv", "-o", "hard.laz"], ["a.laz", "hard.laz"]),
        (vec!["suggest", "a.laz", "-m", "m.laz", "-o", "m.laz"], ["m.laz"; 2]),
        (vec!["evaluate", "a.csv", "b.csv", "-o", "a.csv"], ["a.csv"; 2]),
        (vec!["evaluate", "a.csv", "b.csv", "-o", "./b.csv"], ["b.csv", "./b.csv"]),
        (vec!["evaluate", "a.csv", "-m", "m.model", "-o", "soft.csv"], ["a.csv", "soft.csv"]),
        (vec!["evaluate", "a.csv", "b.csv", "--scheme", "s.csv", "-o", "s.csv"], ["s.csv"; 2]),
        (vec!["evaluate", "a.csv", "b.csv", "--scheme", "s.csv", "-o", "./s.csv", "--overwrite"], ["s.csv", "./s.csv"]),
        (vec!["render", "a.png", "-o", "a.png"], ["a.png"; 2]),
        (vec!["render", "a.laz", "--truth", "a.png", "-o", "./a.png"], ["a.png", "./a.png"]),
        (vec!["features", "a.csv", "-o", "a.csv"], ["a.csv"; 2]),
        (vec!["features", "a.laz", "-o", "soft.laz"], ["a.laz", "soft.laz"]),
        (vec!["segment", "a.laz", "-o", "hard.laz"], ["a.laz", "hard.laz"]),
        (vec!["convert", "a.laz", "soft.laz"], ["a.laz", "soft.laz"]),
        (vec!["convert", "a.csv", "a.csv"], ["a.csv"; 2]),
        (vec!["merge", "b.laz", "a.laz", "hard.laz"], ["a.laz", "hard.laz"]),
        (vec!["merge", "?.laz", "a.laz"], ["a.laz"; 2]),
        (vec!["classify", "a.laz", "-o", "soft.laz"], ["a.laz", "soft.laz"]),
        (vec!["classify", "a.laz", "-m", "m.laz", "-o", "m.laz"], ["m.laz"; 2]),
        (vec!["convert", "--salvage", "a.laz", "a.laz"], ["a.laz"; 2]),
        (vec!["classify", "--salvage", "a.laz", "-o", "hard.laz"], ["a.laz", "hard.laz"]),
    ];
    for (arguments, [input, output]) in runs {
        let message = fails(f, &arguments, 2);
        assert!(message.contains("input and output"), "{arguments:?}: {message}");
        assert!(message.contains(input) && message.contains(output), "{arguments:?}: {message}");
        assert!(contents(f) == before, "{arguments:?} changed something");
    }
    for arguments in [
        vec!["suggest", "a.laz", "-o", "x.csv", "-o", "x.csv"],
        vec!["evaluate", "a.csv", "b.csv", "-o", "x.csv", "-o", "./x.csv"],
    ] {
        assert!(fails(f, &arguments, 2).contains("an output twice"));
        assert!(contents(f) == before, "{arguments:?} changed something");
    }
    // Two tiles; the output of the second would be the first.
    std::fs::create_dir(f.join("out")).unwrap();
    std::fs::copy(f.join("a.laz"), f.join("out/b.laz")).unwrap();
    let message = fails(f, &["classify", "out/b.laz", "b.csv", "a.laz", "-o", "out"], 3);
    assert!(message.contains("out/b.laz is input and output"), "{message}");
    assert!(f.join("out/a.laz").exists() && f.join("out/b.csv").exists());
    assert_eq!(std::fs::read(f.join("out/b.laz")).unwrap(), std::fs::read(f.join("a.laz")).unwrap());
    // Where it makes sense it can be requested.
    done(f, &["convert", "a.csv", "soft.csv", "--overwrite"]);
    assert!(f.join("soft.csv").is_symlink());
    done(f, &["classify", "a.laz", "-o", "a.laz", "--overwrite"]);
    done(f, &["merge", "a.laz", "b.laz", "b.laz", "--overwrite"]);
    assert_eq!(io::inspect(&f.join("b.laz")).unwrap().points, 2 * cloud.len() as u64);
}

#[test]
fn a_model_is_written_over_models_and_empty_files_only() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    io::write(&f.join("scan.laz"), &street(12.0, 2), &WriteOptions::default()).unwrap();
    std::fs::write(f.join("notes.txt"), "scansion model").unwrap();
    std::fs::write(f.join("my.model"), "").unwrap();
    let before = contents(f);
    for output in ["scan.laz", "notes.txt"] {
        let message = fails(f, &train(&["a.laz", "-o", output, "--overwrite"]), 2);
        assert!(message.contains(output) && message.contains("no model"), "{message}");
        assert!(contents(f) == before);
    }
    done(f, &train(&["a.laz", "-o", "my.model"]));
    done(f, &train(&["a.laz", "-o", "my.model"]));
    let model = scansion_core::recipes::Model::load(&f.join("my.model")).unwrap();
    assert!(model.save(&f.join("scan.laz")).unwrap_err().to_string().contains("no model"));
    model.save(&f.join("my.model")).unwrap();
}

/// A text cloud that is malformed at its end: a command that reads its points reports it.
fn bad_at_its_end(path: &Path) {
    let rows: String = (0..2000).map(|i| format!("{} {} 0.5\n", i % 50, i / 50)).collect();
    std::fs::write(path, format!("{rows}1 2 three\n")).unwrap();
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_points_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    bad_at_its_end(&f.join("a.xyz"));
    std::fs::create_dir(f.join("folder.png")).unwrap();
    std::fs::create_dir(f.join("folder.laz")).unwrap();
    let long = format!("{}.EXT", "n".repeat(252));
    let wrong = |ext: &str| {
        let missing = format!("absent/o.{ext}");
        vec![
            (missing, "folder does not exist"),
            (long.replace("EXT", ext), "name too long"),
            ("/proc/self/o.".to_string() + ext, "o."),
        ]
    };
    let verbs: [(&[&str], &str); 11] = [
        (&["classify", "a.xyz", "-o"], "laz"),
        (&["convert", "a.xyz"], "ply"),
        (&["merge", "a.xyz", "a.xyz"], "npz"),
        (&["features", "a.xyz", "-o"], "npy"),
        (&["features", "a.xyz", "-o"], "laz"),
        (&["segment", "a.xyz", "-o"], "laz"),
        (&["suggest", "a.xyz", "-o"], "html"),
        (&["suggest", "a.xyz", "-o"], "csv"),
        (&["render", "a.xyz", "-o"], "png"),
        (&["evaluate", "a.xyz", "a.xyz", "-o"], "json"),
        (&["train", "a.xyz", "-o"], "model"),
    ];
    for (verb, ext) in verbs {
        for (output, expected) in wrong(ext) {
            let found = scansion(f, &[verb, &[&output[..]]].concat());
            let message = text(&found.stderr);
            assert_eq!(found.status.code(), Some(1), "{verb:?}: {message}");
            assert!(message.contains(expected) && !message.contains("three"), "{verb:?}: {message}");
        }
        // And with an output that can be written, the points are read.
        assert!(fails(f, &[verb, &[&format!("o.{ext}")[..]]].concat(), 4).contains("three"), "{verb:?}");
    }
    for (arguments, code, expected) in [
        (vec!["classify", "a.xyz", "-o", "o.e57"], 2, "cannot write .e57"),
        (vec!["convert", "a.xyz", "o"], 2, "a file without extension"),
        (vec!["segment", "a.xyz", "-o", "o.doc"], 2, "cannot write .doc"),
        (vec!["merge", "a.xyz", "a.xyz", "o.e57"], 2, "cannot write .e57"),
        (vec!["features", "a.xyz", "-o", "o.txt2"], 2, "cannot write .txt2"),
        (vec!["suggest", "a.xyz", "-o", "o.csv", "-o", "o.e57"], 2, "o.e57"),
        (vec!["evaluate", "a.xyz", "a.xyz", "-o", "o.csv", "-o", "o.pdf"], 2, "o.pdf"),
        (vec!["render", "a.xyz", "-o", "o.jpg"], 2, "o.jpg"),
        (vec!["render", "a.xyz", "-o", "folder.png"], 1, "folder.png"),
        (vec!["convert", "a.xyz", "o.copc.laz"], 2, "name it o.laz"),
        (vec!["classify", "a.xyz", "-o", "O.COPC.LAZ"], 2, "COPC is read, not written"),
    ] {
        let message = fails(f, &arguments, code);
        assert!(message.contains(expected) && !message.contains("three"), "{arguments:?}: {message}");
    }
    assert_eq!(contents(f).len(), 1, "nothing is left");
}

#[test]
fn a_result_that_would_be_lost_or_replace_a_field_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    for other in ["a.csv", "a.ply", "a.npz"] {
        done(f, &["convert", "a.laz", other]);
    }
    let before = contents(f);
    let taken = [
        ("a.laz", "Intensity"),
        ("a.ply", "Intensity"),
        ("a.csv", "intensity"),
        ("a.csv", "label"),
        ("a.csv", "x"),
        ("a.npz", "xyz"),
        // Other dimensions of the result.
        ("a.csv", "Confidence"),
        ("a.laz", "Confidence"),
        ("a.ply", "Entropy"),
    ];
    for (input, name) in taken {
        let output = format!("o.{}", input.rsplit('.').next().unwrap());
        for verb in ["classify", "regularize"] {
            if verb == "regularize" && name == "Entropy" {
                continue;
            }
            let message = fails(f, &[verb, input, "--to", name, "-o", &output], 2);
            assert!(message.contains(name) && message.contains("a name that"), "{verb} {input} {name}: {message}");
        }
    }
    for arguments in [
        vec!["classify", "a.laz", "--to", "Mine"],
        vec!["height", "a.laz"],
        vec!["normals", "a.laz"],
        vec!["segment", "a.laz"],
        vec!["features", "a.laz", "--only", "Planarity"],
        vec!["filter", "a.laz", "--classes", "2"],
    ] {
        for output in ["o.labels", "o.label"] {
            let message = fails(f, &[&arguments[..], &["-o", output]].concat(), 2);
            assert!(message.contains("classes only"), "{arguments:?}: {message}");
        }
    }
    assert!(contents(f) == before);
    done(f, &["classify", "a.laz", "-o", "o.labels"]);
    done(f, &["classify", "a.laz", "--to", "Confidence", "--no-extra", "-o", "o.laz"]);
}

#[test]
fn points_that_las_cannot_hold_are_found_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let rows: String = (0..2000).map(|i| format!("{} {} 0.5\n", i % 50, i / 50)).collect();
    std::fs::write(f.join("a.xyz"), format!("{rows}1 2 nan\n")).unwrap();
    for verb in ["classify", "height", "normals", "segment"] {
        let message = fails(f, &[verb, "a.xyz", "-o", "o.laz"], 4);
        assert!(message.contains("point 2000") && message.contains("finite ones only"), "{message}");
        assert!(!message.contains("stay unclassified") && !message.contains("ground:"), "the work was done: {message}");
    }
    done(f, &["height", "a.xyz", "-o", "o.ply"]);
    done(f, &["filter", "a.xyz", "--outliers", "statistical", "-o", "o.laz"]);
}

#[test]
fn pictures_compare_the_same_points_and_find_names_in_any_case() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::write(f.join("a.csv"), "x,y,z,Classification\n0,0,0,2\n1,0,0,5\n0,1,0,2\n").unwrap();
    std::fs::write(f.join("b.csv"), "x,y,z,Classification\n0,0,0,2\n0,1,0,2\n1,0,0,5\n").unwrap();
    done(f, &["render", "a.csv", "--truth", "a.csv", "-o", "o.png"]);
    let message = fails(f, &["render", "a.csv", "--truth", "b.csv", "-o", "p.png"], 4);
    assert!(message.contains("point 1 is at") && message.contains("same order"), "{message}");
    assert!(!f.join("p.png").exists(), "nothing is written");
    for by in ["CLASS", "Height", "classification"] {
        done(f, &["render", "a.csv", "--by", by, "-o", "q.png"]);
    }
    assert!(
        fails(f, &["render", "a.csv", "--by", "klassification", "-o", "r.png"], 4).contains("nearest: Classification")
    );
    // Codes may be changed before the comparison, on both sides or on one; each change may have its colour.
    std::fs::write(f.join("c.csv"), "x,y,z,Classification\n0,0,0,2\n1,0,0,4\n0,1,0,6\n").unwrap();
    done(f, &["render", "a.csv", "--truth", "c.csv", "--changes", "-o", "changes.png"]);
    done(f, &["render", "a.csv", "--truth", "c.csv", "--map", "4=5", "--changes", "-o", "mapped.png"]);
    done(f, &["render", "a.csv", "--truth", "c.csv", "--map-truth", "4=5", "--changes", "-o", "truth.png"]);
    assert_ne!(std::fs::read(f.join("changes.png")).unwrap(), std::fs::read(f.join("mapped.png")).unwrap());
    assert_eq!(std::fs::read(f.join("truth.png")).unwrap(), std::fs::read(f.join("mapped.png")).unwrap());
    fails(f, &["render", "a.csv", "--changes", "-o", "s.png"], 2);
    // Several files in one picture, without what is higher than asked.
    std::fs::write(f.join("d.csv"), "x,y,z,Classification\n5,5,9,6\n").unwrap();
    done(f, &["render", "a.csv", "d.csv", "-o", "both.png"]);
    done(f, &["render", "a.csv", "d.csv", "--clip", "..3", "-o", "low.png"]);
    done(f, &["render", "a.csv", "-o", "alone.png"]);
    assert_eq!(std::fs::read(f.join("low.png")).unwrap(), std::fs::read(f.join("alone.png")).unwrap());
    assert_ne!(std::fs::read(f.join("both.png")).unwrap(), std::fs::read(f.join("alone.png")).unwrap());
}

#[test]
fn a_dimension_of_another_type_is_found_before_points_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(60.0, 1);
    for name in ["Confidence", "ClusterID"] {
        cloud.set_column(Column::new(name, Values::U16(vec![7; cloud.len()]))).unwrap();
    }
    io::write(&f.join("a.laz"), &cloud, &WriteOptions::default()).unwrap();
    // The points cannot be decoded: a command that reads them reports it.
    let mut bytes = std::fs::read(f.join("a.laz")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4000].fill(0xff);
    std::fs::write(f.join("a.laz"), bytes).unwrap();
    for (arguments, dimension) in [
        (vec!["classify", "a.laz", "-o", "o.laz"], "Confidence"),
        (vec!["segment", "a.laz", "-o", "o.laz"], "ClusterID"),
        (vec!["suggest", "a.laz", "-o", "o.csv", "-o", "o.laz"], "ClusterID"),
    ] {
        let message = fails(f, &arguments, 2);
        assert!(message.contains(dimension) && message.contains("another type"), "{message}");
    }
    assert!(fails(f, &["classify", "a.laz", "-o", "o.laz", "--no-extra"], 4).contains("chunk"));
}

/// Waits for the end of a program, up to a time limit.
fn ends_within(mut child: Child, limit: Duration) -> Output {
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begin.elapsed() > limit {
            child.kill().unwrap();
            panic!("still running after {limit:?}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().unwrap()
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    command(folder, arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).stdin(Stdio::piped()).spawn().unwrap()
}

fn make_pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn pipes_devices_and_folders_are_refused_at_once_by_every_reader() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    make_pipe(&f.join("pipe"));
    std::fs::create_dir(f.join("dir")).unwrap();
    for (input, said) in [("pipe", "a pipe"), ("/dev/zero", "a device"), ("/dev/stdin", "a pipe"), ("dir", "a folder")]
    {
        for arguments in [
            vec!["info", input],
            vec!["info", "--salvage", input],
            vec!["convert", input, "o.laz"],
            vec!["merge", "a.laz", input, "o.laz"],
            vec!["diff", "a.laz", input],
            vec!["features", input, "-o", "o.npy"],
            vec!["train", input, "-o", "o.model"],
            vec!["classify", input, "-o", "o.laz"],
            vec!["segment", input, "-o", "o.laz"],
            vec!["suggest", input, "-o", "o.csv"],
            vec!["evaluate", "a.laz", input],
            vec!["render", input, "-o", "o.png"],
        ] {
            let output = ends_within(start(f, &arguments), Duration::from_secs(20));
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(4), "{arguments:?}: {message}");
            assert!(message.contains(said) && message.contains(input), "{arguments:?}: {message}");
        }
        if said != "a pipe" {
            for arguments in [
                vec!["classify", "a.laz", "-o", "o.laz", "-m", input],
                vec!["model", "show", input],
                vec!["train", "a.laz", "-o", "o.model", "--recipe", input],
                vec!["segment", "a.laz", "-o", "o.laz", "--recipe", input],
                vec!["train", "a.laz", "--weak", "-o", "o.model", "--weak-labels", input],
            ] {
                let output = ends_within(start(f, &arguments), Duration::from_secs(20));
                assert_eq!(output.status.code(), Some(4), "{arguments:?}");
                assert!(text(&output.stderr).contains(said), "{arguments:?}: {}", text(&output.stderr));
            }
        }
    }
    assert_eq!(contents(f).len(), 1, "nothing is written");
}

#[test]
fn settings_and_models_come_through_pipes_and_waiting_for_one_ends_with_a_signal() {
    use rustix::process::{Pid, Signal, kill_process};
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    make_pipe(&f.join("pipe"));
    done(f, &train(&["a.laz", "-o", "m.model"]));
    let model = std::fs::read(f.join("m.model")).unwrap();
    let write = |bytes: Vec<u8>| {
        let path = f.join("pipe");
        std::thread::spawn(move || {
            std::fs::OpenOptions::new().write(true).open(path).unwrap().write_all(&bytes).unwrap()
        })
    };
    let child = start(f, &["classify", "a.laz", "-o", "o.laz", "-m", "pipe"]);
    let writer = write(model);
    let output = ends_within(child, Duration::from_secs(60));
    writer.join().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    // The output tells the file name of its model.
    std::fs::create_dir(f.join("models")).unwrap();
    std::fs::copy(f.join("m.model"), f.join("models/pipe")).unwrap();
    done(f, &["classify", "a.laz", "-o", "p.laz", "-m", "models/pipe"]);
    assert!(std::fs::read(f.join("o.laz")).unwrap() == std::fs::read(f.join("p.laz")).unwrap());
    for arguments in
        [&["train", "a.laz", "-o", "n.model", "--recipe", "pipe"][..], &["info", "a.laz", "--scheme", "./pipe"]]
    {
        for (signal, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
            let child = start(f, arguments);
            std::thread::sleep(Duration::from_millis(400));
            kill_process(Pid::from_child(&child), signal).unwrap();
            let output = ends_within(child, Duration::from_secs(5));
            assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", text(&output.stderr));
        }
    }
}

#[test]
fn an_unfinished_output_is_no_input() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    done(f, &train(&["a.laz", "-o", "m.model"]));
    let partial = ".x.laz.1-0000000000000001.partial";
    for (from, commands) in [
        (
            "a.laz",
            vec![
                vec!["info", partial],
                vec!["merge", "a.laz", partial, "o.laz"],
                vec!["render", partial, "-o", "o.png"],
                vec!["info", "--salvage", partial],
            ],
        ),
        ("m.model", vec![vec!["classify", "a.laz", "-o", "o.laz", "-m", partial]]),
    ] {
        std::fs::copy(f.join(from), f.join(partial)).unwrap();
        for arguments in commands {
            assert!(fails(f, &arguments, 4).contains("never finished"), "{arguments:?}");
        }
    }
}

#[test]
fn info_tells_of_the_good_files_when_one_is_bad() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for name in ["a.laz", "c.ply"] {
        io::write(&f.join(name), &street(12.0, 1), &WriteOptions::default()).unwrap();
    }
    std::fs::write(f.join("b.laz"), b"LASF and no more").unwrap();
    for arguments in [
        &["info", "a.laz", "b.laz", "c.ply"][..],
        &["info", "--stats", "a.laz", "b.laz", "c.ply"],
        &["info", "--salvage", "a.laz", "b.laz", "c.ply"],
    ] {
        let output = scansion(f, arguments);
        assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
        let (shown, said) = (text(&output.stdout), text(&output.stderr));
        assert!(shown.contains("a.laz") && shown.contains("c.ply") && !shown.contains("b.laz"), "{shown}");
        assert!(said.contains("b.laz") && said.contains("1 of 3"), "{said}");
    }
    let output = scansion(f, &["info", "--json", "a.laz", "b.laz"]);
    let list: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(list.as_array().unwrap().len(), 1);
    fails(f, &["info", "b.laz"], 4);
    fails(f, &["info", "b.laz", "b.laz"], 4);
}

#[test]
fn a_file_that_is_replaced_between_reading_and_writing_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let cloud = street(20.0, 1);
    let reversed = cloud.select(&(0..cloud.len() as u32).rev().collect::<Vec<_>>());
    let options = WriteOptions::default();
    let edits = [Edit::Classification(vec![2; cloud.len()])];
    for name in ["a.las", "a.laz", "a.ply", "a.csv", "a.npz"] {
        let (input, output) = (path(name), path("out.laz"));
        let as_one_run = |between: &dyn Fn()| {
            run(Rules::default(), || {
                io::read(&input)?;
                between();
                io::rewrite(&input, &output, &edits, &options)
            })
        };
        io::write(&input, &cloud, &options).unwrap();
        as_one_run(&|| ()).unwrap();
        std::fs::remove_file(&output).unwrap();
        let other = path(&format!("other.{}", name.rsplit_once('.').unwrap().1));
        io::write(&input, &cloud, &options).unwrap();
        io::write(&other, &reversed, &options).unwrap();
        let error = as_one_run(&|| std::fs::rename(&other, &input).unwrap()).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("changed while it was read"), "{error}");
        assert!(!output.exists(), "{name}");
    }
    // Without an enclosing run two calls are independent.
    io::write(&path("a.las"), &cloud, &options).unwrap();
    io::rewrite(&path("a.las"), &path("a.las"), &edits, &options).unwrap();
    let refused = Rules { replace: Replace::Refused("no"), ..Rules::default() };
    let error = run(refused, || io::rewrite(&path("a.las"), &path("a.las"), &edits, &options)).unwrap_err();
    assert!(error.to_string().contains("input and output"), "{error}");
}

#[test]
fn what_files_say_cannot_act_on_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let ply = |property: &str, more: &str| {
        format!(
            "ply\nformat ascii 1.0\n{more}element vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty float {property}\nend_header\n1 2 3 4\n"
        )
    };
    std::fs::write(f.join("a.ply"), ply("a\u{1b}[31mb\u{9b}2J", "")).unwrap();
    std::fs::write(f.join("b.ply"), ply("a", "bad\u{1b}]0;title\u{7}\n")).unwrap();
    for arguments in [
        &["info", "a.ply"][..],
        &["info", "--json", "a.ply"],
        &["info", "--stats", "a.ply"],
        &["convert", "a.ply", "a.laz"],
        &["info", "b.ply"],
    ] {
        let output = scansion(f, arguments);
        let shown = text(&output.stdout) + &text(&output.stderr);
        assert!(!shown.chars().any(|c| c.is_control() && c != '\n'), "{arguments:?}: {shown:?}");
        assert!(shown.contains("\\u001b"), "{arguments:?}: {shown}");
    }
    let list: serde_json::Value = serde_json::from_slice(&scansion(f, &["info", "--json", "a.ply"]).stdout).unwrap();
    assert_eq!(list[0]["dimensions"][0], "a\u{1b}[31mb\u{9b}2J", "JSON says the same with escapes");
}

/// LAS 1.5 as specified by ASPRS: 18 more header bytes (range of GPS times, time offset), everything else as in 1.4.
fn las_1_5(path: &Path, cloud: &Cloud, offset: Option<u16>) {
    io::write(path, cloud, &WriteOptions::default()).unwrap();
    let mut bytes = std::fs::read(path).unwrap();
    bytes[25] = 5;
    bytes[94..96].copy_from_slice(&393u16.to_le_bytes());
    let points_at = u32::from_le_bytes(bytes[96..100].try_into().unwrap());
    bytes[96..100].copy_from_slice(&(points_at + 18).to_le_bytes());
    if let Some(offset) = offset {
        bytes[6] = bytes[6] & !1 | 64;
        bytes.splice(375..375, offset.to_le_bytes());
        bytes.splice(375..375, [0; 16]);
    } else {
        bytes.splice(375..375, [0; 18]);
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn las_1_5_is_read_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(12.0, 1);
    let times = (0..cloud.len()).map(|i| i as f64 * 1e-3).collect();
    cloud.set_column(Column::new("GpsTime", Values::F64(times))).unwrap();
    io::write(&f.join("four.las"), &cloud, &WriteOptions::default()).unwrap();
    las_1_5(&f.join("a.las"), &cloud, Some(1400));
    las_1_5(&f.join("b.las"), &cloud, None);
    let (four, five) = (io::read(&f.join("four.las")).unwrap(), io::read(&f.join("a.las")).unwrap());
    assert!(four == five);
    let shown = done(f, &["info", "a.las"]);
    assert!(shown.contains("LAS 1.5") && shown.contains("1400 million seconds"), "{shown}");
    done(f, &["convert", "a.las", "a.laz"]);
    done(f, &["convert", "a.laz", "back.las"]);
    assert!(std::fs::read(f.join("a.las")).unwrap() == std::fs::read(f.join("back.las")).unwrap());
    done(f, &["merge", "a.las", "a.laz", "both.laz"]);
    assert!(fails(f, &["merge", "a.las", "b.las", "c.laz"], 4).contains("kind of GPS time"));
    done(f, &["info", "--salvage", "a.las"]);
    let mut bytes = std::fs::read(f.join("a.las")).unwrap();
    bytes[25] = 6;
    std::fs::write(f.join("six.las"), bytes).unwrap();
    assert!(fails(f, &["info", "six.las"], 4).contains("found 1.6, allowed 1.0 to 1.5"));
}

#[test]
fn two_axes_of_one_name_are_named_with_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float X\nproperty float y\nproperty float z\nend_header\n1 2 3 4\n";
    std::fs::write(f.join("xX.ply"), ply).unwrap();
    for command in [&["info", "xX.ply"][..], &["convert", "xX.ply", "o.laz"]] {
        let message = fails(f, command, 4);
        assert!(message.contains("xX.ply") && message.contains("`x` and `X`"), "{message}");
    }
}

#[test]
fn the_advice_about_waveforms_can_be_followed() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for name in ["a.las", "b.las"] {
        let mut builder = las::Builder::from((1, 4));
        builder.point_format = las::point::Format::new(9).unwrap();
        let mut writer = las::Writer::from_path(f.join(name), builder.into_header().unwrap()).unwrap();
        for i in 0..50 {
            let point = las::Point {
                x: f64::from(i),
                gps_time: Some(1.0),
                waveform: Some(Default::default()),
                ..Default::default()
            };
            writer.write_point(point).unwrap();
        }
        writer.close().unwrap();
    }
    let message = fails(f, &["merge", "a.las", "b.las", "o.laz"], 4);
    assert!(message.contains("merge into .npz"), "{message}");
    done(f, &["merge", "a.las", "b.las", "o.npz"]);
    done(f, &["convert", "o.npz", "o.laz"]);
    let merged = io::read(&f.join("o.laz")).unwrap();
    assert_eq!(merged.len(), 100);
    assert_eq!(merged.column("GpsTime").unwrap().values.get(99), 1.0);
}

#[test]
fn an_output_through_a_link_to_nothing_makes_its_target() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    symlink("real.laz", f.join("link.laz")).unwrap();
    done(f, &["convert", "a.laz", "link.laz"]);
    assert!(f.join("link.laz").is_symlink() && f.join("real.laz").is_file());
    // With several inputs COPC names become plain ones.
    std::fs::copy(f.join("a.laz"), f.join("b.copc.laz")).unwrap();
    done(f, &["classify", "a.laz", "b.copc.laz", "-o", "out"]);
    assert!(f.join("out/b.laz").is_file());
    let names: Vec<_> = std::fs::read_dir(f.join("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
}

#[test]
fn what_exists_is_replaced_only_if_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("a.laz"), &street(15.0, 2), &Default::default()).unwrap();
    let train = ["train", "a.laz", "-o", "a.model", "--set", "forest.trees=2", "--set", "features.pyramid.levels=2"];
    assert_eq!(scansion(f, &train).status.code(), Some(0));
    let verbs: [&[&str]; 8] = [
        &["convert", "a.laz", "o.laz"],
        &["classify", "a.laz", "-m", "a.model", "-o", "o.laz"],
        &["segment", "a.laz", "-o", "o.laz"],
        &["features", "a.laz", "-o", "o.csv"],
        &["render", "a.laz", "-o", "o.png"],
        &["evaluate", "a.laz", "a.laz", "-o", "o.json"],
        &["suggest", "a.laz", "-n", "3", "-o", "o.csv"],
        &["train", "a.laz", "-o", "a.model"],
    ];
    for name in ["o.laz", "o.csv", "o.png", "o.json"] {
        std::fs::write(f.join(name), "kept").unwrap();
    }
    let model = std::fs::read(f.join("a.model")).unwrap();
    for verb in verbs {
        let output = scansion(f, verb);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{verb:?}: {message}");
        assert!(message.contains("it exists; use --overwrite to replace it"), "{verb:?}: {message}");
    }
    for name in ["o.laz", "o.csv", "o.png", "o.json"] {
        assert_eq!(std::fs::read(f.join(name)).unwrap(), b"kept");
    }
    assert_eq!(std::fs::read(f.join("a.model")).unwrap(), model);
    assert_eq!(scansion(f, &["convert", "a.laz", "o.laz", "--overwrite"]).status.code(), Some(0));
    assert!(std::fs::read(f.join("o.laz")).unwrap().starts_with(b"LASF"));
}

#[test]
fn a_training_goes_on_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    let train = ["train", "a.laz", "--recipe", "unet", "--checkpoint", "c.check", "-o", "m.model"];
    let small = ["--set", "learning.steps=2", "--set", "network.widths=[4,4]", "--set", "voxel=1"];
    let arguments = [&train[..], &small].concat();
    assert_eq!(scansion(f, &arguments).status.code(), Some(0));
    let model = std::fs::read(f.join("m.model")).unwrap();
    std::fs::remove_file(f.join("m.model")).unwrap();
    assert_eq!(scansion(f, &arguments).status.code(), Some(0), "without --overwrite");
    assert!(std::fs::read(f.join("m.model")).unwrap() == model);
    done(f, &arguments);
    // Another file is no checkpoint, and stays as it is.
    let cloud = std::fs::read(f.join("a.laz")).unwrap();
    std::fs::copy(f.join("a.laz"), f.join("b.laz")).unwrap();
    let mut wrong = arguments;
    wrong[5] = "b.laz";
    fails(f, &[&wrong[..], &["--overwrite"]].concat(), 4);
    assert!(std::fs::read(f.join("b.laz")).unwrap() == cloud);
}

#[test]
fn merge_takes_no_existing_file_for_its_output_unless_named() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = street(12.0, 1);
    for name in ["t1.laz", "t2.laz", "t3.laz"] {
        io::write(&f.join(name), &cloud, &WriteOptions::default()).unwrap();
    }
    let before = contents(f);
    for arguments in [["merge", "t1.laz", "t2.laz", "t3.laz"].as_slice(), &["merge", "t1.laz", "t3.laz"]] {
        for overwrite in [&[][..], &["--overwrite"]] {
            let message = fails(f, &[arguments, overwrite].concat(), 2);
            assert!(message.contains("t3.laz") && message.contains("exists"), "{message}");
        }
    }
    assert!(fails(f, &["merge", "t1.laz", "all.laz"], 2).contains("two inputs"));
    assert!(contents(f) == before);
    done(f, &["merge", "t*.laz", "-o", "all.laz"]);
    assert_eq!(io::inspect(&f.join("all.laz")).unwrap().points, 3 * cloud.len() as u64);
    done(f, &["merge", "t1.laz", "t2.laz", "-o", "all.laz"]);
    assert_eq!(io::inspect(&f.join("all.laz")).unwrap().points, 2 * cloud.len() as u64);
}

#[test]
fn a_batch_skips_what_is_done_and_its_table_has_one_header() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for name in ["a.laz", "b.laz", "c.laz"] {
        io::write(&f.join(name), &street(12.0, 1), &WriteOptions::default()).unwrap();
    }
    done(f, &train(&["a.laz", "-o", "m.model"]));
    std::fs::create_dir(f.join("out")).unwrap();
    std::fs::write(f.join("out/a.laz"), "done before").unwrap();
    let batch = ["classify", "a.laz", "b.laz", "c.laz", "-m", "m.model", "-o", "out", "--format", "csv"];
    let found = scansion(f, &[&batch[..], &["--skip-existing", "--map", "5=4"]].concat());
    assert_eq!(found.status.code(), Some(0), "{}", text(&found.stderr));
    assert_eq!(text(&found.stdout).matches("file,code").count(), 1);
    assert!(text(&found.stderr).contains("out/a.laz: it exists and is skipped"));
    assert_eq!(std::fs::read(f.join("out/a.laz")).unwrap(), b"done before");
    assert!(io::inspect(&f.join("out/c.laz")).is_ok());
    assert_eq!(scansion(f, &batch).status.code(), Some(4), "all outputs exist");
}

#[test]
fn names_stand_for_codes_units_and_the_built_in_model() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    done(f, &["filter", "a.laz", "-o", "b.laz", "--classes", "building,2"]);
    done(f, &["filter", "a.laz", "-o", "c.laz", "--classes", "6,2"]);
    assert!(std::fs::read(f.join("b.laz")).unwrap() == std::fs::read(f.join("c.laz")).unwrap());
    assert!(scansion(f, &["filter", "a.laz", "-o", "d.laz", "--classes", "vegetation"]).status.code() == Some(2));
    done(f, &["classify", "a.laz", "-o", "d.laz", "--force", "-m", "built-in", "--unit", "metres"]);
    done(f, &["classify", "a.laz", "-o", "e.laz", "--force"]);
    assert!(io::read(&f.join("d.laz")).unwrap() == io::read(&f.join("e.laz")).unwrap());
    assert!(fails(f, &["train", "a.laz", "--recipe", "piramid", "-o", "m.model"], 2).contains("pyramid, "));
    assert!(fails(f, &["train", "a.laz", "-o", "new.laz"], 4).contains("extension is that of clouds"));
    assert!(fails(f, &["classify", "a.laz", "-m", "b.laz", "-o", "f.laz"], 4).contains("not a model"));
}

/// Points on level ground along a road of 100 m: even, or fewer and fewer away from it, as from a scanner on the road.
fn road(even: bool) -> Cloud {
    let place = |i: u32, step: f64| (f64::from(i) * step).fract();
    let point = |i: u32| {
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let away =
            if even { 60.0 * place(i, 0.569_840_291) } else { -15.0 * (1.0 - 0.98 * place(i, 0.569_840_291)).ln() };
        [side * away, 100.0 * place(i, 0.754_877_666), 0.02 * place(i, 0.618_033_989)]
    };
    Cloud::from_rows(&(0..60_000).map(point).collect::<Vec<_>>()).unwrap()
}

#[test]
fn the_built_in_model_refuses_scans_from_the_ground() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("even.laz"), &road(true), &WriteOptions::default()).unwrap();
    io::write(&f.join("ground.laz"), &road(false), &WriteOptions::default()).unwrap();
    done(f, &["classify", "even.laz", "-o", "a.laz"]);
    let text = fails(f, &["classify", "ground.laz", "-o", "b.laz"], 4);
    assert!(text.contains("as around a scanner on the ground") && text.contains("--force"), "{text}");
    assert!(!f.join("b.laz").exists());
    done(f, &["classify", "ground.laz", "-o", "b.laz", "--force"]);
}

#[test]
fn the_built_in_model_says_what_it_has_no_class_for() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(12.0, 1), &WriteOptions::default()).unwrap();
    done(f, &train(&["a.laz", "-o", "m.model"]));
    let told = |rest: &[&str]| PROGRAM.ends(f, &[&["classify", "a.laz", "-o", "b.laz", "--force"], rest].concat(), 0).1;
    let limits = "the built-in model has no class for bridges, masts, water and cars, which become ground, building or \
                  vegetation; ";
    let says = |rest: &[&str], found: &str| {
        let err = told(rest);
        let text = format!("{limits}{found}; `scansion train` makes models with other classes");
        assert_eq!(err.matches(&text).count(), 1, "{rest:?}: {err}");
    };
    let all = "cars, water and decks of bridges that are found become unclassified";
    recipes::default_model().unwrap().save(&f.join("copy.model")).unwrap();
    for same in [&[][..], &["-m", "built-in"], &["-m", "copy.model"]] {
        says(same, all);
    }
    let mut off = vec!["--set", "classes.water.named=true"];
    says(&off, "cars and decks of bridges that are found become unclassified, water that is found becomes water (9)");
    off.extend(["--set", "classes.decks.length=0", "--set", "classes.water.area=0"]);
    says(&off, "cars that are found become unclassified, not looked for: water and decks of bridges");
    off.extend(["--set", "classes.cars.points=0"]);
    says(&off, "not looked for: cars, water and decks of bridges");
    for other in [
        &["evaluate", "a.laz", "-m", "copy.model"][..],
        &["suggest", "a.laz", "-m", "built-in", "-n", "3", "-o", "s.csv"],
        &["model", "show"],
        &["model", "show", "copy.model", "--format", "json"],
    ] {
        assert!(PROGRAM.ends(f, other, 0).1.contains(&format!("{limits}{all}")), "{other:?}");
    }
    assert!(!PROGRAM.ends(f, &["model", "show", "m.model"], 0).1.contains("no class for bridges"));
    let skipped = text(&scansion(f, &["classify", "a.laz", "-o", "b.laz", "--skip-existing"]).stderr);
    assert!(skipped.contains("it exists and is skipped") && !skipped.contains("no class for bridges"), "{skipped}");
    assert!(!told(&["-m", "m.model"]).contains("no class for bridges"));
    assert!(!told(&["--quiet"]).contains("no class for bridges"));
}

#[test]
fn classes_written_alone_or_over_a_dimension_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = street(12.0, 1);
    cloud.set_column(Column::new("Own", Values::U8(vec![9; cloud.len()]))).unwrap();
    io::write(&f.join("a.laz"), &cloud, &WriteOptions::default()).unwrap();
    done(f, &train(&["a.laz", "-o", "m.model"]));
    let told = |rest: &[&str]| PROGRAM.ends(f, &[&["classify", "a.laz", "-m", "m.model"][..], rest].concat(), 0).1;
    for output in ["o.labels", "o.label"] {
        assert!(told(&["-o", output]).contains("not kept: all but the classes"), "{output}");
    }
    let note = "it has a dimension Own, which the classes replace in the output";
    assert!(told(&["-o", "o.laz", "--to", "Own"]).contains(note));
    assert!(!told(&["-o", "o.laz", "--to", "New"]).contains("which the classes replace"));
    assert!(!told(&["-o", "o.laz"]).contains("which the classes replace"));
}
