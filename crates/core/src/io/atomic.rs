//! The one writer of all outputs: a temporary name in the same folder, fsync, rename, fsync of the folder.
//!
//! Until the rename the old file stays as it is; whatever fails before it leaves no trace.

use crate::error::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

static SERIAL: AtomicU64 = AtomicU64::new(0);

/// The partial files of this process.
static LIVE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes all partial files of this process: for a process that ends without unwinding. Asks for no memory.
pub fn abandon() {
    // A thread that ended inside may hold the list for ever.
    let list = (0..100).find_map(|_| match LIVE.try_lock() {
        Ok(list) => Some(list),
        Err(_) => {
            std::thread::sleep(Duration::from_millis(1));
            None
        }
    });
    for partial in list.iter().flat_map(|list| list.iter()) {
        let _ = std::fs::remove_file(partial);
    }
}

/// Adds a partial file to the list.
fn begun(partial: &Path) {
    if let Ok(mut live) = LIVE.lock() {
        live.push(partial.to_path_buf());
    }
}

/// Takes a partial file from the list.
fn ended(partial: &Path) {
    if let Ok(mut live) = LIVE.lock() {
        live.retain(|other| other != partial);
    }
}

/// The file that is written now. Every operation passes `step`, where tests let one fail.
#[derive(Debug)]
pub struct Storage(File);

impl Write for Storage {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if let Err(error) = step() {
            // A full disk takes a part before it refuses.
            let _ = self.0.write(&bytes[..bytes.len() / 2]);
            return Err(error);
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        step()?;
        self.0.flush()
    }
}

impl Seek for Storage {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        step()?;
        self.0.seek(to)
    }
}

#[cfg(not(test))]
#[expect(clippy::unnecessary_wraps, reason = "tests let it fail")]
fn step() -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
use fail::step;

/// Lets one operation of this thread's writers fail.
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

    /// Runs `work` once for each operation that it makes, with that one failing, and after each failure `check`; ends when
    /// `work` makes fewer operations. Returns how many there were.
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

/// A file that appears under its name only when it is complete.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    partial: PathBuf,
    writer: Option<BufWriter<Storage>>,
}

impl AtomicFile {
    /// Opens `.NAME.PID.partial` beside `target`.
    ///
    /// # Errors
    /// The folder does not exist or cannot be written; the target is a folder, a device or a pipe.
    pub fn create(target: &Path) -> Result<Self> {
        let name = target.file_name().ok_or_else(|| Error::io(target, std::io::ErrorKind::InvalidInput.into()))?;
        if target.is_dir() {
            return Err(Error::io(target, std::io::ErrorKind::IsADirectory.into()));
        }
        let old = std::fs::metadata(target).ok();
        if old.as_ref().is_some_and(|m| !m.is_file()) {
            // The rename would put a plain file in the place of /dev/null.
            let reason = "not a plain file; outputs are written beside their target and renamed";
            return Err(Error::io(target, std::io::Error::other(reason)));
        }
        if target.is_symlink() && old.is_some() {
            // What the link points to is replaced, not the link.
            return Self::create(&target.canonicalize().map_err(|e| Error::io(target, e))?);
        }
        let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
        let suffix = if serial == 0 { String::new() } else { format!("-{serial}") };
        let partial =
            target.with_file_name(format!(".{}.{}{suffix}.partial", name.to_string_lossy(), std::process::id()));
        // Never through a link that somebody else has put there. What bears our number is a dead process's.
        let new = || OpenOptions::new().read(true).write(true).create_new(true).open(&partial);
        let open = || match new() {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {
                std::fs::remove_file(&partial).and_then(|()| new())
            }
            opened => opened,
        };
        let file = step().and_then(|()| open()).map_err(|e| Error::io(target, explain(e)))?;
        begun(&partial);
        if let Some(old) = old {
            // Who could not read the old file shall not read the new one; some file systems know no permissions.
            let _ = file.set_permissions(old.permissions());
        }
        Ok(Self {
            target: target.to_path_buf(),
            partial,
            writer: Some(BufWriter::with_capacity(1 << 20, Storage(file))),
        })
    }

    /// The name under which the file is written now, for checks before [`AtomicFile::finish`].
    pub fn partial(&self) -> &Path {
        &self.partial
    }

    /// The name that the file will have.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Where bytes go.
    ///
    /// # Errors
    /// The file is finished already.
    pub fn writer(&mut self) -> Result<&mut BufWriter<Storage>> {
        self.writer.as_mut().ok_or_else(|| Error::io(&self.target, std::io::ErrorKind::NotConnected.into()))
    }

    /// Appends bytes.
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<()> {
        let target = self.target.clone();
        self.writer()?.write_all(bytes).map_err(|e| Error::io(&target, e))
    }

    /// Hands everything to the operating system, so that the partial file can be checked.
    pub fn flush(&mut self) -> Result<()> {
        let target = self.target.clone();
        self.writer()?.flush().map_err(|e| Error::io(&target, e))
    }

