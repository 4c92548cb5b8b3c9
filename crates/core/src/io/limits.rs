//! What a file may cost: bounds on what it unpacks to, and names that are told apart in linear time.

use crate::error::{Error, Result};
use crate::memory;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// What a file unpacks to may be this many bytes and [`RATIO`] times its own length: real scans in the formats that pack
/// come nowhere near, and a file of 1 MiB stays below 128 MiB (twice that while an array is taken apart).
const FREE: u64 = 64 << 20;
const RATIO: u64 = 64;

/// Checks the bytes that all points of a file take in memory, before any of it is asked for.
///
/// # Errors
/// More than the file's length makes plausible, or more than memory has room for.
pub(super) fn unpacked(path: &Path, format: &'static str, (length, bytes): (u64, u64)) -> Result<()> {
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

/// Names of which one that is taken gets a number.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    taken: HashSet<String>,
    /// The number that a name gets the next time.
    next: HashMap<String, usize>,
}

impl Names {
    /// The name itself, or with the first number from 2 on that makes it new.
    pub(super) fn free(&mut self, name: &str) -> String {
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
        assert!(unpacked(path, "npz", (1 << 20, 128 << 20)).is_ok());
        let message = unpacked(path, "npz", (1 << 20, 129 << 20)).unwrap_err().to_string();
        assert!(message.contains("64 times the file"), "{message}");
    }
}
