//! Resource limits: time linear in names and columns, memory checked before it is allocated; too little memory is an
//! error with exit code 1 that leaves nothing behind.

use scansion_core::io;
use scansion_tests::{demo_scan, street};
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// The goal is two seconds; busy machines and debug builds are given more.
const SOON: Duration = Duration::from_secs(15);

/// The time after which the system ends a run: one that hangs fails its test and holds up nothing.
const AT_MOST: &str = "120";

/// Runs the program with this many kilobytes of address space (code, stacks and heap).
fn limited(kilobytes: u64, folder: &Path, arguments: &[&str]) -> Output {
    let limit = format!("ulimit -v {kilobytes}; exec \"$0\" --progress never -j 1 --overwrite \"$@\"");
    Command::new("timeout")
        .args(["--signal=KILL", AT_MOST, "sh", "-c", &limit, env!("CARGO_BIN_EXE_scansion-under-test")])
        .args(arguments)
        .env("MALLOC_ARENA_MAX", "1")
        .env_remove("RUST_BACKTRACE")
        .current_dir(folder)
        .output()
        .unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs the program in 384 MB; it must end within the time limit, with that exit code and without a panic.
fn soon(folder: &Path, arguments: &[&str], code: i32) -> String {
    let begin = Instant::now();
    let output = limited(393_216, folder, arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(!text.contains("internal error") && !text.contains("panicked"), "{arguments:?}: {text}");
    assert!(begin.elapsed() < SOON, "{arguments:?}: {:?}", begin.elapsed());
    text
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        folder.read_dir().unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A LAS 1.4 file of 10 points with `count` one-byte dimensions of the same name.
fn equal_names(count: usize) -> Vec<u8> {
    let mut vlrs = Vec::new();
    for first in (0..count).step_by(341) {
        let here = 341.min(count - first);
        let mut head = [0; 54];
        head[2..11].copy_from_slice(b"LASF_Spec");
        head[18] = 4;
        head[20..22].copy_from_slice(&(192 * here as u16).to_le_bytes());
        vlrs.extend(head);
        let mut block = [0; 192];
        (block[2], block[4]) = (1, b'a');
        (0..here).for_each(|_| vlrs.extend(block));
    }
    let mut raw = vec![0; 375];
    let mut put = |at: usize, bytes: &[u8]| raw[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"LASF");
    put(24, &[1, 4]);
    put(94, &375u16.to_le_bytes());
    put(96, &(375 + vlrs.len() as u32).to_le_bytes());
    put(100, &(count.div_ceil(341) as u32).to_le_bytes());
    put(104, &[6]);
    put(105, &(30 + count as u16).to_le_bytes());
    put(247, &10u64.to_le_bytes());
    (0..3).for_each(|a| put(131 + 8 * a, &0.01f64.to_le_bytes()));
    [raw, vlrs, vec![0; 10 * (30 + count)]].concat()
}

#[test]
fn thousands_of_columns_and_equal_names_take_no_longer_than_their_number() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::write(f.join("a.las"), equal_names(5000)).unwrap();
    let many = |word: &str, n: usize| vec![word; n].join(" ");
    let (head, kinds) = (many("a", 4093), many("1", 4096));
    let pcd = format!(
        "VERSION 0.7\nFIELDS x y z {head}\nSIZE {kinds}\nTYPE {}\nCOUNT {kinds}\nPOINTS 2\nDATA binary\n",
        many("U", 4096)
    );
    std::fs::write(f.join("a.pcd"), [pcd.as_bytes(), &[7; 2 * 4096]].concat()).unwrap();
    std::fs::write(f.join("a.xyz"), many("1", 60_000) + "\n" + &many("2", 60_000)).unwrap();
    for file in ["a.las", "a.pcd", "a.xyz"] {
        soon(f, &["info", "--stats", file], 0);
        soon(f, &["diff", file, file], 0);
        soon(f, &["convert", file, "b.npz"], 0);
    }
    assert_eq!(io::read(&f.join("b.npz")).unwrap().columns().len(), 60_000 - 3);
    for output in ["c.ply", "c.pcd"] {
        let text = soon(f, &["convert", "a.xyz", output], 4);
        assert!(text.contains(&format!("{output}: ")) && text.contains("59997 columns"), "{text}");
        assert!(!text.contains("partial") && !f.join(output).exists(), "{text}");
    }
    // Columns of one name are told as they are read.
    for file in ["a.las", "a.pcd"] {
        let read: Vec<String> = io::read(&f.join(file)).unwrap().columns().iter().map(|c| c.name.clone()).collect();
        assert!(read.contains(&"a".to_string()) && read.contains(&"a_2".to_string()));
        assert_eq!(io::inspect(&f.join(file)).unwrap().dimensions, read, "{file}");
    }
    soon(f, &["merge", "a.las", "a.las", "b.las"], 0);
    std::fs::write(f.join("wide.xyz"), many("1", 200_000)).unwrap();
    for command in [&["info", "wide.xyz"][..], &["convert", "wide.xyz", "c.npz"]] {
        let text = soon(f, command, 4);
        assert!(text.contains("wide.xyz") && text.contains("found 200000, allowed at most 65536"), "{text}");
    }
}

#[test]
fn small_files_that_unpack_to_much_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    // 100 scans of a million points whose fields are all constant: they take no bytes at all.
    let scans = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/constant-scans.e57");
    std::fs::copy(scans, f.join("a.e57")).unwrap();
    let text = soon(f, &["convert", "a.e57", "b.ply"], 4);
    assert!(text.contains("recordCount at scan 1 (found 1000000, allowed at most 0"), "{text}");
    // Lines without numbers take no memory, however many columns there are.
    let text = vec!["1"; 1000].join(" ") + &"\n".repeat(3 << 20);
    std::fs::write(f.join("a.xyz"), text).unwrap();
    soon(f, &["info", "--stats", "a.xyz"], 0);
    assert_eq!(names(f), ["a.e57", "a.xyz"]);
}

/// The damaged GPS times of these points change their sequence without end (vendor/README.md): of point format 1, of point
/// format 6, whose chunks have layers, and of a COPC file that is damaged elsewhere, too.
#[test]
fn points_that_would_use_up_the_stack_are_lost_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let damaged = [
        ("endless-gps.laz", "35 of 40 points are lost, 5 are read"),
        ("endless-layers.laz", "190 of 800 points are lost, 610 are read"),
        ("endless-gps.copc.laz", "27 of 28 points are lost, 1 are read"),
    ];
    for (name, lost) in damaged {
        std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name), f.join(name)).unwrap();
        soon(f, &["convert", name, "b.las"], 4);
        let text = soon(f, &["convert", "--salvage", "--overwrite", name, "b.las"], 0);
        assert!(text.contains(lost), "{name}: {text}");
    }
}

