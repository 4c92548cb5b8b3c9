//! Opening of input files; all input files are opened here.
//!
//! Clouds are read more than once and not sequentially, so that they must be regular files: a pipe, a device or a
//! folder is refused before anything is read, and opening never blocks. Settings, models and label tables are read once
//! and sequentially ([`bytes`], [`text`]), so that they may come from a pipe.

use super::run::{self, at_once};
use crate::error::{Error, Result};
use crate::memory;
use std::fs::{File, FileType};
use std::io::Read;
use std::path::Path;

/// Largest size of a recipe or other settings, in bytes.
pub const MOST_SETTINGS: u64 = 4 << 20;
/// Largest size of a label table, in bytes.
pub const MOST_TABLE: u64 = 1 << 30;
/// Largest size of a model, in bytes.
pub const MOST_MODEL: u64 = 8 << 30;

/// Opens a regular file.
///
/// # Errors
/// If it does not exist, cannot be read, or is a folder, a pipe or a device.
pub fn file(path: &Path) -> Result<File> {
    let file = at_once(path)?;
    let kind = file.metadata().map_err(|e| Error::io(path, e))?.file_type();
    match kind.is_file() {
        true => run::opened(path, &file).map(|()| file),
        false => Err(refused(path, kind)),
    }
}

/// Refuses the temporary file of a killed run, which is incomplete.
pub(super) fn refuse_partial(path: &Path) -> Result<()> {
    match path.file_name().is_some_and(|name| is_partial(&name.to_string_lossy())) {
        true => {
            let reason = "an output that was never finished; remove it and run the command again".to_string();
            Err(Error::Unsupported { path: path.to_path_buf(), reason })
        }
        false => Ok(()),
    }
}

/// Whether the name is that of a temporary file of an output.
pub(super) fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

/// The first bytes of a regular file that is not an input: of a file that an output would replace.
pub(crate) fn start(path: &Path, most: u64) -> Result<Vec<u8>> {
    let file = at_once(path)?;
    let kind = file.metadata().map_err(|e| Error::io(path, e))?.file_type();
    if !kind.is_file() {
        return Err(refused(path, kind));
    }
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    Ok(bytes)
}

/// All bytes of a regular file.
pub(super) fn whole(path: &Path) -> Result<Vec<u8>> {
    let mut file = file(path)?;
    let length = file.metadata().map_err(|e| Error::io(path, e))?.len();
    let mut bytes = Vec::new();
    memory::reserve(&mut bytes, usize::try_from(length).unwrap_or(usize::MAX), &path.display().to_string())?;
    file.read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    Ok(bytes)
}

/// All bytes of a file or a pipe, at most `most`.
///
/// # Errors
/// As [`file()`], except that pipes are allowed; and if there are more bytes.
pub fn bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    refuse_partial(path)?;
    let file = at_once(path)?;
    let about = file.metadata().map_err(|e| Error::io(path, e))?;
    let bytes = match about.file_type() {
        kind if kind.is_file() && about.len() > most => return Err(too_large(path, about.len(), most)),
        kind if kind.is_file() => {
            run::opened(path, &file)?;
            memory::require(about.len(), &path.display().to_string())?;
            let mut bytes = Vec::new();
            file.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
            bytes
        }
        kind if name(kind) == "a pipe" => from_pipe(path, file, most)?,
        kind => return Err(refused(path, kind)),
    };
    match bytes.len() as u64 > most {
        true => Err(too_large(path, bytes.len() as u64, most)),
        false => Ok(bytes),
    }
}

/// Fills `bytes` from offset `at` of a file.
pub(super) fn fill(path: &Path, file: &mut File, at: u64, bytes: &mut [u8]) -> Result<()> {
    match file.read_exact(bytes) {
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Err(Error::Malformed {
            path: path.to_path_buf(),
            format: "file",
            field: format!("{} bytes", bytes.len()),
            place: format!("byte {at}"),
            found: match file.metadata() {
                Ok(about) => format!("the end of the file at byte {}", about.len()),
                Err(_) => "the end of the file".into(),
            },
            allowed: "all of them; the file was cut, maybe while it was read".into(),
        }),
        Err(e) => Err(Error::io(path, e)),
        Ok(()) => Ok(()),
    }
}

