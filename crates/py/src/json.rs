//! Settings and reports are passed as JSON, so that their names are defined only once, by the core's serde attributes.

use pyo3::PyResult;
use pyo3::exceptions::PyValueError;
use scansion_core::Error;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A report as JSON text.
pub(crate) fn text(report: &impl Serialize) -> scansion_core::Result<String> {
    serde_json::to_string(report).map_err(|e| Error::input(format!("report: {e}")))
}

/// Settings from JSON text; unknown keys are an error.
pub(crate) fn settings<T: DeserializeOwned>(text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|e| PyValueError::new_err(e.to_string()))
}
