//! 1-4, 7, 12-15: files with random damage are read or refused: no panic, no abort, no hang, no memory beyond the limit.
//!
//! A child process with an address-space limit reads the mutants and says which one it is at; the parent restarts it behind
//! one that ends or stops it, and fails at the end. `SCANSION_MUTANTS=1000000` sets the number for each format,
//! `SCANSION_MUTANT=laz:1234` looks at one and keeps it as a file.

use scansion_core::Cloud;
use scansion_core::cloud::{Column, Values};
use scansion_core::io::{self, PointReader, ReadOptions, WriteOptions, salvage};
use scansion_core::parallel::Monitor;
use scansion_core::random::{Stream, stream};
use scansion_tests::data;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Longest time for one file of this size, and the memory that it may take besides the program's own.
const MOST_TIME: Duration = Duration::from_secs(2);
const MOST_MEMORY: u64 = 256 << 20;

fn cloud(points: usize) -> Cloud {
    let rows: Vec<[f64; 3]> =
        (0..points).map(|i| [(i % 13) as f64 * 0.5, (i / 13) as f64, (i * 7 % 5) as f64 * 0.25]).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    let n = points;
    cloud.set_column(Column::new("Intensity", Values::U16((0..n).map(|i| (i * 31) as u16).collect()))).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8((0..n).map(|i| [2, 5, 6][i % 3]).collect()))).unwrap();
    cloud.set_column(Column::new("Height", Values::F32((0..n).map(|i| i as f32 * 0.5).collect()))).unwrap();
    cloud.crs = Some("PROJCS[\"a\",UNIT[\"metre\",1]]".into());
    cloud
}

/// Small sound files of a format; formats that this version does not write, or whose samples are not here, give none.
fn seeds(format: &str, folder: &Path) -> Vec<(String, Vec<u8>)> {
    let own = |name: &str| {
        let path = folder.join(name);
        io::write(&path, &cloud(60), &WriteOptions::default()).ok()?;
        Some((name.to_string(), std::fs::read(path).ok()?))
    };
    let shared = |part: &str, most: u64| {
        let Some(hostile) = data().map(|d| d.join("hostile")) else { return Vec::new() };
        let mut paths: Vec<PathBuf> = std::fs::read_dir(hostile).unwrap().map(|e| e.unwrap().path()).collect();
        paths.sort();
        let fits = |p: &PathBuf| p.to_string_lossy().ends_with(part) && p.metadata().is_ok_and(|m| m.len() < most);
        let names = paths.into_iter().filter(fits).filter(|p| io::read(p).is_ok());
        names.map(|p| (format!("seed{part}"), std::fs::read(p).unwrap())).collect()
    };
    let text = |name: &str, content: &str| vec![(name.to_string(), content.as_bytes().to_vec())];
    match format {
        "las" => own("seed.las").into_iter().chain(peer(folder, "las")).collect(),
        "laz" => own("seed.laz").into_iter().chain(peer(folder, "laz")).collect(),
        "copc" => shared(".copc.laz", 200_000),
        "ply" => {
            let ascii = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty double z\n\
                         property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                         0 0 1 7\n1 0 2.5 8\n0 1 -3e2 9\n3 0 1 2\n";
            let big = [
                &b"ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list uchar int i\nelement vertex 2\nproperty float x\n\
                   property float y\nproperty float z\nend_header\n\x02\0\0\0\x01\0\0\0\x02"[..],
                &[63; 24],
            ];
            own("seed.ply")
                .into_iter()
                .chain(text("ascii.ply", ascii))
                .chain([("big.ply".into(), big.concat())])
                .collect()
        }
        "text" => {
            let plain = "1.5 2.5 3.5 -100 10 20 30\n4 5 6 7 8 9 10\n-7.25e1 8 9 10 11 12 13\n";
            own("seed.txt").into_iter().chain(text("plain.txt", plain)).collect()
        }
        "e57" => shared(".e57", 200_000),
        other => own(&format!("seed.{other}")).into_iter().chain(shared(&format!(".{other}"), 20_000)).collect(),
    }
}

/// A file of an old point format, whose LAZ chunks have no layers, written by the peer.
fn peer(folder: &Path, extension: &str) -> Option<(String, Vec<u8>)> {
    let path = folder.join(format!("peer.{extension}"));
    let mut builder = las::Builder::from((1, 3));
    builder.point_format = las::point::Format::new(3).ok()?;
    builder.point_format.is_compressed = extension == "laz";
    builder.point_format.extra_bytes = 2;
    let mut writer = las::Writer::from_path(&path, builder.into_header().ok()?).ok()?;
    for i in 0..40u16 {
        let color = Some(las::Color::new(i, 2 * i, 3));
        let point = las::Point {
            x: f64::from(i),
            intensity: i,
            gps_time: Some(1.0),
            color,
            extra_bytes: vec![1, 2],
            ..Default::default()
        };
        writer.write_point(point).ok()?;
    }
    writer.close().ok()?;
    Some((format!("peer.{extension}"), std::fs::read(path).ok()?))
}

