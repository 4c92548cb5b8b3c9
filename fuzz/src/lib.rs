//! What the fuzz targets do with their bytes. README.md of this crate tells how to run them.

use scansion_core::recipes::Model;
use scansion_core::io::{self, PointReader, ReadOptions, salvage};
use scansion_core::parallel::Monitor;
use std::path::{Path, PathBuf};
use std::sync::Once;

/// Crates whose panics on damaged bytes the library catches and reports as errors.
const CAUGHT: [&str; 2] = ["/vendor/laz/", "/e57-"];

/// The fuzzer's panic hook aborts before anything can catch a panic: lets those pass that the library is to catch. If it does
/// not, the panic reaches the fuzzer, which then aborts.
fn let_caught_panics_pass() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let abort = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let inside = |file: &str| CAUGHT.iter().any(|name| file.contains(name));
            if !panic.location().is_some_and(|at| inside(at.file())) {
                abort(panic);
            }
        }));
    });
}

/// A file of this process, in memory where that is possible.
fn file(name: &str) -> PathBuf {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
    folder.join(format!("scansion-fuzz-{}-{name}", std::process::id()))
}

fn with_file(name: &str, bytes: &[u8], work: impl FnOnce(&Path)) {
    let_caught_panics_pass();
    let path = file(name);
    if std::fs::write(&path, bytes).is_ok() {
        work(&path);
    }
}

/// Every way to read a file of that name.
pub fn read_all(name: &str, bytes: &[u8]) {
    with_file(name, bytes, |path| {
        let _ = io::read(path);
        let _ = io::inspect(path);
        let part = ReadOptions { bounds: Some([[0.0; 3], [1e6; 3]]), ..ReadOptions::default() };
        let _ = io::read_with(path, &part);
        let _ = io::read_with(path, &ReadOptions { resolution: Some(1.0), ..ReadOptions::default() });
        let _ = salvage::examine(path, &Monitor::default());
        if let Ok(blocks) = io::blocks(path, 7, &ReadOptions::default()) {
            blocks.for_each(drop);
        }
        if let Ok(mut reader) = PointReader::open(path) {
            let last = reader.len().saturating_sub(1);
            let _ = reader.read(last..reader.len(), &ReadOptions::default());
        }
    });
}

/// Labels beside three points.
pub fn labels(bytes: &[u8]) {
    with_file("labelled.txt", b"1 2 3\n4 5 6\n7 8 9\n", |points| {
        with_file("labelled.labels", bytes, |_| {
            let _ = io::read(points);
        });
    });
}

/// A model file, and a prediction if it is one.
pub fn model(bytes: &[u8]) {
    with_file("a.model", bytes, |path| {
        let _ = Model::load(path);
    });
}
