//! All terminal output. Control characters are escaped, because names and texts come from files.

use crate::args::{Format, Global};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::error::escaped;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Characters of the longest bar.
const LONGEST: f64 = 40.0;

/// A bar of a table in proportion to `value`; that of the `largest` value is the longest, and only 0 has none.
pub(crate) fn bar(value: f64, largest: f64) -> String {
    "#".repeat(if value > 0.0 { (LONGEST * value / largest).ceil() as usize } else { 0 })
}

/// Data to stdout, everything else to stderr.
#[derive(Debug)]
pub(crate) struct Printer {
    quiet: bool,
    colour: bool,
    /// Format of the data on stdout.
    pub(crate) format: Format,
    /// Names of temporary files, and what messages call them.
    called: Mutex<Vec<(String, &'static str)>>,
    /// Whether a cloud goes to stdout, so that data go to stderr.
    taken: AtomicBool,
}

impl Printer {
    pub(crate) fn new(global: &Global) -> Self {
        let plain = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
        let colour = !plain && std::io::stderr().is_terminal();
        let (quiet, format) = (global.quiet, global.format);
        Self { quiet, colour, format, called: Mutex::default(), taken: AtomicBool::new(false) }
    }

    /// Messages call a temporary file by this name.
    pub(crate) fn call(&self, path: &Path, name: &'static str) {
        if let Ok(mut called) = self.called.lock() {
            called.push((path.display().to_string(), name));
        }
    }

    /// A cloud goes to stdout.
    pub(crate) fn stdout_is_taken(&self) {
        self.taken.store(true, Ordering::Relaxed);
    }

    /// A text with the names of streams instead of temporary files, safe for a terminal.
    fn shown(&self, text: &str) -> String {
        let called = self.called.lock().map(|called| called.clone()).unwrap_or_default();
        escaped(&called.iter().fold(text.to_string(), |text, (path, name)| text.replace(path, name))).into_owned()
    }

    /// Data for the user or the next program. A closed pipe is not an error.
    pub(crate) fn data(&self, text: &str) -> Result<(), Failure> {
        let text = self.shown(text);
        let mut out: Box<dyn Write> = match self.taken.load(Ordering::Relaxed) {
            true => Box::new(std::io::stderr().lock()),
            false => Box::new(std::io::stdout().lock()),
        };
        let end = if text.ends_with('\n') { "" } else { "\n" };
        match out.write_all(text.as_bytes()).and_then(|()| out.write_all(end.as_bytes())).and_then(|()| out.flush()) {
            Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::io(Path::new("stdout"), e).into()),
            _ => Ok(()),
        }
    }

    /// A message about the current step; silent with `--quiet`.
    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            self.line("", text);
        }
    }

    /// A warning; shown unless `--quiet`.
    pub(crate) fn warning(&self, text: &str) {
        if !self.quiet {
            self.line(if self.colour { "\x1b[33mwarning:\x1b[0m " } else { "warning: " }, text);
        }
    }

    /// Why the run failed; always shown.
    pub(crate) fn error(&self, text: &str) {
        self.line(if self.colour { "\x1b[31merror:\x1b[0m " } else { "error: " }, text);
    }

    fn line(&self, prefix: &str, text: &str) {
        // Nothing can be done if stderr is closed.
        let _ = writeln!(std::io::stderr().lock(), "{prefix}{}", self.shown(text));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_in_proportion_to_the_largest() {
        let lengths = |values: [f64; 4]| values.map(|value| bar(value, 0.8).len());
        assert_eq!(lengths([0.8, 0.4, 1e-9, 0.0]), [40, 20, 1, 0]);
        assert_eq!(bar(0.0, 0.0), "");
    }
}
