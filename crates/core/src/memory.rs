//! Memory: how much is free, and checked allocations, so that a lack of memory is an error and does not kill the
//! process.

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Smaller requests are not checked: the check costs more than the allocation.
const SMALL: u64 = 64 << 20;

/// Reserves room for exactly `more` values.
///
/// # Errors
/// If the system has too little memory; the message says for what, and how much is needed.
pub fn reserve<T>(values: &mut Vec<T>, more: usize, what: &str) -> Result<()> {
    let needed = (more as u64).saturating_mul(size_of::<T>() as u64);
    require(needed, what)?;
    values.try_reserve_exact(more).map_err(|_| short(needed, what))
}

/// A vector of `count` copies of a value.
///
/// # Errors
/// As [`reserve`].
pub fn filled<T: Clone>(value: T, count: usize, what: &str) -> Result<Vec<T>> {
    let mut values = Vec::new();
    reserve(&mut values, count, what)?;
    values.resize(count, value);
    Ok(values)
}

/// Fails if `needed` bytes are more than what is free by any of the limits that [`free`] knows.
///
/// # Errors
/// The message says for what, how much is needed, and how much is free.
pub fn require(needed: u64, what: &str) -> Result<()> {
    if needed < SMALL { Ok(()) } else { spare(needed, what) }
}

/// As [`require`], also for a few bytes: for work that can be left out, such as a check of what is already written.
///
/// # Errors
/// As [`require`].
pub fn spare(needed: u64, what: &str) -> Result<()> {
    let missing = free().is_some_and(|free| needed > free);
    if missing { Err(short(needed, what)) } else { Ok(()) }
}

fn short(needed: u64, what: &str) -> Error {
    Error::Memory { what: what.to_string(), needed, free: free() }
}

/// Bytes that this process may still allocate: the minimum of what its address space (`ulimit -v`), its control groups
/// (containers, job schedulers) and the machine have left. `None` if the system does not tell.
pub fn free() -> Option<u64> {
    let text = |path: &str| std::fs::read_to_string(path).ok();
    let space = text("/proc/self/limits").zip(text("/proc/self/status")).and_then(|(l, s)| address_space(&l, &s));
    let groups = text("/proc/self/cgroup").and_then(|groups| group(&groups, Path::new("/sys/fs/cgroup")));
    let machine = text("/proc/meminfo").and_then(|text| machine(&text));
    [space, groups, machine].into_iter().flatten().min()
}

/// Bytes left under `ulimit -v`; `None` without a limit.
fn address_space(limits: &str, status: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kilobytes(status, "VmSize:")?))
}

fn machine(info: &str) -> Option<u64> {
    Some(kilobytes(info, "MemAvailable:")?.saturating_add(kilobytes(info, "SwapFree:").unwrap_or(0)))
}

/// The number of kilobytes after a key, in bytes.
fn kilobytes(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Bytes left in the control group (version 2) and its parents; cached pages of files count as free.
fn group(groups: &str, root: &Path) -> Option<u64> {
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let folders: Vec<PathBuf> =
        root.join(own).ancestors().take_while(|f| f.starts_with(root)).map(Path::to_path_buf).collect();
    folders.iter().filter_map(|folder| left(folder)).min()
}

fn left(folder: &Path) -> Option<u64> {
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).ok();
    let limit: u64 = text("memory.max")?.trim().parse().ok()?;
    let used: u64 = text("memory.current")?.trim().parse().ok()?;
    let files = text("memory.stat").and_then(|stat| {
        let line = stat.lines().find_map(|line| line.strip_prefix("inactive_file ").map(str::to_string))?;
        line.trim().parse::<u64>().ok()
    });
    Some(limit.saturating_sub(used.saturating_sub(files.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_any_machine_has_is_an_error_that_names_the_amount() {
        let mut values: Vec<u64> = Vec::new();
        let message = reserve(&mut values, 1 << 50, "the edges of a graph").unwrap_err().to_string();
        assert!(message.starts_with("not enough memory for the edges of a graph: 8388608.0 GiB"), "{message}");
        assert!(filled(0u8, usize::MAX, "x").is_err());
        assert_eq!(filled(7u8, 3, "x").unwrap(), [7; 3]);
        assert!(spare(1, "x").is_ok());
        if let Some(free) = free() {
            assert!(spare(free.saturating_mul(2), "x").is_err());
        }
    }

    #[test]
    fn the_least_limit_counts() {
        let limits = "Limit  Soft Limit  Hard Limit  Units\nMax address space         3000000000           unlimited            bytes\n";
        assert_eq!(address_space(limits, "Name:\tx\nVmSize:\t 1000000 kB\n"), Some(3_000_000_000 - 1_024_000_000));
        assert_eq!(address_space("Max address space   unlimited  unlimited  bytes", "VmSize: 1 kB"), None);
        assert_eq!(machine("MemTotal: 9 kB\nMemAvailable:  100 kB\nSwapFree:   28 kB\n"), Some(131_072));
        let folder = tempfile::tempdir().unwrap();
        let write = |at: &str, name: &str, text: &str| {
            std::fs::create_dir_all(folder.path().join(at)).unwrap();
            std::fs::write(folder.path().join(at).join(name), text).unwrap();
        };
        write("jobs/7", "memory.max", "max\n");
        write("jobs/7", "memory.current", "5\n");
        write("jobs", "memory.max", "1000\n");
        write("jobs", "memory.current", "700\n");
        write("jobs", "memory.stat", "anon 500\ninactive_file 200\n");
        assert_eq!(group("0::/jobs/7\n", folder.path()), Some(500));
        assert_eq!(group("0::/\n", folder.path()), None);
    }
}
