//! However and whenever the program is ended, the output is absent, old or complete; a signal that can be caught leaves
//! nothing behind and ends the program at once. `SCANSION_KILLS=200` sets the number of kills.

use rustix::process::{Pid, Signal, kill_process};
use scansion_core::random::stream;
use scansion_tests::street;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_scansion-under-test"))
        .args(arguments)
        .args(["--progress", "never", "-j", "2", "--overwrite"])
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn partials(folder: &Path) -> Vec<std::path::PathBuf> {
    let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    names.filter(|p| p.extension().is_some_and(|e| e == "partial")).collect()
}

#[test]
fn a_killed_program_leaves_the_old_output_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("in.laz"), &street(110.0, 1), &Default::default()).unwrap();
    let convert = ["convert", "in.laz", "out.laz"];
    let begin = Instant::now();
    assert!(start(f, &convert).wait().unwrap().success());
    let time = begin.elapsed();
    let new = std::fs::read(f.join("out.laz")).unwrap();
    let old = b"what stood here before".to_vec();
    let kills: u32 = std::env::var("SCANSION_KILLS").ok().and_then(|v| v.parse().ok()).unwrap_or(40);
    let (mut random, mut caught) = (stream(5, 0), [0u32; 3]);
    for kill in 0..kills {
        match kill % 2 {
            0 => std::fs::write(f.join("out.laz"), &old).unwrap(),
            _ => std::fs::remove_file(f.join("out.laz")).unwrap_or(()),
        }
        let mut child = start(f, &convert);
        std::thread::sleep(time.mul_f64(1.1 * random.uniform()));
        child.kill().unwrap();
        child.wait().unwrap();
        let found = std::fs::read(f.join("out.laz")).ok();
        let state = match &found {
            None if kill % 2 == 1 => 0,
            Some(bytes) if *bytes == old && kill % 2 == 0 => 1,
            Some(bytes) if *bytes == new => 2,
            other => panic!("kill {kill}: {:?} bytes", other.as_ref().map(Vec::len)),
        };
        caught[state] += 1;
        partials(f).iter().for_each(|p| std::fs::remove_file(p).unwrap());
    }
    eprintln!("{kills} kills within {time:?}: absent {}, old {}, complete {}", caught[0], caught[1], caught[2]);
    assert!(caught[0] + caught[1] > 0, "every run was over before it was killed");
}

/// A command, and the files that it writes.
type Verb = (&'static [&'static str], &'static [&'static str]);

/// Every command that writes.
const VERBS: [Verb; 21] = [
    (&["convert", "in.laz", "o.las"], &["o.las"]),
    (&["convert", "in.laz", "o.npz"], &["o.npz"]),
    (&["merge", "in.laz", "in.laz", "-o", "o.laz"], &["o.laz"]),
    (&["classify", "in.laz", "-o", "o.laz", "-m", "in.model"], &["o.laz"]),
    (&["segment", "in.laz", "-o", "o.laz"], &["o.laz"]),
    (&["suggest", "in.laz", "-n", "5", "-o", "o.csv", "-o", "o.html", "-o", "o.laz"], &["o.csv", "o.html", "o.laz"]),
    (&["features", "in.laz", "-o", "o.npy", "--set", "features.pyramid.levels=2"], &["o.npy"]),
    (&["features", "in.laz", "-o", "o.laz", "--set", "features.pyramid.levels=2"], &["o.laz"]),
    (
        &["train", "in.laz", "-o", "o.model", "--set", "forest.trees=3", "--set", "features.pyramid.levels=2"],
        &["o.model"],
    ),
    (&["evaluate", "in.laz", "in.laz", "-o", "o.json", "-o", "o.csv", "-o", "o.png"], &["o.json", "o.csv", "o.png"]),
    (&["render", "in.laz", "-o", "o.png", "--width", "600"], &["o.png", "o.pgw"]),
    (&["convert", "--salvage", "in.laz", "o.laz"], &["o.laz"]),
    (&["classify", "in.laz", "-o", "o.npz", "-m", "in.model"], &["o.npz"]),
    (&["regularize", "p.laz", "-o", "o.laz"], &["o.laz"]),
    (&["height", "in.laz", "-o", "o.laz"], &["o.laz"]),
    (&["normals", "in.laz", "-o", "o.laz"], &["o.laz"]),
    (&["filter", "in.laz", "-o", "o.laz", "--classes", "2,6"], &["o.laz"]),
    (&["terrain", "in.laz", "-o", "o.tif", "--dsm", "o.asc"], &["o.tif", "o.asc"]),
    (
        &["terrain", "in.laz", "--footprints", "o.gpkg", "--contours", "o.geojson", "--interval", "0.1"],
        &["o.gpkg", "o.geojson"],
    ),
    (&["contours", "in.laz", "-o", "o.dxf"], &["o.dxf"]),
    (&["contours", "in.laz", "-o", "o.gpkg"], &["o.gpkg"]),
];

