//! Limits on what a file may unpack to, and unique names in linear time.

use crate::error::{Error, Result};
use crate::memory;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// A file may unpack to this many bytes plus [`RATIO`] times its own length: real scans in compressed formats stay far
/// below, and a file of 1 MiB stays below 128 MiB (temporarily twice that while an array is split into columns).
const FREE: u64 = 64 << 20;
const RATIO: u64 = 64;

/// Checks the memory for all points of a file before any of it is allocated.
///
/// # Errors
/// If it is implausible for the length of the file, or exceeds the free memory.
pub(in crate::io) fn unpacked(path: &Path, format: &'static str, length: u64, bytes: u64) -> Result<()> {
    let most = FREE.saturating_add(RATIO.saturating_mul(length));
    if bytes > most {
        return Err(Error::Malformed {
            path: path.to_path_buf(),
            format,
            field: "unpacked size".into(),
            place: "the whole file".into(),
            found: format!("{bytes} bytes in memory from {length} in the file"),
            allowed: format!("at most {most}: {RATIO} times the file and 64 MiB; save it uncompressed or in parts"),
        });
    }
    memory::require(bytes, &format!("the points of {}", path.display()))
}

/// Makes names unique by appending numbers.
#[derive(Clone, Debug, Default)]
pub(in crate::io) struct Names {
    taken: HashSet<String>,
    /// The next number for each name.
    next: HashMap<String, usize>,
}

impl Names {
    /// The name itself, or with the smallest number from 2 on that makes it unique.
    pub(in crate::io) fn free(&mut self, name: &str) -> String {
        if self.taken.insert(name.to_string()) {
            return name.to_string();
        }
        let next = self.next.entry(name.to_string()).or_insert(2);
        loop {
            let free = format!("{name}_{next}");
            *next += 1;
            if self.taken.insert(free.clone()) {
                return free;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_get_the_first_free_number() {
        let mut names = Names::default();
        let given = ["a", "a_2", "a", "b", "a", "a_2"].map(|name| names.free(name));
        assert_eq!(given, ["a", "a_2", "a_3", "b", "a_4", "a_2_2"]);
    }

    #[test]
    fn a_file_may_unpack_to_many_times_its_length_but_not_to_any_size() {
        let path = Path::new("a.npz");
        assert!(unpacked(path, "npz", 1 << 20, 128 << 20).is_ok());
        let message = unpacked(path, "npz", 1 << 20, 129 << 20).unwrap_err().to_string();
        assert!(message.contains("64 times the file"), "{message}");
    }
}
