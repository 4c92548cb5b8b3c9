//! Clouds from stdin and to stdout: `-` in the place of a name.
//!
//! Files of clouds are not read and written from front to back (LAZ has a table of chunks at its end, LAS counts in its
//! header), so that a temporary file stands for each stream.

use crate::args::Command;
use crate::exit_code::Failure;
use crate::printer::Printer;
use scansion_core::Error;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// The folder of the temporary files, so that it can be removed whatever ends the process.
static FOLDER: Mutex<Option<PathBuf>> = Mutex::new(None);

/// The streams of a run; the temporary files are removed when this is dropped.
#[derive(Debug, Default)]
pub(crate) struct Pipes {
    /// What goes to stdout at the end.
    output: Option<PathBuf>,
}

impl Pipes {
    /// Puts temporary files in the place of `-`: what stdin has, and an empty name in the format asked for.
    ///
    /// # Errors
    /// If stdin is asked for twice, or cannot be read, or there is no room.
    pub(crate) fn open(command: &mut Command, format: Option<&str>, printer: &Printer) -> Result<Self, Failure> {
        let mut streams = command.streams();
        let is_stream = |path: &Path| path.as_os_str() == "-";
        let mut pipes = Self::default();
        let mut inputs: Vec<&mut PathBuf> = streams.inputs.drain(..).filter(|path| is_stream(path)).collect();
        let output = streams.output.filter(|path| is_stream(path));
        if inputs.len() > 1 {
            return Err(Failure::Usage("- stands for stdin, which can be read once".into()));
        }
        if inputs.is_empty() && output.is_none() {
            return match format {
                Some(_) => Err(Failure::Usage("--stdout-format is for outputs to -".into())),
                None => Ok(pipes),
            };
        }
        let folder = new_folder()?;
        if let Some(input) = inputs.pop() {
            let path = folder.join("stdin");
            spool(&path)?;
            printer.call(&path, "stdin");
            *input = path;
        }
        if let Some(output) = output {
            let path = folder.join(format!("stdout.{}", format.unwrap_or(streams.format)));
            printer.call(&path, "stdout");
            printer.stdout_is_taken();
            output.clone_from(&path);
            pipes.output = Some(path);
        }
        Ok(pipes)
    }

    /// Sends the output to stdout. That nobody reads any more is no error.
    pub(crate) fn finish(&self) -> Result<(), Failure> {
        let Some(path) = &self.output else { return Ok(()) };
        let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
        let mut out = std::io::stdout().lock();
        match std::io::copy(&mut file, &mut out).and_then(|_| out.flush()) {
            Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io(Path::new("stdout"), e).into()),
            _ => Ok(()),
        }
    }
}

impl Drop for Pipes {
    fn drop(&mut self) {
        remove();
    }
}

/// Removes the temporary files.
pub(crate) fn remove() {
    if let Some(folder) = FOLDER.try_lock().ok().and_then(|mut folder| folder.take()) {
        // What is left behind is in the system's folder for temporary files.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// A folder of this process that only its user can read.
fn new_folder() -> Result<PathBuf, Error> {
    let base = std::env::temp_dir();
    let mut attempt = 0u32;
    loop {
        let path = base.join(format!("scansion-{}-{attempt}", std::process::id()));
        let mut builder = std::fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        match builder.create(&path) {
            Ok(()) => {
                if let Ok(mut folder) = FOLDER.lock() {
                    *folder = Some(path.clone());
                }
                return Ok(path);
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists && attempt < 1000 => attempt += 1,
            Err(e) => return Err(Error::io(&path, e)),
        }
    }
}

/// Copies stdin to a file.
fn spool(path: &Path) -> Result<(), Error> {
    let mut file = File::create(path).map_err(|e| Error::io(path, e))?;
    let mut stdin = std::io::stdin().lock();
    let mut buffer = vec![0; 1 << 20];
    loop {
        match stdin.read(&mut buffer) {
            Ok(0) => return file.flush().map_err(|e| Error::io(path, e)),
            Ok(n) => file.write_all(&buffer[..n]).map_err(|e| Error::io(path, e))?,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(Error::io(Path::new("stdin"), e)),
        }
    }
}
