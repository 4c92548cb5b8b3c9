//! A module of core uses only modules above it in the list of `crates/core/src/lib.rs`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn core() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/core/src")
}

/// The modules in the order of `lib.rs`.
fn rooms() -> Vec<String> {
    let lib = fs::read_to_string(core().join("lib.rs")).unwrap();
    lib.lines().filter_map(|l| Some(l.trim().strip_prefix("pub mod ")?.strip_suffix(';')?.to_string())).collect()
}

fn rust_files(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_path_buf()];
    }
    fs::read_dir(path)
        .unwrap()
        .flat_map(|e| rust_files(&e.unwrap().path()))
        .filter(|p| p.extension().is_some_and(|e| e == "rs"))
        .collect()
}

/// Names that follow `crate::` in a source text, those in braces too.
fn used(text: &str) -> BTreeSet<String> {
    let mut used = BTreeSet::new();
    for (at, _) in text.match_indices("crate::") {
        let line = text[..at].rfind('\n').map_or(0, |n| n + 1);
        if text[line..at].trim_start().starts_with("//") {
            continue;
        }
        let rest = &text[at + 7..];
        let list = rest.strip_prefix('{').and_then(|r| r.split_once('}')).map_or(rest, |(inside, _)| inside);
        let parts: Vec<&str> = if rest.starts_with('{') { list.split(',').collect() } else { vec![rest] };
        used.extend(
            parts.iter().map(|p| p.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()),
        );
    }
    used
}

#[test]
fn the_list_of_rooms_is_the_order_of_the_data() {
    let rooms = rooms();
    for pair in [
        ["cloud", "voxels"],
        ["voxels", "neighbours"],
        ["cloud", "io"],
        ["io", "features"],
        ["features", "classification"],
        ["classification", "recipes"],
    ] {
        let place = |name| rooms.iter().position(|r| r == name).unwrap();
        assert!(place(pair[0]) < place(pair[1]), "{pair:?}");
    }
}

#[test]
fn rooms_use_only_rooms_above_them() {
    let rooms = rooms();
    let mut broken = Vec::new();
    for (place, room) in rooms.iter().enumerate() {
        let folder = core().join(room);
        let start = if folder.is_dir() { folder } else { core().join(format!("{room}.rs")) };
        for file in rust_files(&start) {
            let text = fs::read_to_string(&file).unwrap();
            let below = used(&text).into_iter().filter(|u| rooms[place + 1..].contains(u));
            broken.extend(below.map(|b| format!("{} uses {b}, a room below {room}", file.display())));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_check_sees_uses_in_every_form() {
    let text = "use crate::io::read;\nuse crate::{features::X, error};\n// crate::recipes\nlet a = crate::images::b();";
    let expected = ["error", "features", "images", "io"].map(String::from);
    assert_eq!(used(text).into_iter().collect::<Vec<_>>(), expected);
}
