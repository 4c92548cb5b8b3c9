//! The only writer of output files: temporary name in the same folder, fsync, rename, fsync of the folder.
//!
//! The old file stays unchanged until the rename; a failure before that leaves nothing behind. A killed run leaves its
//! temporary file, which the next run that writes into the folder removes.

mod leftovers;
mod partials;
mod storage;
#[cfg(test)]
mod tests;

use super::run;
use crate::error::{Error, Result};
use leftovers::{fresh, sweep};
use partials::Partial;
pub use partials::abandon_outputs;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
pub use storage::Storage;

/// Largest number of chained links that are followed.
const MOST_LINKS: usize = 40;
#[cfg(not(test))]
#[expect(clippy::unnecessary_wraps, reason = "tests let it fail")]
fn step() -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
use fail::step;

/// Makes one operation of this thread's writers fail.
#[cfg(test)]
pub(crate) mod fail {
    use std::cell::Cell;

    thread_local! {
        static LEFT: Cell<Option<u64>> = const { Cell::new(None) };
    }

    /// Called before every operation.
    pub(super) fn step() -> std::io::Result<()> {
        let left = LEFT.get();
        LEFT.set(left.and_then(|n| n.checked_sub(1)));
        if left == Some(0) { Err(std::io::Error::other("no space left (said by the test)")) } else { Ok(()) }
    }

    /// Runs `work` once for each of its file operations, with that operation failing, and calls `check` after each run;
    /// ends when `work` performs fewer operations. Returns how many there are.
    pub(crate) fn at_each<T>(work: impl Fn() -> crate::Result<T>, check: impl Fn(bool)) -> u64 {
        for n in 0.. {
            LEFT.set(Some(n));
            let done = work().is_ok();
            let all_passed = LEFT.take().is_some();
            check(done);
            if all_passed {
                assert!(done, "nothing failed");
                return n;
            }
        }
        0
    }
}

/// A file that appears under its final name only when it is complete.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    partial: Partial,
    writer: Option<BufWriter<Storage>>,
    /// Refuses to replace a file that has appeared since, with this advice.
    refuse: Option<&'static str>,
}

impl AtomicFile {
    /// Opens a temporary file beside `target`: `.NAME.PID-RANDOM.partial`.
    ///
    /// # Errors
    /// If the folder does not exist or is not writable; the target is a folder, a device or a pipe; or it is an input
    /// of the run that must not be replaced.
    pub fn create(target: &Path) -> Result<Self> {
        let place = Place::find(target)?;
        run::begun(target, &place.target)?;
        Self::at(place, target)
    }

    fn at(place: Place, typed: &Path) -> Result<Self> {
        let Place { target, old } = place;
        let (file, partial) = step().and_then(|()| fresh(&target)).map_err(|e| Error::io(typed, explain(e)))?;
        let partial = Partial::new(partial);
        // A lock shows other runs that the file is in use; some file systems have no locks.
        let _ = file.try_lock();
        let refuse = run::refuses_existing(&target).filter(|_| old.is_none());
        if let Some(old) = old {
            // A user who could not read the old file must not be able to read the new one; some file systems have no
            // permissions.
            let _ = file.set_permissions(old.permissions());
        }
        Ok(Self { target, partial, writer: Some(BufWriter::with_capacity(1 << 20, Storage::new(file))), refuse })
    }

    /// The temporary name, for checks before [`AtomicFile::finish`].
    pub fn partial(&self) -> &Path {
        self.partial.path()
    }

    /// The final name.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// The writer of the file's content.
    ///
    /// # Errors
    /// If the file is already finished.
    pub fn writer(&mut self) -> Result<&mut BufWriter<Storage>> {
        self.writer.as_mut().ok_or_else(|| Error::io(&self.target, std::io::ErrorKind::NotConnected.into()))
    }

    /// Appends bytes.
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<()> {
        let target = self.target.clone();
        self.writer()?.write_all(bytes).map_err(|e| Error::io(&target, e))
    }