/// Mutant `i` of a format: 1 to 4 changes, mostly where sizes and counts stand.
fn mutant(seeds: &[(String, Vec<u8>)], i: u64) -> (String, Vec<u8>) {
    let mut random = stream(11, i);
    let (name, bytes) = &seeds[random.below(seeds.len())];
    let mut bytes = bytes.clone();
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            break;
        }
        change(&mut bytes, &mut random);
    }
    (name.clone(), bytes)
}

fn change(bytes: &mut Vec<u8>, random: &mut Stream) {
    let n = bytes.len();
    let place = if random.below(3) > 0 { random.below(n.min(700)) } else { random.below(n) };
    let extremes = [0, 1, 255, 65_535, 1 << 31, u64::from(u32::MAX), 1 << 36, 1 << 63, u64::MAX, u64::MAX - 7];
    match random.below(8) {
        0 | 1 => bytes[place] = [0, 255, 128, random.below(256) as u8][random.below(4)],
        2 => bytes[place] ^= 1 << random.below(8),
        3 | 4 => {
            let value = extremes[random.below(extremes.len())].to_le_bytes();
            let size = [2, 4, 8][random.below(3)].min(n - place);
            bytes[place..place + size].copy_from_slice(&value[..size]);
        }
        5 => bytes.truncate(place + random.below(n - place)),
        6 => {
            let piece: Vec<u8> = bytes[place..].iter().copied().take(1 + random.below(64)).collect();
            bytes.splice(place..place, piece);
        }
        _ => {
            let words: [&[u8]; 8] = [b"-", b"nan", b"1e999", b",", b"\n", b" ", b"99999999999999999999", b"\xff\xfe"];
            bytes.splice(place..place, words[random.below(words.len())].iter().copied());
        }
    }
}

/// Everything that reads.
fn look(path: &Path) {
    let _ = io::read(path);
    let _ = io::inspect(path);
    let _ = salvage::examine(path, &Monitor::default());
    if let Ok(mut reader) = PointReader::open(path) {
        let last = reader.len().saturating_sub(1);
        let _ = reader.read(last..reader.len(), &ReadOptions::default());
    }
}

/// The work of the child; does nothing in an ordinary run.
#[test]
fn child() {
    let Ok(job) = std::env::var("SCANSION_MUTANT_JOB") else { return };
    let mut parts = job.split(':');
    let (format, first, end) = (parts.next().unwrap(), parts.next().unwrap(), parts.next().unwrap());
    let (first, end): (u64, u64) = (first.parse().unwrap(), end.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let seeds = seeds(format, folder.path());
    std::panic::set_hook(Box::new(|_| {}));
    look(&demo(&seeds, folder.path()));
    limit();
    let mut out = std::io::stdout();
    for i in first..end {
        let (name, bytes) = mutant(&seeds, i);
        let path = folder.path().join(format!("mutant-{name}"));
        std::fs::write(&path, &bytes).unwrap();
        writeln!(out, "\nat {i}").unwrap();
        let start = Instant::now();
        let panicked = std::panic::catch_unwind(|| look(&path)).is_err();
        if panicked || start.elapsed() > MOST_TIME {
            writeln!(out, "\nbad {i} {}", if panicked { "panic" } else { "slow" }).unwrap();
        }
    }
    writeln!(out, "\ndone").unwrap();
}

/// A sound file is read first, so that threads and tables are there before memory is limited.
fn demo(seeds: &[(String, Vec<u8>)], folder: &Path) -> PathBuf {
    let path = folder.join(&seeds[0].0);
    std::fs::write(&path, &seeds[0].1).unwrap();
    path
}

/// Address space of this process: what it has, and no more than the limit besides.
fn limit() {
    let pages: u64 = std::fs::read_to_string("/proc/self/statm").unwrap().split(' ').next().unwrap().parse().unwrap();
    let most = Some(pages * 4096 + MOST_MEMORY);
    let limit = rustix::process::Rlimit { current: most, maximum: most };
    rustix::process::setrlimit(rustix::process::Resource::As, limit).unwrap();
}

/// Runs children over `0..count`; returns the mutants that ended, stopped or panicked one, with how.
fn hunt(format: &str, count: u64) -> Vec<String> {
    let mut finds = Vec::new();
    let mut next = 0;
    while next < count && finds.len() < 20 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child", "--nocapture", "--test-threads=1"])
            .env("SCANSION_MUTANT_JOB", format!("{format}:{next}:{count}"))
            .env("MALLOC_ARENA_MAX", "1")
            .env("RAYON_NUM_THREADS", "1")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (send, lines) = mpsc::channel();
        let out = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || out.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        let (mut at, mut done) = (next, false);
        let how = loop {
            match lines.recv_timeout(Duration::from_secs(30)) {
                Ok(line) if line.starts_with("at ") => at = line[3..].parse().unwrap(),
                Ok(line) if line.starts_with("bad ") => finds.push(format!("{format} {}", &line[4..])),
                Ok(line) => done |= line == "done",
                Err(mpsc::RecvTimeoutError::Timeout) => break "hang",
                Err(mpsc::RecvTimeoutError::Disconnected) => break "abort",
            }
        };
        let _ = child.kill();
        child.wait().unwrap();
        if done {
            break;
        }
        finds.push(format!("{format} {at} {how}"));
        next = at + 1;
    }
    finds
}

