//! Support for the integration tests: synthetic scenes with known labels, and the shared real data.

pub mod program;
pub mod samples;
pub mod village;

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::random::stream;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A street of `size` metres with houses and trees, about 12 points per square metre, classes 2, 5, 6.
///
/// # Panics
/// Never: the scene is well formed.
#[must_use]
pub fn street(size: f64, seed: u64) -> Cloud {
    let mut random = stream(seed, 0);
    let mut rows = Vec::new();
    let mut codes = Vec::new();
    for _ in 0..(12.0 * size * size) as usize {
        let (x, y) = (random.uniform() * size, random.uniform() * size);
        let (u, v) = (x % 20.0, y % 20.0);
        let noise = 0.02 * (random.uniform() - 0.5);
        let in_house = (3.0..11.0).contains(&u) && (3.0..13.0).contains(&v);
        let tree = ((u - 16.0).powi(2) + (v - 10.0).powi(2)).sqrt();
        let (z, code) = if in_house {
            (6.0 + 0.5 * (4.0 - (u - 7.0).abs()) + noise, 6)
        } else if tree < 2.5 {
            (2.0 + 4.0 * random.uniform() * (1.0 - tree / 3.0), 5)
        } else {
            (0.3 * (x * 0.05).sin() + noise, 2)
        };
        rows.push([x, y, z]);
        codes.push(code);
    }
    let mut cloud = Cloud::from_rows(&rows).expect("axes of equal length");
    cloud.set_column(Column::new("Classification", Values::U8(codes))).expect("one code a point");
    cloud
}

/// The folder of the shared real data, if it is there: `SCANSION_DATA`, else `../shared/data` beside the workspace. A test
/// that goes without says so, and is counted: its name is appended to the file `SCANSION_SKIPPED`.
///
/// # Panics
/// If the data are absent and `SCANSION_REQUIRE_DATA` is set.
#[must_use]
pub fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("SCANSION_DATA").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    let absent = format!("the real clouds are absent: no folder {} (set SCANSION_DATA)", folder.display());
    assert!(std::env::var_os("SCANSION_REQUIRE_DATA").is_none(), "{absent}");
    let test = std::thread::current().name().unwrap_or("a test").to_string();
    eprintln!("skipped {test}: {absent}");
    if let Some(list) = std::env::var_os("SCANSION_SKIPPED") {
        let file = std::fs::OpenOptions::new().create(true).append(true).open(list);
        writeln!(file.expect("the list of skipped tests can be written"), "{test}").expect("it has room");
    }
    None
}

/// The embedded scan of `scansion demo`.
#[must_use]
pub fn demo_scan() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/cli/assets/demo.laz")
}
