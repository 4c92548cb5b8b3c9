//! Labels picked by hand, spread over segments; colours of segments.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{to_matrix, values, vector};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use scansion_core::cloud::CodeScheme;
use scansion_core::images::segment_colour;
use scansion_core::recipes::{LabelFile, Labels, PickedCloud, Picking};
use std::path::PathBuf;
use std::sync::Arc;

/// The labels of a cloud's points from tables and polygons, -1 where there is none.
#[pyfunction]
#[pyo3(signature = (cloud, files, within, unit = None, n_jobs = None))]
pub(crate) fn picked_labels<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    files: Vec<PathBuf>,
    within: f64,
    unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<i16>>> {
    if !(within > 0.0 && within.is_finite()) {
        return Err(PyValueError::new_err(format!("within: found {within}, expected metres, above 0")));
    }
    let cloud = Arc::clone(&cloud.inner);
    let labels = call(py, n_jobs, |monitor| {
        let picking = Picking { metres: cloud.metres(unit)?, within };
        let files = files.iter().map(|path| LabelFile::read(path)).collect::<scansion_core::Result<Vec<_>>>()?;
        LabelFile::apply_all(&files, &[PickedCloud { cloud: &cloud, picking }], monitor)
    })?;
    Ok(PyArray1::from_vec(py, labels.iter().flat_map(signed).collect()))
}

/// Each segment gets the most frequent of its labels.
#[pyfunction]
pub(crate) fn spread_labels<'py>(
    py: Python<'py>,
    labels: PyReadonlyArray1<'py, i16>,
    segments: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<i16>>> {
    let labels = vector(&labels, "labels")?;
    let segments = values(segments, "segments")?;
    if segments.len() != labels.len() {
        return Err(PyValueError::new_err(format!("segments: found {}, expected {}", segments.len(), labels.len())));
    }
    let codes = labels.iter().map(|&label| u8::try_from(label).ok()).collect();
    let spread = Labels::new(codes, CodeScheme::Own).spread(&segments);
    Ok(PyArray1::from_vec(py, signed(&spread).collect()))
}

/// Red, green and blue of each segment number.
#[pyfunction]
pub(crate) fn segment_colours<'py>(
    py: Python<'py>,
    segments: PyReadonlyArray1<'py, u32>,
) -> PyResult<Bound<'py, PyArray2<u8>>> {
    let colours = vector(&segments, "segments")?.iter().flat_map(|&segment| segment_colour(segment)).collect();
    to_matrix(py, colours, 3)
}

/// Codes, -1 for points without a label.
fn signed(labels: &Labels) -> impl Iterator<Item = i16> {
    labels.codes.iter().map(|code| code.map_or(-1, i16::from))
}
