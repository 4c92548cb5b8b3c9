//! The error type of the core; its variants are distinguished by what the user can do.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Result of every fallible function of the core.
pub type Result<T> = std::result::Result<T, Error>;

/// All errors, each with the value found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is outside its range: choose another value.
    #[error("parameter {name}: found {value}, expected {expected}")]
    InvalidParameter {
        /// Name of the field of the params struct.
        name: &'static str,
        /// The value that was given.
        value: String,
        /// Allowed values.
        expected: String,
    },
    /// Data passed in memory are inconsistent or not usable.
    #[error("{0}")]
    InvalidInput(String),
    /// A file's content is malformed. `place` is a byte offset, a record, a chunk, or `line:column`.
    #[error("{}: {format}: {field} at {place} (found {found}, allowed {allowed})", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Format as read: `LAS`, `LAZ`, `PLY`, `text`, `model`.
        format: &'static str,
        /// The field that is wrong.
        field: String,
        /// Location of the error: `byte 247`, `line 3:7`, `chunk 12`.
        place: String,
        /// Value found.
        found: String,
        /// Values allowed.
        allowed: String,
    },
    /// The file's format or a variant of it is not supported.
    #[error("{}: {reason}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is not supported, and the alternatives.
        reason: String,
    },
    /// The name of an output ends in no extension that can be written: choose another name.
    #[error("{}: {reason}", path.display())]
    OutputName {
        /// The output.
        path: PathBuf,
        /// The extensions that can be written.
        reason: String,
    },
    /// The operating system refused to read or write.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's own error.
        source: std::io::Error,
    },
    /// A model does not fit the data: missing features, other classes, newer version.
    #[error("model does not fit: {0}")]
    ModelMismatch(String),
    /// Two files that must differ are the same.
    #[error("{}; {advice}", same_file(first, second, what))]
    SameFile {
        /// One of them, as the user gave it.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// Their roles: `input and output`, `an output twice`.
        what: &'static str,
        /// What to do instead.
        advice: &'static str,
    },
    /// The work needs more memory than is free.
    #[error("{}", short_of(what, *needed, *free))]
    Memory {
        /// Purpose of the memory.
        what: String,
        /// Bytes needed, approximately.
        needed: u64,
        /// Bytes free, if the system tells.
        free: Option<u64>,
    },
    /// The work was cancelled by the user.
    #[error("interrupted")]
    Interrupted,
}

/// The text with control characters, and characters that change the direction of writing, escaped as `\u001b`; line
/// ends and tabs stay.
///
/// For text from files that is shown on a terminal: it could otherwise move the cursor or display something misleading.
pub fn escaped(text: &str) -> Cow<'_, str> {
    let acts = |c: char| {
        let turns = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        turns || (c.is_control() && !matches!(c, '\n' | '\t'))
    };
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match acts(c) {
            true => shown.push_str(&format!("\\u{:04x}", u32::from(c))),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

fn same_file(first: &Path, second: &Path, what: &str) -> String {
    match first == second {
        true => format!("{} is {what}", first.display()),
        false => format!("{} and {} are the same file, {what}", first.display(), second.display()),
    }
}

/// The message about missing memory.
fn short_of(what: &str, needed: u64, free: Option<u64>) -> String {
    let size = |bytes: u64| match bytes {
        0..0x4000_0000 => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
        _ => format!("{:.1} GiB", bytes as f64 / 1_073_741_824.0),
    };
    let found = free.map(|free| format!(", {} are free", size(free))).unwrap_or_default();
    format!(
        "not enough memory for {what}: {} are needed{found}; raise the limit, or take a part of the points at a time",
        size(needed)
    )
}

/// A value that was found in a file, and what is allowed there.
#[derive(Clone, Debug)]
pub(crate) struct Mismatch {
    pub(crate) found: String,
    pub(crate) allowed: String,
}

impl Mismatch {
    pub(crate) fn new(found: impl ToString, allowed: impl ToString) -> Self {
        Self { found: found.to_string(), allowed: allowed.to_string() }
    }
}

impl Error {
    /// Shorthand for [`Error::InvalidParameter`].
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::InvalidParameter { name, value: value.to_string(), expected: expected.into() }
    }

    /// Shorthand for [`Error::InvalidInput`].
    pub fn input(message: impl Into<String>) -> Self {
        Self::InvalidInput(message.into())
    }

    /// The same error, with the place at which unusable data were found before its message.
    #[must_use]
    pub fn within(self, place: &str) -> Self {
        match self {
            Self::InvalidInput(message) => Self::InvalidInput(format!("{place}: {message}")),
            other => other,
        }
    }

    /// Wraps an error of the operating system together with the path.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        let early = source.kind() == std::io::ErrorKind::UnexpectedEof;
        let source = match early {
            true => {
                std::io::Error::new(source.kind(), "the file ends too early; it was cut, or changed while it was read")
            }
            false => source,
        };
        Self::Io { path: path.to_path_buf(), source }
    }
}

/// The three names nearest to an unknown one by edits, in any case, the nearest first.
pub(crate) fn nearest_names<'a>(names: impl IntoIterator<Item = &'a str>, unknown: &str) -> Vec<&'a str> {
    let unknown = unknown.to_lowercase();
    let mut names: Vec<&str> = names.into_iter().collect();
    names.sort_by_key(|name| strsim::levenshtein(&name.to_lowercase(), &unknown));
    let mut near: Vec<&str> = Vec::new();
    for name in names {
        if near.len() < 3 && !near.contains(&name) {
            near.push(name);
        }
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_everything_else_stays() {
        assert_eq!(escaped("a\u{1b}[31m\rb\u{9b}2J\u{202e}\u{7f}"), "a\\u001b[31m\\u000db\\u009b2J\\u202e\\u007f");
        assert!(matches!(escaped("Höhe\t1\nz\u{301}"), Cow::Borrowed(_)));
    }

    #[test]
    fn a_short_read_is_said_in_words() {
        let message = Error::io(Path::new("a.las"), std::io::ErrorKind::UnexpectedEof.into()).to_string();
        assert!(message.contains("a.las: the file ends too early"), "{message}");
    }
}
