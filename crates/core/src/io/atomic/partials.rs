//! The temporary files of this process, so that all can be removed if it has to end immediately.

use super::run::exists;
use std::io::{Error, Result};
#[cfg(unix)]
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

/// Names of the existing temporary files.
static OPEN: Mutex<Vec<Name>> = Mutex::new(Vec::new());

/// A path as the system takes it: to remove the file, no memory is allocated, however long the path is.
#[cfg(unix)]
type Name = std::ffi::CString;
#[cfg(not(unix))]
type Name = PathBuf;

fn name(path: &Path) -> Name {
    // A path of an existing file has no zero byte.
    #[cfg(unix)]
    return Name::new(path.as_os_str().as_bytes()).unwrap_or_default();
    #[cfg(not(unix))]
    return path.into();
}

/// Removes a file. What cannot be removed is left behind: the process is about to end.
fn unlink(name: &Name) {
    #[cfg(unix)]
    let _ = rustix::fs::unlink(name.as_c_str());
    #[cfg(not(unix))]
    let _ = std::fs::remove_file(name);
}

/// Takes a file off the list, without allocating memory while the list is locked.
fn forget(open: &mut Vec<Name>, path: &Path) {
    #[cfg(unix)]
    open.retain(|name| name.as_bytes() != path.as_os_str().as_bytes());
    #[cfg(not(unix))]
    open.retain(|name| name != path);
}

/// An existing temporary file, which is renamed to its final name, or removed when this value is dropped.
#[derive(Debug)]
pub(super) struct Partial(PathBuf);

impl Partial {
    /// Registers a file that was just created.
    pub(super) fn new(path: PathBuf) -> Self {
        let name = name(&path);
        if let Ok(mut open) = OPEN.lock() {
            open.push(name);
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
        forget(&mut open, &self.0);
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
                forget(&mut open, &self.0);
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
    open.iter().for_each(unlink);
    // Keeps the lock: a thread that starts or finishes an output waits here until the process has ended.
    std::mem::forget(open);
}
