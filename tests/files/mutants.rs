//! Randomly damaged files are read or refused: no panic, no abort, no hang, no memory beyond the limit.
//!
//! A child process with an address-space limit reads the mutants and prints which one it is at; the parent restarts it
//! after one that ends or stops it, and fails at the end. `SCANSION_MUTANTS=1000000` sets the number for each format,
//! `SCANSION_MUTANT_FORMAT=laz` selects one format, `SCANSION_MUTANT=laz:1234` runs one mutant and keeps it as a file.

use rayon::prelude::*;
use scansion_core::evaluation::Confusion;
use scansion_core::features::{self, FeatureSet};
use scansion_core::io::{self, PointReader, ReadOptions, WriteOptions, salvage};
use scansion_core::parallel::Monitor;
use scansion_core::random::{Stream, stream};
use scansion_core::recipes::{
    AnyRecipe, KnownPoints, LabelParams, LabelledCloud, SegmentParams, SuggestParams, TrainOptions, read_labels,
    segment, suggest,
};
use scansion_tests::data;
use scansion_tests::samples::{self, FORMATS, Sample, seal};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Time limit for one file of this size, and the memory that it may take besides the program's own.
const MOST_TIME: Duration = Duration::from_secs(2);
const MOST_MEMORY: u64 = 256 << 20;

/// Mutant `i` of a format: 1 to 4 changes, mostly to sizes and counts.
fn mutant(seeds: &[Sample], i: u64) -> Sample {
    let mut random = stream(11, i);
    let (name, bytes) = &seeds[random.below(seeds.len())];
    let mut bytes = bytes.clone();
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            break;
        }
        change(&mut bytes, &mut random);
    }
    // Otherwise hardly any mutant would pass the checksums.
    if name.ends_with("e57") && !i.is_multiple_of(8) {
        seal(&mut bytes);
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

/// Calls everything that reads; for some mutants also reading in parts, and conversion, which writes.
fn look(path: &Path, i: u64) {
    let _ = io::read(path);
    let _ = io::inspect(path);
    let _ = salvage::examine(path, &Monitor::default());
    if i.is_multiple_of(3) {
        parts(path);
    }
    if i.is_multiple_of(64) {
        learn(path);
    }
    if i.is_multiple_of(16) {
        let _ = io::diff(path, path, &Default::default());
        let target = path.with_file_name("out.laz");
        let _ = io::convert(path, &target, &Default::default(), &WriteOptions::default());
        let _ = io::merge(&[path.to_path_buf(), path.to_path_buf()], &target, &WriteOptions::default());
    }
}

/// `features`, `evaluate`, `segment`, `suggest` and `train` on what could be read.
fn learn(path: &Path) {
    let monitor = Monitor::default();
    let Ok(cloud) = io::read(path) else { return };
    let _ = features::table(&cloud, &FeatureSet::default(), &monitor);
    let Ok(labels) = read_labels(&cloud, &LabelParams::default()) else { return };
    let _ = Confusion::from_partial(&labels.codes, &labels.codes);
    if let Ok(segments) = segment(&cloud, Some(&labels), &SegmentParams::default(), &monitor) {
        let known = KnownPoints { labels: Some(&labels), ..KnownPoints::default() };
        let _ = suggest(&segments, known, &SuggestParams::default(), &monitor);
    }
    let few =
        AnyRecipe::named("pyramid").unwrap().with_settings(["forest.trees=3", "training.keep_samples=50"]).unwrap();
    let _ = few.train(&[LabelledCloud { cloud, labels }], &TrainOptions::default(), &monitor);
}

/// A box, a level, blocks, and the last point by its number.
fn parts(path: &Path) {
    let part = ReadOptions { bounds: Some([[0.0; 3], [5.0, 3.0, 1e6]]), ..Default::default() };
    let _ = io::read_with(path, &part);
    let _ = io::read_with(path, &ReadOptions { resolution: Some(1.0), ..Default::default() });
    if let Ok(blocks) = io::blocks(path, 7, &ReadOptions::default()) {
        assert!(blocks.take_while(Result::is_ok).count() < 1 << 20);
    }
    if let Ok(mut reader) = PointReader::open(path) {
        let last = reader.len().saturating_sub(1);
        let _ = reader.read(last..reader.len(), &ReadOptions::default());
    }
}

/// In memory if possible: mutants are many and short-lived.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

/// The work of the child process; does nothing in an ordinary run.
#[test]
fn child() {
    let Ok(job) = std::env::var("SCANSION_MUTANT_JOB") else { return };
    let mut parts = job.split(':');
    let (format, first, end) = (parts.next().unwrap(), parts.next().unwrap(), parts.next().unwrap());
    let (first, end): (u64, u64) = (first.parse().unwrap(), end.parse().unwrap());
    let folder = folder();
    let seeds = samples::of(format, folder.path());
    std::panic::set_hook(Box::new(|_| {}));
    look(&demo(&seeds, folder.path()), 0);
    limit();
    let mut out = std::io::stdout();
    for i in first..end {
        let (name, bytes) = mutant(&seeds, i);
        let path = folder.path().join(format!("mutant-{name}"));
        std::fs::write(&path, &bytes).unwrap();
        writeln!(out, "\nat {i}").unwrap();
        let timed = || {
            let start = Instant::now();
            let panicked = std::panic::catch_unwind(|| look(&path, i)).is_err();
            (panicked, start.elapsed())
        };
        let (panicked, time) = timed();
        // Measured again, because the machine may have been busy.
        if panicked || time > MOST_TIME && timed().1 > MOST_TIME {
            writeln!(out, "\nbad {i} {}", if panicked { "panic" } else { "slow" }).unwrap();
        }
    }
    writeln!(out, "\ndone").unwrap();
}

/// Reads an intact file first, so that threads and tables exist before memory is limited.
fn demo(seeds: &[Sample], folder: &Path) -> PathBuf {
    let path = folder.join(&seeds[0].0);
    std::fs::write(&path, &seeds[0].1).unwrap();
    path
}

/// Limits the address space of this process to its current size plus the allowance.
fn limit() {
    let pages: u64 = std::fs::read_to_string("/proc/self/statm").unwrap().split(' ').next().unwrap().parse().unwrap();
    let most = Some(pages * 4096 + MOST_MEMORY);
    let limit = rustix::process::Rlimit { current: most, maximum: most };
    rustix::process::setrlimit(rustix::process::Resource::As, limit).unwrap();
}

/// Runs child processes over `0..count`; returns the mutants that ended, stopped or panicked one, and how.
fn hunt(format: &str, count: u64) -> Vec<String> {
    let mut finds = Vec::new();
    let mut next = 0;
    while next < count && finds.len() < 20 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "mutants::child", "--nocapture", "--test-threads=1"])
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
        let number = one.1.parse().unwrap();
        let (name, bytes) = mutant(&samples::of(one.0, folder.path()), number);
        let path = std::env::temp_dir().join(format!("mutant-{}-{name}", one.1));
        std::fs::write(&path, bytes).unwrap();
        eprintln!("kept as {}", path.display());
        look(&path, number);
        return;
    }
    let count = std::env::var("SCANSION_MUTANTS").ok().and_then(|v| v.parse().ok()).unwrap_or(20_000);
    // Two children at a time: each has one thread.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut finds = Vec::new();
        while let Some(format) = FORMATS.get(next.fetch_add(1, Ordering::Relaxed)) {
            if std::env::var("SCANSION_MUTANT_FORMAT").is_ok_and(|only| only != *format) {
                continue;
            }
            let start = Instant::now();
            let found = hunt(format, count);
            eprintln!("{format}: {count} mutants in {:.1} s, finds: {found:?}", start.elapsed().as_secs_f64());
            finds.extend(found);
        }
        finds
    };
    let finds = std::thread::scope(|scope| {
        let other = scope.spawn(work);
        [work(), other.join().unwrap()].concat()
    });
    assert!(finds.is_empty(), "{finds:#?}");
}