/// A folder with an input, its probabilities and a model, and the content of each output before a run.
fn prepared() -> (tempfile::TempDir, impl Fn(&str) -> Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("in.laz"), &street(25.0, 1), &Default::default()).unwrap();
    let train = ["train", "in.laz", "-o", "in.model", "--set", "forest.trees=2", "--set", "features.pyramid.levels=3"];
    assert!(start(f, &train).wait().unwrap().success());
    let probabilities = ["classify", "in.laz", "-o", "p.laz", "-m", "in.model", "--probabilities"];
    assert!(start(f, &probabilities).wait().unwrap().success());
    // A model may only replace a model.
    let model = std::fs::read(f.join("in.model")).unwrap();
    (folder, move |name: &str| if name.ends_with("model") { model.clone() } else { b"what stood here before".to_vec() })
}

/// The output of each command without interruption, and how long it takes.
fn undisturbed(folder: &Path, (arguments, outputs): Verb) -> (Vec<Vec<u8>>, Duration) {
    let begin = Instant::now();
    assert!(start(folder, arguments).wait().unwrap().success(), "{arguments:?}");
    let time = begin.elapsed();
    let read = |name: &&str| {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        std::fs::remove_file(folder.join(name)).unwrap();
        bytes
    };
    (outputs.iter().map(read).collect(), time)
}

#[test]
fn every_command_that_is_killed_leaves_old_outputs_or_whole_ones() {
    let (folder, old) = prepared();
    let f = folder.path();
    let kills: u32 = std::env::var("SCANSION_KILLS").ok().and_then(|v| v.parse().ok()).unwrap_or(40);
    let each = (kills / VERBS.len() as u32).max(2);
    let (mut random, mut disturbed) = (stream(6, 0), 0);
    for verb in VERBS {
        let (new, time) = undisturbed(f, verb);
        for kill in 0..each {
            let before = |name: &str| (kill % 2 == 0).then(|| old(name));
            for name in verb.1 {
                before(name).into_iter().for_each(|bytes| std::fs::write(f.join(name), bytes).unwrap());
            }
            let mut child = start(f, verb.0);
            std::thread::sleep(time.mul_f64(1.1 * random.uniform()));
            child.kill().unwrap();
            child.wait().unwrap();
            for (name, new) in verb.1.iter().zip(&new) {
                let found = std::fs::read(f.join(name)).ok();
                let whole = found.as_ref() == Some(new);
                assert!(whole || found == before(name), "{verb:?}, kill {kill}: {name} is neither old nor whole");
                disturbed += u32::from(!whole);
                let _ = std::fs::remove_file(f.join(name));
            }
            partials(f).iter().for_each(|p| std::fs::remove_file(p).unwrap());
        }
    }
    assert!(disturbed > 0, "every run was over before it was killed");
}

