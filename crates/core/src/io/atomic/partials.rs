//! The temporary files of this process, so that all can be removed if it has to end immediately.

use super::run::exists;
use std::io::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

/// Names of the existing temporary files.
static OPEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// An existing temporary file, which is renamed to its final name, or removed when this value is dropped.
#[derive(Debug)]
pub(super) struct Partial(PathBuf);

impl Partial {
    /// Registers a file that was just created.
    pub(super) fn new(path: PathBuf) -> Self {
        if let Ok(mut open) = OPEN.lock() {
            open.push(path.clone());
        }
        Self(path)
    }

    /// Its path.
    pub(super) fn path(&self) -> &Path {
        &self.0
    }

    /// Gives the file its final name.
    pub(super) fn rename(&mut self, target: &Path) -> Result<()> {
        self.renamed(|from| std::fs::rename(from, target))
    }

    /// The same, unless a file has this name by now.
    pub(super) fn rename_new(&mut self, target: &Path, advice: &str) -> Result<()> {
        self.renamed(|from| rename_new(from, target, advice))
    }

    fn renamed(&mut self, rename: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        let mut open = OPEN.lock().map_err(|_| Error::other("a writer of this process has failed"))?;
        rename(&self.0)?;
        open.retain(|path| *path != self.0);
        self.0 = PathBuf::new();
        Ok(())
    }
}

/// Renames a file; an error if the new name is taken. In one step where the system and the file system can do that.
fn rename_new(from: &Path, to: &Path, advice: &str) -> Result<()> {
    #[cfg(target_os = "linux")]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        use rustix::io::Errno;
        match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
            Ok(()) => return Ok(()),
            Err(Errno::EXIST) => return Err(exists(advice)),
            // Not known to an old kernel or this file system.
            Err(Errno::INVAL | Errno::NOSYS) => {}
            Err(error) => return Err(error.into()),
        }
    }
    if to.exists() { Err(exists(advice)) } else { std::fs::rename(from, to) }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.0.as_os_str().is_empty() {
            let _ = std::fs::remove_file(&self.0);
            if let Ok(mut open) = OPEN.lock() {
                open.retain(|path| *path != self.0);
            }
        }
    }
}

/// Removes every temporary file of this process; no output can be started or finished afterwards. Does not allocate
/// memory.
///
/// For a process that is about to end while its threads are still running: after a signal, or when memory has run out.
pub fn abandon_outputs() {
    // A thread that was stopped while holding the lock may never release it.
    let list = (0..100).find_map(|_| {
        let list = OPEN.try_lock().ok();
        if list.is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        list
    });
    let Some(open) = list else { return };
    for path in open.iter() {
        let _ = std::fs::remove_file(path);
    }
    // Keeps the lock: a thread that starts or finishes an output waits here until the process has ended.
    std::mem::forget(open);
}