/// Seeds of the targets that read text: where each stands in the corpus, and the text.
const TEXTS: [(&str, &str); 9] = [
    ("maps/grid", "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n1 2\n-9999 4\n"),
    ("maps/lines", "v 0 0 0\nv 1 0 0.5\nv 1 1 1\nl 1 2 3\nl -1 -2\n"),
    (
        "maps/classes",
        r#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{"class":6},"geometry":{"type":"Polygon",
        "coordinates":[[[0,0],[4,0],[4,4],[0,4],[0,0]],[[1,1],[2,1],[2,2],[1,1]]]}},{"type":"Feature","properties":{},
        "geometry":{"type":"LineString","coordinates":[[0,0,0],[1,1,1]]}}]}"#,
    ),
    ("maps/wkt", "SRID=2154;MULTIPOLYGON (((0 0, 4 0, 4 4, 0 0), (1 1, 2 1, 2 2, 1 1)), ((5 5, 6 5, 6 6, 5 5)))"),
    ("maps/table", "x,y,z,class\n0.5,0.5,0.25,2\n1.5,1,0.5,6\n"),
    ("settings/segment", "[partition]\ncutoff = 3.0\n"),
    (
        "settings/classes",
        "classes = [{ code = 64, name = \"tram\", colour = [255, 0, 0] }, { code = 2, name = \"ground\" }]\n",
    ),
    ("settings/map", "3-4=5,300-400=6"),
    ("objects/mesh", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
];