/// Runs a command that may write only this many blocks to files: writing more fails as on a full disk.
fn with_room(folder: &Path, arguments: &[&str], blocks: usize) -> std::process::Output {
    Command::new("sh")
        .args(["-c", &format!("ulimit -f {blocks}; exec \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_scansion-under-test"))
        .args(arguments)
        .args(["--progress", "never", "-j", "2", "--overwrite"])
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn every_command_that_finds_no_room_leaves_old_outputs_or_whole_ones() {
    let (folder, old) = prepared();
    let f = folder.path();
    for verb in VERBS {
        let (new, _) = undisturbed(f, verb);
        let largest = new.iter().map(Vec::len).max().unwrap();
        // The unit of `ulimit -f` is 512 or 1024 bytes.
        for blocks in [0, largest / 4096] {
            let count = std::fs::read_dir(f).unwrap().count();
            verb.1.iter().for_each(|name| std::fs::write(f.join(name), old(name)).unwrap());
            let output = with_room(f, verb.0, blocks);
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(1), "{verb:?} with {blocks} blocks: {message}");
            assert!(message.contains("error: o."), "{verb:?}: {message}");
            for (name, new) in verb.1.iter().zip(&new) {
                let found = std::fs::read(f.join(name)).unwrap();
                assert!(found == old(name) || found == *new, "{verb:?} with {blocks} blocks: {name}");
                std::fs::remove_file(f.join(name)).unwrap();
            }
            assert_eq!(std::fs::read_dir(f).unwrap().count(), count, "{verb:?}: something is left");
        }
    }
}

/// Sends a signal as soon as `ready` says so; returns exit code and time to the end.
fn signalled(mut child: Child, signal: Signal, ready: impl Fn() -> bool) -> (Option<i32>, Duration) {
    let begin = Instant::now();
    while !ready() && begin.elapsed() < Duration::from_secs(20) && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = Instant::now();
    // The process may have ended already.
    let _ = kill_process(Pid::from_child(&child), signal);
    (child.wait().unwrap().code(), sent.elapsed())
}

#[test]
fn a_signal_ends_the_program_at_once_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("in.laz"), &street(170.0, 1), &Default::default()).unwrap();
    let before = std::fs::read_dir(f).unwrap().count();
    let (mut interrupted, mut slowest) = (0, Duration::ZERO);
    for (round, (signal, code)) in [(Signal::INT, 130), (Signal::TERM, 143)].repeat(6).into_iter().enumerate() {
        // While it writes, and while it computes.
        let (child, computes) = match round / 2 {
            0 => (start(f, &["convert", "in.laz", "out.laz"]), None),
            1 => (start(f, &["merge", "in.laz", "in.laz", "in.laz", "out.las"]), None),
            2 => (start(f, &["convert", "in.laz", "out.csv"]), None),
            3 => (start(f, &["convert", "in.laz", "out.ply"]), None),
            4 => (start(f, &["render", "in.laz", "-o", "out.png", "--width", "8000"]), Some(300)),
            _ => (start(f, &["classify", "in.laz", "-o", "out.laz"]), Some(700)),
        };
        let begin = Instant::now();
        let ready = || match computes {
            Some(time) => begin.elapsed() > Duration::from_millis(time),
            None => !partials(f).is_empty(),
        };
        let (found, time) = signalled(child, signal, ready);
        if found == Some(code) {
            interrupted += 1;
            eprintln!("round {round}: ended after {time:?}");
            slowest = slowest.max(time);
            assert_eq!(std::fs::read_dir(f).unwrap().count(), before, "round {round}: something is left");
        } else {
            assert_eq!(found, Some(0), "round {round}");
            let outputs = ["out.laz", "out.las", "out.csv", "out.ply", "out.png", "out.pgw"];
            outputs.iter().for_each(|n| std::fs::remove_file(f.join(n)).unwrap_or(()));
        }
    }
    eprintln!("{interrupted} of 12 runs interrupted, the slowest ended after {slowest:?}");
    assert!(interrupted >= 4, "only {interrupted} runs were caught at work");
    // One second is promised; a busy machine is given more.
    assert!(slowest < Duration::from_secs(3), "{slowest:?}");
}