#[test]
fn deep_settings_and_places_far_away_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(20.0, 3), &Default::default()).unwrap();
    let deep = vec!["a"; 60_000].join(".") + "=1";
    let text = soon(f, &["train", "a.laz", "-o", "o.model", "--set", &deep], 2);
    assert!(text.contains("at most 16 parts"), "{text}");
    std::fs::write(f.join("r.toml"), &deep).unwrap();
    soon(f, &["train", "a.laz", "-o", "o.model", "--recipe", "r.toml"], 4);
    std::fs::write(f.join("l.csv"), "x,y,z,class\n".to_string() + &"1e300,0,0,2\n".repeat(10)).unwrap();
    let text = soon(f, &["train", "a.laz", "--weak", "--weak-labels", "l.csv", "-o", "o.model"], 4);
    assert!(text.contains("l.csv:2") && text.contains("outside the cloud"), "{text}");
    for from in [&["--recipe", "/dev/zero"][..], &["--weak", "--weak-labels", "/dev/zero"]] {
        let text = soon(f, &[&["train", "a.laz", "-o", "o.model"], from].concat(), 4);
        assert!(text.contains("/dev/zero"), "{text}");
    }
    soon(f, &["classify", "a.laz", "-m", "/dev/zero", "-o", "b.laz"], 4);
    assert_eq!(names(f), ["a.laz", "l.csv", "r.toml"]);
}

/// Address space, in kilobytes, in which the program starts and reads its arguments. A megabyte less, and it ends before it can
/// take care of anything.
const LEAST: u64 = 40_000;

/// Address-space limits from one that hardly lets the program start to one that is enough.
#[test]
fn too_little_memory_is_an_error_that_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(60.0, 4), &Default::default()).unwrap();
    std::fs::copy(demo_scan(), f.join("demo.laz")).unwrap();
    let works: [&[&str]; 6] = [
        &["classify", "a.laz", "-o", "out.laz"],
        &["features", "a.laz", "-o", "out.npy"],
        &["train", "a.laz", "-o", "out.model", "--set", "forest.trees=5"],
        &["convert", "a.laz", "out.txt"],
        &["segment", "a.laz", "-o", "out.laz"],
        &["segment", "a.laz", "--method", "vccs", "-o", "out.laz"],
    ];
    for work in works {
        let (mut refused, mut amount) = (0, false);
        for step in 0..60 {
            let output = limited(LEAST + 6_000 * step, f, work);
            let text = stderr(&output);
            match output.status.code() {
                Some(0) => {
                    names(f)
                        .iter()
                        .filter(|n| n.starts_with("out"))
                        .for_each(|n| std::fs::remove_file(f.join(n)).unwrap());
                    break;
                }
                // The system's loader could not start the program.
                Some(127) => continue,
                Some(1) => {
                    refused += 1;
                    amount |= ["bytes failed", "MiB", "threads"].iter().any(|said| text.contains(said));
                }
                other => panic!("{work:?} in {} kB: {other:?} {text}", LEAST + 6_000 * step),
            }
            assert_eq!(names(f), ["a.laz", "demo.laz"], "{work:?}: {text}");
        }
        assert!(refused > 0 && amount, "{work:?}: {refused} limits were too small");
    }
}