    /// Passes all buffered bytes to the operating system, so that the temporary file can be checked.
    pub fn flush(&mut self) -> Result<()> {
        let target = self.target.clone();
        self.writer()?.flush().map_err(|e| Error::io(&target, e))
    }

    /// Syncs and renames. After an error, or if the run is cancelled before the rename, the target is unchanged.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        if let Some(writer) = &mut self.writer {
            let monitor = run::monitor();
            let synced = writer.get_mut().sync(|| monitor.is_cancelled()).map_err(|e| Error::io(&self.target, e))?;
            if !synced {
                return Err(Error::Interrupted);
            }
        }
        self.writer = None;
        let renamed = step().and_then(|()| match self.refuse {
            Some(advice) => self.partial.rename_new(&self.target, advice),
            None => self.partial.rename(&self.target),
        });
        renamed.map_err(|e| Error::io(&self.target, e))?;
        let folder = self.target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Some file systems cannot sync a folder; the file itself is safe at this point.
        let _ = step().and_then(|()| File::open(folder)).and_then(|f| f.sync_all());
        run::done(&self.target);
        Ok(())
    }
}

/// The destination of an output.
#[derive(Debug)]
struct Place {
    /// The path after following all links.
    target: PathBuf,
    /// Metadata of the existing file, if there is one.
    old: Option<std::fs::Metadata>,
}

impl Place {
    /// Follows links, also to names that do not exist yet: the file a link points to is replaced, not the link.
    fn find(typed: &Path) -> Result<Self> {
        let refused = |reason: &str| Err(Error::io(typed, std::io::Error::other(reason)));
        let mut target = typed.to_path_buf();
        for _ in 0..MOST_LINKS {
            if target.file_name().is_none() {
                return Err(Error::io(typed, std::io::ErrorKind::InvalidInput.into()));
            }
            match std::fs::symlink_metadata(&target) {
                Ok(about) if about.is_symlink() => {
                    let to = std::fs::read_link(&target).map_err(|e| Error::io(typed, e))?;
                    target = target.parent().unwrap_or(Path::new("")).join(to);
                }
                Ok(about) if about.is_dir() => return Err(Error::io(typed, std::io::ErrorKind::IsADirectory.into())),
                // The rename would replace /dev/null by a regular file.
                Ok(about) if !about.is_file() => {
                    return refused("not a plain file; outputs are written beside their target and renamed");
                }
                Ok(about) => return Ok(Self { target, old: Some(about) }),
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Self { target, old: None }),
                Err(e) => return Err(Error::io(typed, e)),
            }
        }
        refused("a link that leads back to itself")
    }
}

/// Fails if the output could not be written later: its folder is missing or not writable, its name is too long, it is a
/// folder, a device or a pipe, an input of this run, or named twice. To be called before long work.
///
/// Also removes temporary files that killed runs have left in the folder.
pub fn check_output(path: &Path) -> Result<()> {
    let place = Place::find(path)?;
    let first = run::announce(path, &place.target)?;
    let file = AtomicFile::at(place, path)?;
    if first {
        sweep(&file);
    }
    Ok(())
}

/// Like [`check_output`], for an output that the run has already registered.
pub(super) fn check_place(path: &Path) -> Result<()> {
    AtomicFile::at(Place::find(path)?, path).map(drop)
}

/// For an output, "not found" is reported about its folder.
fn explain(error: std::io::Error) -> std::io::Error {
    match error.kind() {
        std::io::ErrorKind::NotFound => std::io::Error::other("the folder does not exist; make it first"),
        _ => error,
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // Taken apart instead of dropped: dropping a buffered writer would write again. The temporary file removes
        // itself.
        if let Some(writer) = self.writer.take() {
            let _ = writer.into_parts();
        }
    }
}

/// Writes a whole file atomically.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes)?;
    file.finish()
}
