//! The one error type of the core, cut by what the user can do about it.

use std::path::{Path, PathBuf};

/// Result of every fallible function of the core.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong, said with the value found and what is allowed.
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
        /// What would be accepted.
        expected: String,
    },
    /// Data handed over in memory do not fit together or are not usable.
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
        /// Where it stands: `byte 247`, `line 3:7`, `chunk 12`.
        place: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// The file's format or a variant of it is not supported.
    #[error("{}: {reason}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is not supported, and what is.
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
    /// There is less memory than the work needs.
    #[error("{}", short_of(what, *needed, *free))]
    Memory {
        /// What it was for.
        what: String,
        /// Bytes that it needs, about.
        needed: u64,
        /// Bytes that were free, where the system tells.
        free: Option<u64>,
    },
    /// The work was cancelled by the user.
    #[error("interrupted")]
    Interrupted,
}

/// The sentence about missing memory.
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

impl Error {
    /// Shorthand for [`Error::InvalidParameter`].
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::InvalidParameter { name, value: value.to_string(), expected: expected.into() }
    }

    /// Shorthand for [`Error::InvalidInput`].
    pub fn input(message: impl Into<String>) -> Self {
        Self::InvalidInput(message.into())
    }

    /// Wraps an error of the operating system with the path it speaks of.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), source }
    }
}
