//! What the fuzz targets do with their bytes. README.md of this crate tells how to run them.

use scansion_core::classes::{LabelMap, preset};
use scansion_core::filters::{Area, ClassArea};
use scansion_core::io::{self, PointReader, ReadOptions, salvage};
use scansion_core::nn::arrays::Arrays;
use scansion_core::nn::objects::{read_idx, read_off, read_xyz};
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{AnyRecipe, LabelFile, Model, SegmentParams};
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

/// Grids of heights, polygons, lines and tables of labels: each reader that takes text, whatever the text is.
pub fn maps(bytes: &[u8]) {
    with_file("a.asc", bytes, |path| {
        let _ = io::read_ascii_grid(path);
    });
    with_file("a.obj", bytes, |path| {
        let _ = io::read_lines(path);
    });
    with_file("a.geojson", bytes, |path| {
        let _ = io::read_lines(path);
        if let Ok(area) = Area::read(path) {
            area.holds([0.5, 0.5]);
        }
        let _ = ClassArea::read_mapped(path, &LabelMap::default());
    });
    with_file("a.csv", bytes, |path| {
        let _ = LabelFile::read(path);
    });
}

/// Settings of recipes and segmentations, lists of classes, and maps of codes.
pub fn settings(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let _ = AnyRecipe::from_toml(&text);
    let _ = SegmentParams::from_toml(&text);
    let _ = preset::from_toml(&text);
    let _ = text.parse::<LabelMap>();
    if let Ok(recipe) = AnyRecipe::named("pyramid") {
        let _ = recipe.with_settings([&*text]);
    }
}

/// Shapes and images of objects, and weights of networks.
pub fn objects(bytes: &[u8]) {
    with_file("a.off", bytes, |path| {
        let _ = read_off(path);
        let _ = read_idx(path);
        let _ = read_xyz(path);
        let _ = Arrays::from_bytes(bytes, path);
    });
}