#[test]
fn mutants_of_every_format_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    if let Some(one) = std::env::var("SCANSION_MUTANT").ok().as_deref().and_then(|v| v.split_once(':')) {
        let (name, bytes) = mutant(&seeds(one.0, folder.path()), one.1.parse().unwrap());
        let path = std::env::temp_dir().join(format!("mutant-{}-{name}", one.1));
        std::fs::write(&path, bytes).unwrap();
        eprintln!("kept as {}", path.display());
        look(&path);
        return;
    }
    let count = std::env::var("SCANSION_MUTANTS").ok().and_then(|v| v.parse().ok()).unwrap_or(20_000);
    let mut finds = Vec::new();
    for format in ["las", "laz", "copc", "ply", "text", "pcd", "npz", "e57"] {
        if seeds(format, folder.path()).is_empty() {
            eprintln!("{format}: skipped, no sample is written or here (set SCANSION_DATA)");
            continue;
        }
        let start = Instant::now();
        let found = hunt(format, count);
        eprintln!("{format}: {count} mutants in {:.1} s, {} finds", start.elapsed().as_secs_f64(), found.len());
        finds.extend(found);
    }
    assert!(finds.is_empty(), "{finds:#?}");
}

/// 4: a file cut at any byte, so at every boundary of its structure and beside it, is refused.
#[test]
fn a_file_cut_at_any_byte_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for format in ["las", "laz"] {
        for (name, bytes) in seeds(format, folder.path()) {
            let path = folder.path().join(format!("cut-{name}"));
            for length in 0..bytes.len() {
                std::fs::write(&path, &bytes[..length]).unwrap();
                assert!(io::read(&path).is_err(), "{name} cut at {length} of {}", bytes.len());
            }
        }
    }
}

/// Every file of the hostile corpus through the reading commands, in little memory and time.
#[test]
fn the_hostile_corpus_passes_every_reading_command() {
    let Some(hostile) = data().map(|d| d.join("hostile")).filter(|d| d.is_dir()) else {
        eprintln!("skipped: the hostile corpus is not here (set SCANSION_DATA)");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_scansion-under-test");
    let mut slowest = (Duration::ZERO, String::new());
    for entry in std::fs::read_dir(hostile).unwrap() {
        let path = entry.unwrap().path();
        let file = path.to_str().unwrap();
        if path.metadata().unwrap().len() > 1 << 20 {
            continue;
        }
        for command in [
            &["info", "--stats", file][..],
            &["info", "--salvage", file],
            &["diff", file, file],
            &["convert", file, "out.las"],
        ] {
            let start = Instant::now();
            // Address space, so code, stacks and memory together.
            let output = Command::new("sh")
                .args(["-c", "ulimit -v 393216; exec \"$0\" -j 1 \"$@\"", program])
                .args(command)
                .env("MALLOC_ARENA_MAX", "1")
                .current_dir(folder.path())
                .output()
                .unwrap();
            let time = start.elapsed();
            let stderr = String::from_utf8_lossy(&output.stderr);
            let allowed = [0, 1, 4].map(Some);
            assert!(allowed.contains(&output.status.code()), "{command:?}: {:?} {stderr}", output.status);
            assert!(!stderr.contains("internal error") && !stderr.contains("panicked"), "{command:?}: {stderr}");
            if time > slowest.0 {
                slowest = (time, format!("{command:?}"));
            }
        }
    }
    eprintln!("slowest: {slowest:?}");
    // Two seconds is the goal; a busy machine gets more.
    assert!(slowest.0 < Duration::from_secs(6), "{slowest:?}");
}
