//! The command line: the same program as the binary.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the command line with these arguments (the first is the program's name); returns the exit code.
#[pyfunction]
pub(crate) fn run(py: Python<'_>, arguments: Vec<OsString>) -> i32 {
    py.detach(|| scansion_cli::run(arguments)) as i32
}
