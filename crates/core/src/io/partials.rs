//! The temporary files of this process, so that it can remove them all when it has to end at once.

use std::io::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Names of the temporary files that exist now; none once the process is ending.
static OPEN: Mutex<Option<Vec<PathBuf>>> = Mutex::new(Some(Vec::new()));

/// A temporary file that exists: it is renamed to its final name, or removed when this value is dropped.
#[derive(Debug)]
pub(super) struct Partial(PathBuf);

impl Partial {
    /// Takes charge of a file that was just made. Fails, and removes it, if the process is ending.
    pub(super) fn new(path: PathBuf) -> crate::Result<Self> {
        let partial = Self(path);
        let open = OPEN.lock().ok().and_then(|mut open| open.as_mut().map(|open| open.push(partial.0.clone())));
        open.map(|()| partial).ok_or(crate::Error::Interrupted)
    }

    /// Its name.
    pub(super) fn path(&self) -> &Path {
        &self.0
    }

    /// Gives the file its final name.
    pub(super) fn rename(&mut self, target: &Path) -> Result<()> {
        let mut open = OPEN.lock().map_err(|_| Error::other("a writer of this process has failed"))?;
        std::fs::rename(&self.0, target)?;
        forget(&mut open, &self.0);
        self.0 = PathBuf::new();
        Ok(())
    }
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

fn forget(open: &mut Option<Vec<PathBuf>>, path: &Path) {
    if let Some(open) = open {
        open.retain(|p| p != path);
    }
}

/// Removes every temporary file of this process; no output can be begun or finished after it.
///
/// For a process that is about to end while its threads are still at work: after a signal, or without memory.
pub fn abandon_outputs() {
    let Ok(mut open) = OPEN.lock() else { return };
    for path in open.take().unwrap_or_default() {
        let _ = std::fs::remove_file(path);
    }
    // Whoever wants to rename its file waits for this lock until the process is gone.
    std::mem::forget(open);
}