/// Limits a page apart, around the first one with room for the stack of a thread. A thread that finds no memory for its
/// signal stack aborts as it starts, and the program must end then, too.
#[test]
fn threads_without_room_for_their_stacks_end_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(20.0, 4), &Default::default()).unwrap();
    let run = |kilobytes: u64| limited(kilobytes, f, &["info", "a.laz"]);
    let without_threads = |output: &Output| output.status.code() == Some(1) && stderr(output).contains("cannot start");
    let (mut below, mut above) = (LEAST / 4, 3 * LEAST);
    while above - below > 4 {
        let middle = (below + above) / 8 * 4;
        let output = run(middle);
        let starts = output.status.code().is_some_and(|code| code < 2) && !without_threads(&output);
        if starts { above = middle } else { below = middle }
    }
    let mut said = 0;
    for kilobytes in (above - 80..above + 80).step_by(4) {
        let output = run(kilobytes);
        assert!(output.status.code().is_some_and(|code| code < 2), "{kilobytes} kB: {output:?}");
        said += usize::from(without_threads(&output));
    }
    assert!(said > 0, "no limit from {} kB is too small for a thread", above - 80);
}

/// The comparison needs the cloud twice; it is left out where there is no room for it.
#[test]
fn a_conversion_that_ends_with_an_error_leaves_no_output() {
    let folder = tempfile::tempdir().unwrap();
    // For a path of 384 bytes or more the standard library allocates memory to call the system.
    let deep = folder.path().join("a".repeat(200)).join("b".repeat(200));
    std::fs::create_dir_all(&deep).unwrap();
    let (f, out) = (deep.as_path(), deep.join("out.npz"));
    io::write(&f.join("a.laz"), &street(150.0, 4), &Default::default()).unwrap();
    let mut codes = Vec::new();
    for step in 0..40 {
        let output = limited(LEAST + 2_000 * step, f, &["convert", "a.laz", out.to_str().unwrap()]);
        let code = output.status.code();
        let left: &[&str] = if code == Some(0) { &["a.laz", "out.npz"] } else { &["a.laz"] };
        assert_eq!(names(f), left, "{} kB: {}", LEAST + 2_000 * step, stderr(&output));
        if code == Some(0) {
            std::fs::remove_file(&out).unwrap();
        }
        codes.push((code, stderr(&output).contains("not compared")));
    }
    assert!(codes.contains(&(Some(1), false)) && codes.contains(&(Some(0), true)), "{codes:?}");
}

#[test]
fn features_are_written_as_they_are_computed() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = street(100.0, 5);
    io::write(&f.join("a.laz"), &cloud, &Default::default()).unwrap();
    // 120,000 points with 144 features are 69 MB, which were once in memory twice.
    let output = limited(190_000, f, &["features", "a.laz", "--recipe", "pyramid-paper", "-o", "a.npy"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let bytes = std::fs::read(f.join("a.npy")).unwrap();
    assert_eq!(bytes.len(), 128 + cloud.len() * 144 * 4);
    let output =
        limited(190_000, f, &["features", "a.laz", "--recipe", "pyramid-paper", "-o", "b.laz", "--only", "Planarity"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let output =
        limited(400_000, f, &["features", "a.laz", "--recipe", "pyramid-paper", "-o", "b.csv", "--only", "Planarity"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    // The column of one feature must be equal in the full table, in the dimension, and in the text, in the order of the
    // file.
    let written = io::read(&f.join("b.laz")).unwrap();
    let column = written.columns().iter().find(|c| c.name.starts_with("Planarity_r")).unwrap().clone();
    let text = std::fs::read_to_string(f.join("b.csv")).unwrap();
    let place = text.lines().next().unwrap().split(',').position(|n| n == column.name).unwrap();
    let whole = io::read(&f.join("a.laz")).unwrap();
    for (i, line) in text.lines().skip(1).enumerate().step_by(997) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(cells[..3], whole.xyz(i));
        let same = |row: &[u8]| {
            row.chunks_exact(4).any(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]) == cells[place] as f32)
        };
        assert!(same(&bytes[128 + i * 576..][..576]), "{i}");
        assert_eq!(column.values.get(i) as f32, cells[place] as f32, "{i}");
    }
    assert_eq!(names(f), ["a.laz", "a.npy", "b.csv", "b.laz"]);
}
