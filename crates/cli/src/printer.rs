//! All terminal output. Control characters are escaped, because names and texts come from files.

use crate::args::{Format, Global};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::error::escaped;
use std::io::{IsTerminal, Write};
use std::path::Path;

/// Data to stdout, everything else to stderr.
#[derive(Debug)]
pub(crate) struct Printer {
    quiet: bool,
    colour: bool,
    /// Format of the data on stdout.
    pub(crate) format: Format,
}

impl Printer {
    pub(crate) fn new(global: &Global) -> Self {
        let plain = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
        Self { quiet: global.quiet, colour: !plain && std::io::stderr().is_terminal(), format: global.format }
    }

    /// Data for the user or the next program. A closed pipe is not an error.
    pub(crate) fn data(&self, text: &str) -> Result<(), Failure> {
        let text = escaped(text);
        let mut out = std::io::stdout().lock();
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
        let _ = writeln!(std::io::stderr().lock(), "{prefix}{}", escaped(text));
    }
}
