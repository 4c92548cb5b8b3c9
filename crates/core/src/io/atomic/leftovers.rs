//! Temporary files: their names, and what killed runs have left of them.

use super::AtomicFile;
use crate::io::open;
use std::fs::{File, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Bytes of the target's name that the temporary name shows.
const SHOWN: usize = 64;
/// A temporary file that nobody holds is removed if it was not written to for so long.
pub(super) const FORGOTTEN: Duration = Duration::from_secs(3600);

/// A new file beside the target, under a name that no other process or machine takes.
pub(super) fn fresh(target: &Path) -> std::io::Result<(File, PathBuf)> {
    let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let shown = (0..=SHOWN.min(name.len())).rev().find_map(|end| name.get(..end)).unwrap_or_default();
    loop {
        // Keys of the standard library's hash maps come from the system's source of randomness.
        let random = RandomState::new().build_hasher().finish();
        let partial = target.with_file_name(format!(".{shown}.{}-{random:016x}.partial", std::process::id()));
        // Never through a link that somebody else has put there.
        match OpenOptions::new().read(true).write(true).create_new(true).open(&partial) {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            opened => return opened.map(|file| (file, partial)),
        }
    }
}

/// Removes the temporary files in a file's folder that no process holds and that are much older than the file.
pub(super) fn sweep(file: &AtomicFile) {
    let folder = file.target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let written = |path: &Path| std::fs::metadata(path).and_then(|about| about.modified()).ok();
    // Both times are the file system's, so no clocks are compared.
    let Some(limit) = written(file.partial()).and_then(|now| now.checked_sub(FORGOTTEN)) else { return };
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.filter_map(std::result::Result::ok) {
        let path = entry.path();
        let forgotten = is_ours(&entry.file_name().to_string_lossy()) && written(&path).is_some_and(|at| at < limit);
        if forgotten && open::at_once(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            // It may be somebody else's, who will see to it.
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Whether a name is one that [`fresh`] gives.
fn is_ours(name: &str) -> bool {
    let middle = name.strip_suffix(".partial").filter(|_| open::is_partial(name));
    let Some((pid, random)) = middle.and_then(|m| m.rsplit_once('.')?.1.split_once('-')) else { return false };
    let digits = |text: &str, radix| !text.is_empty() && text.chars().all(|c| c.is_digit(radix));
    digits(pid, 10) && random.len() == 16 && digits(random, 16)
}
