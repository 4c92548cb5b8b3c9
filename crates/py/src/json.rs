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
    let mut reader = serde_json::Deserializer::from_str(text);
    serde_path_to_error::deserialize(&mut reader).map_err(|e| PyValueError::new_err(message(&e)))
}

/// What is wrong with which setting. The place in the text is left out, because callers never see that text.
fn message(error: &serde_path_to_error::Error<serde_json::Error>) -> String {
    let text = error.inner().to_string();
    let what = text.rsplit_once(" at line ").map_or(&text[..], |(what, _)| what);
    match error.path().to_string().as_str() {
        "." => what.to_string(),
        key => format!("{key}: {what}"),
    }
}
