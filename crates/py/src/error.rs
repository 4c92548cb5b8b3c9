//! Conversion of the core's errors to Python exceptions.

use crate::words::in_python;
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyOSError, PyValueError};
use pyo3::{PyErr, create_exception};
use scansion_core::Error;
use scansion_core::error::escaped;

create_exception!(
    scansion,
    FileFormatError,
    PyValueError,
    "A file is malformed, or is of a format or variant that is not supported; the message names the place."
);

/// The exception for an error of the core.
pub(crate) fn raise(error: Error) -> PyErr {
    match error {
        Error::Io { path, source } => os_error(&path, &source),
        Error::Malformed { .. } | Error::Unsupported { .. } | Error::OutputName { .. } => {
            FileFormatError::new_err(text(&error))
        }
        Error::Memory { .. } => PyMemoryError::new_err(text(&error)),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        _ => PyValueError::new_err(text(&error)),
    }
}

/// The message in the words of Python, with control characters from files escaped.
fn text(error: &Error) -> String {
    in_python(&escaped(&error.to_string()))
}

/// `OSError(errno, text, filename)`, which Python turns into `FileNotFoundError`, `PermissionError` and so on.
fn os_error(path: &std::path::Path, source: &std::io::Error) -> PyErr {
    let path = path.to_string_lossy().into_owned();
    match source.raw_os_error().or_else(|| errno(source.kind())) {
        Some(code) => PyOSError::new_err((code, source.to_string(), path)),
        None => PyOSError::new_err(format!("{path}: {source}")),
    }
}

/// Error numbers (the same on all systems) of error kinds that the core raises itself.
fn errno(kind: std::io::ErrorKind) -> Option<i32> {
    match kind {
        std::io::ErrorKind::NotFound => Some(2),
        std::io::ErrorKind::PermissionDenied => Some(13),
        std::io::ErrorKind::AlreadyExists => Some(17),
        _ => None,
    }
}