/// The text of a file or a pipe, at most `most` bytes.
///
/// # Errors
/// As [`bytes`], and if the text is not UTF-8.
pub fn text(path: &Path, most: u64) -> Result<String> {
    String::from_utf8(bytes(path, most)?).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        Error::Malformed {
            path: path.to_path_buf(),
            format: "text",
            field: "character".into(),
            place: format!("byte {at}"),
            found: format!("{:02x?}", e.as_bytes().get(at).copied().unwrap_or(0)),
            allowed: "UTF-8".into(),
        }
    })
}

/// All bytes of a pipe, but at most one more than the limit. Waits for the other program until the run is cancelled.
#[cfg(unix)]
fn from_pipe(path: &Path, mut pipe: File, most: u64) -> Result<Vec<u8>> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let (monitor, mut bytes, mut piece) = (run::monitor(), Vec::new(), vec![0; 1 << 16]);
    let patience = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
    while bytes.len() as u64 <= most {
        monitor.check()?;
        match poll(&mut [PollFd::new(&pipe, PollFlags::IN)], Some(&patience)) {
            // A signal also ends the wait; whether it ends the run is checked above.
            Ok(0) | Err(rustix::io::Errno::INTR) => continue,
            Err(e) => return Err(Error::io(path, e.into())),
            Ok(_) => {}
        }
        match pipe.read(&mut piece) {
            Ok(0) => break,
            Ok(n) => bytes.extend_from_slice(&piece[..n]),
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::Interrupted) => {}
            Err(e) => return Err(Error::io(path, e)),
        }
    }
    Ok(bytes)
}

#[cfg(not(unix))]
fn from_pipe(path: &Path, mut pipe: File, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    (&mut pipe).take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    Ok(bytes)
}

fn refused(path: &Path, kind: FileType) -> Error {
    let reason = match name(kind) {
        "a folder" => "a folder, not a file; give the files in it".to_string(),
        "a pipe" => {
            "a pipe; clouds are read more than once, so write it to a file first (`cat PIPE > FILE`)".to_string()
        }
        other => format!("{other}, not a regular file; write what it gives to a file first"),
    };
    Error::Unsupported { path: path.to_path_buf(), reason }
}

/// Name of the kind of file, if it is not a regular file.
fn name(kind: FileType) -> &'static str {
    if kind.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
    }
    "a device"
}

fn too_large(path: &Path, found: u64, most: u64) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "file",
        field: "size".into(),
        place: "byte 0".into(),
        found: format!("{found} bytes"),
        allowed: format!("at most {most} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    #[cfg(unix)]
    #[test]
    fn only_regular_files_are_opened_and_nothing_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        rustix::fs::mknodat(rustix::fs::CWD, path("pipe"), rustix::fs::FileType::Fifo, 0o600.into(), 0).unwrap();
        std::fs::write(path("a.txt"), "1 2 3\n").unwrap();
        std::os::unix::fs::symlink(path("pipe"), path("link")).unwrap();
        let begin = Instant::now();
        for (name, said) in [("pipe", "a pipe"), ("link", "a pipe"), (".", "a folder")] {
            let message = file(&path(name)).unwrap_err().to_string();
            assert!(message.contains(said) && message.contains(name), "{message}");
        }
        let message = file(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(message.contains("/dev/zero: a device"), "{message}");
        assert!(begin.elapsed() < Duration::from_secs(2));
        assert!(file(&path("a.txt")).is_ok());
        assert!(matches!(file(&path("absent")), Err(Error::Io { .. })));
    }

    #[test]
    fn a_file_above_its_limit_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, [b'a'; 100]).unwrap();
        assert_eq!(bytes(&path, 100).unwrap().len(), 100);
        let message = bytes(&path, 99).unwrap_err().to_string();
        assert!(message.contains("found 100 bytes, allowed at most 99"), "{message}");
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(text(&path, 99).unwrap_err().to_string().contains("byte 2"));
    }
}
