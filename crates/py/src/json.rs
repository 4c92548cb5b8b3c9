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
    let what = in_words(what).unwrap_or_else(|| what.to_string());
    match error.path().to_string().as_str() {
        "." => what,
        key => format!("{key}: {what}"),
    }
}

/// The message about a value of the wrong kind, as the messages about values out of range have it; `None` for others.
fn in_words(message: &str) -> Option<String> {
    let text = message.strip_prefix("invalid type: ").or_else(|| message.strip_prefix("invalid value: "))?;
    let (found, expected) = text.rsplit_once(", expected ")?;
    let expected = match expected {
        "f64" | "f32" => "a number",
        "u8" => "a whole number in 0..255",
        "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or more",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a boolean" => "True or False",
        "a string" => "text",
        "a sequence" => "a list",
        other => other,
    };
    let kinds = ["integer ", "floating point ", "string ", "boolean "];
    let value = kinds.iter().find_map(|kind| found.strip_prefix(kind)).unwrap_or(found).trim_matches('`');
    let value = match value {
        "null" => "None",
        "true" => "True",
        "false" => "False",
        "map" => "a mapping",
        "sequence" => "a list",
        other => other,
    };
    Some(format!("found {value}, expected {expected}"))
}
