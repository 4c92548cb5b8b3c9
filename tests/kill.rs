//! 25: whatever ends the program at whatever moment, the output's name is absent, old or complete; a signal that can be
//! caught leaves nothing behind and ends the program at once. `SCANSION_KILLS=200` sets the number of kills.

use rustix::process::{Pid, Signal, kill_process};
use scansion_core::random::stream;
use scansion_tests::street;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_scansion-under-test"))
        .args(arguments)
        .args(["--progress", "never", "-j", "2"])
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

/// Sends a signal as soon as `ready` says so; returns exit code and time to the end.
fn signalled(mut child: Child, signal: Signal, ready: impl Fn() -> bool) -> (Option<i32>, Duration) {
    let begin = Instant::now();
    while !ready() && begin.elapsed() < Duration::from_secs(20) && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = Instant::now();
    // It may be over already.
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
    // One second is what we promise; a busy machine gets more.
    assert!(slowest < Duration::from_secs(3), "{slowest:?}");
}