/// Writes the samples as seeds of the fuzz targets: into `SCANSION_CORPUS` if it is set.
#[test]
fn corpus_of_the_fuzz_targets_is_written() {
    let folder = folder();
    // Tests run in their package's folder.
    let wanted =
        std::env::var_os("SCANSION_CORPUS").map(|to| Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(to));
    let corpus = wanted.unwrap_or_else(|| folder.path().join("corpus"));
    for format in FORMATS {
        for (i, (name, bytes)) in samples::of(format, folder.path()).into_iter().enumerate() {
            let target = match name.rsplit('.').next().unwrap() {
                "pts" => "pts",
                "ptx" => "ptx",
                _ => format,
            };
            std::fs::create_dir_all(corpus.join(target)).unwrap();
            std::fs::write(corpus.join(target).join(format!("{i}-{name}")), bytes).unwrap();
        }
    }
    for target in ["labels", "model"] {
        std::fs::create_dir_all(corpus.join(target)).unwrap();
    }
    std::fs::write(corpus.join("labels/three"), "2\n5\n6\n").unwrap();
    for (place, text) in TEXTS {
        std::fs::create_dir_all(corpus.join(place).parent().unwrap()).unwrap();
        std::fs::write(corpus.join(place), text).unwrap();
    }
    let recipe = AnyRecipe::named("airborne").unwrap().to_toml().unwrap();
    std::fs::write(corpus.join("settings/airborne"), recipe).unwrap();
    let cloud = samples::cloud(600);
    let labels = read_labels(&cloud, &LabelParams::default()).unwrap();
    for (classifier, small) in [("rf", "forest.trees=3"), ("gbt", "boosting.rounds=3")] {
        let choice = format!("classifier=\"{classifier}\"");
        let recipe = AnyRecipe::named("pyramid").unwrap().with_settings([&*choice, small]).unwrap();
        let (model, _) = recipe
            .train(
                &[LabelledCloud { cloud: cloud.clone(), labels: labels.clone() }],
                &TrainOptions::default(),
                &Monitor::default(),
            )
            .unwrap();
        model.save(&corpus.join("model").join(classifier)).unwrap();
    }
    let targets = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/fuzz_targets")).unwrap();
    for target in targets.map(|entry| entry.unwrap().path()) {
        let seeds = std::fs::read_dir(corpus.join(target.file_stem().unwrap())).unwrap();
        assert!(seeds.count() > 0, "{} has no seeds", target.display());
    }
}

/// A file truncated at any byte is refused; truncated text, and meshes truncated after the points, may be read, but the
/// program never crashes.
#[test]
fn a_file_cut_at_any_byte_is_refused() {
    let folder = folder();
    for format in FORMATS {
        for (name, bytes) in samples::of(format, folder.path()) {
            let path = folder.path().join(format!("cut-{name}"));
            let binary = format != "text" && !name.starts_with("ascii") && !name.starts_with("real");
            let step = if bytes.len() > 10_000 { 7 } else { 1 };
            for length in (0..bytes.len()).step_by(step) {
                std::fs::write(&path, &bytes[..length]).unwrap();
                let level = (format == "copc").then_some(1.0);
                let whole = io::read_with(&path, &ReadOptions { resolution: level, ..Default::default() });
                // Sweeps of SemanticKITTI have no header: any number of records is a file.
                let complete = format == "kitti" && length > 0 && length % 16 == 0;
                assert!(whole.is_err() || !binary || complete, "{name} cut at {length} of {}", bytes.len());
                let _ = (io::inspect(&path).is_ok(), salvage::examine(&path, &Monitor::default()).is_ok());
            }
        }
    }
}

/// Every file of the hostile corpus through the commands that read, with limited memory and time.
#[test]
fn the_hostile_corpus_passes_every_reading_command() {
    let Some(hostile) = data().map(|d| d.join("hostile")) else { return };
    let mut paths: Vec<PathBuf> = std::fs::read_dir(hostile).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|path| path.metadata().unwrap().len() <= 1 << 20);
    let slowest = paths.par_iter().map(|path| commands(path.to_str().unwrap())).max().unwrap();
    eprintln!("{} files, slowest: {slowest:?}", paths.len());
    // The goal is two seconds; a busy machine is given more.
    assert!(slowest.0 < Duration::from_secs(6), "{slowest:?}");
}

/// Runs the commands that read; returns the longest time and the command that took it.
fn commands(file: &str) -> (Duration, String) {
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_scansion-under-test");
    let mut slowest = (Duration::ZERO, String::new());
    for command in [
        &["info", "--stats", file][..],
        &["info", "--salvage", file],
        &["diff", file, file],
        &["convert", file, "out.las"],
        &["convert", file, "out.laz", "--salvage"],
        &["convert", file, "out.ply", "--bounds", "0,0,1e6,1e7"],
        &["merge", file, file, "both.laz"],
        &["evaluate", file, file],
        &["render", file, "-o", "map.png", "--width", "200"],
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
        let stderr = String::from_utf8_lossy(&output.stderr);
        let allowed = [0, 1, 4].map(Some);
        assert!(allowed.contains(&output.status.code()), "{command:?}: {:?} {stderr}", output.status);
        assert!(!stderr.contains("internal error") && !stderr.contains("panicked"), "{command:?}: {stderr}");
        slowest = slowest.max((start.elapsed(), format!("{command:?}")));
    }
    slowest
}