    /// Syncs and renames. After an error the target is what it was.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        if let Some(writer) = &self.writer {
            step().and_then(|()| writer.get_ref().0.sync_all()).map_err(|e| Error::io(&self.target, e))?;
        }
        self.writer = None;
        step().and_then(|()| std::fs::rename(&self.partial, &self.target)).map_err(|e| Error::io(&self.target, e))?;
        let folder = self.target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Some file systems cannot sync a folder; the file itself is safe by now.
        let _ = step().and_then(|()| File::open(folder)).and_then(|f| f.sync_all());
        ended(&self.partial);
        self.partial = PathBuf::new();
        Ok(())
    }
}

/// "Not found" of an output speaks of its folder.
fn explain(error: std::io::Error) -> std::io::Error {
    match error.kind() {
        std::io::ErrorKind::NotFound => std::io::Error::other("the folder does not exist; make it first"),
        _ => error,
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.partial.as_os_str().is_empty() {
            // Taken apart, not dropped: dropping a buffered writer would write once more.
            if let Some(writer) = self.writer.take() {
                let _ = writer.into_parts();
            }
            let _ = std::fs::remove_file(&self.partial);
            ended(&self.partial);
        }
    }
}

/// Writes a whole file atomically.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes)?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_old_file_stays_until_the_new_one_is_finished() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_bytes(&path, b"old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the partial file is gone");
        write_bytes(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_missing_folder_is_an_error_that_names_the_target() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("absent").join("a.txt");
        let message = write_bytes(&path, b"x").unwrap_err().to_string();
        assert!(message.contains("absent/a.txt"), "{message}");
        assert!(write_bytes(folder.path(), b"x").is_err(), "a folder is no target");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_permissions_kept_and_devices_refused() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a.txt"), folder.path().join("link.txt"));
        write_bytes(&path, b"old").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_bytes(&link, b"new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert!(write_bytes(Path::new("/dev/null"), b"x").unwrap_err().to_string().contains("plain file"));
    }

    /// Every writer, each from an old file that must stay until the new one is whole.
    #[test]
    fn whatever_fails_the_old_output_stays_and_nothing_is_left_behind() {
        use crate::cloud::{Cloud, Column, Values};
        use crate::io::{self, ConvertParams, Edit, WriteOptions};
        let folder = tempfile::tempdir().unwrap();
        let source = tempfile::tempdir().unwrap();
        let rows: Vec<[f64; 3]> = (0..60_000).map(|i| [f64::from(i % 251), f64::from(i / 251), 0.5]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud.set_column(Column::new("Height", Values::F32(vec![1.25; rows.len()]))).unwrap();
        let options = WriteOptions::default();
        let packed = WriteOptions { compressed: true, ..Default::default() };
        let mut labelled = cloud.clone();
        labelled.set_column(Column::new("Classification", Values::U8(vec![2; rows.len()]))).unwrap();
        let input = source.path().join("in.laz");
        io::write(&input, &cloud, &options).unwrap();
        let codes = [Edit::Classification(vec![6; rows.len()])];
        type Work<'a> = Box<dyn Fn(&Path) -> Result<()> + 'a>;
        let write = || -> Work<'_> { Box::new(|p| io::write(p, &cloud, &options)) };
        let rewrite = || -> Work<'_> { Box::new(|p| io::rewrite(&input, p, &codes, &options).map(|_| ())) };
        let works: Vec<(&str, Work<'_>)> = vec![
            ("a.las", write()),
            ("a.laz", write()),
            ("a.ply", write()),
            ("a.txt", write()),
            ("a.labels", Box::new(|p| io::write(p, &labelled, &options))),
            ("a.pcd", write()),
            ("c.pcd", Box::new(|p| io::write(p, &cloud, &packed))),
            ("a.npz", write()),
            ("c.npz", Box::new(|p| io::write(p, &cloud, &packed))),
            ("b.las", rewrite()),
            ("b.laz", rewrite()),
            ("c.las", Box::new(|p| io::convert(&input, p, &ConvertParams::default(), &options).map(|_| ()))),
            ("d.laz", Box::new(|p| io::merge(&[input.clone(), input.clone()], p, &options).map(|_| ()))),
            ("e.laz", Box::new(|p| io::salvage::copy(&input, p, &[], &options).map(|_| ()))),
            // Models, pictures, reports and recipes are bytes in memory.
            ("f.model", Box::new(|p| write_bytes(p, &vec![7; 3 << 20]))),
        ];
        for (name, work) in works {
            let path = folder.path().join(name);
            std::fs::write(&path, b"old").unwrap();
            let steps = fail::at_each(
                || work(&path),
                |done| {
                    let bytes = std::fs::read(&path).unwrap();
                    assert_eq!(bytes == b"old", !done, "{name}");
                    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{name}: something is left");
                    std::fs::write(&path, b"old").unwrap();
                },
            );
            assert!(steps >= 5, "{name}: {steps} steps");
            std::fs::remove_file(&path).unwrap();
        }
    }
}
