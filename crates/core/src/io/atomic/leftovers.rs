//! Temporary files: their names, and the removal of those that killed runs have left.

use super::AtomicFile;
use crate::io::{open, run};
use std::fs::{File, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Bytes of the target's name that are part of the temporary name.
const SHOWN: usize = 64;
/// Age (since the last write) at which a temporary file that no process holds is removed.
pub(super) const FORGOTTEN: Duration = Duration::from_secs(3600);

/// Creates a new file beside the target, under a name that no other process or machine uses.
pub(super) fn fresh(target: &Path) -> std::io::Result<(File, PathBuf)> {
    let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let shown = (0..=SHOWN.min(name.len())).rev().find_map(|end| name.get(..end)).unwrap_or_default();
    loop {
        // The hash keys of the standard library come from the system's random source.
        let random = RandomState::new().build_hasher().finish();
        let partial = target.with_file_name(format!(".{shown}.{}-{random:016x}.partial", std::process::id()));
        // Never follows a link that somebody else has created under this name.
        match OpenOptions::new().read(true).write(true).create_new(true).open(&partial) {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            opened => return opened.map(|file| (file, partial)),
        }
    }
}

/// Removes the temporary files in the folder of a file that no process holds and that are much older than the file.
pub(super) fn sweep(file: &AtomicFile) {
    let folder = file.target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let written = |path: &Path| std::fs::metadata(path).and_then(|about| about.modified()).ok();
    // Both times are from the file system, so that different clocks are not compared.
    let Some(limit) = written(file.partial()).and_then(|now| now.checked_sub(FORGOTTEN)) else { return };
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.filter_map(std::result::Result::ok) {
        let path = entry.path();
        let forgotten = is_ours(&entry.file_name().to_string_lossy()) && written(&path).is_some_and(|at| at < limit);
        if forgotten && run::at_once(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            // If it cannot be removed, it may belong to another user, whose runs will remove it.
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Whether a name has the form that [`fresh`] gives.
fn is_ours(name: &str) -> bool {
    let middle = name.strip_suffix(".partial").filter(|_| open::is_partial(name));
    let Some((pid, random)) = middle.and_then(|m| m.rsplit_once('.')?.1.split_once('-')) else { return false };
    let digits = |text: &str, radix| !text.is_empty() && text.chars().all(|c| c.is_digit(radix));
    digits(pid, 10) && random.len() == 16 && digits(random, 16)
}
