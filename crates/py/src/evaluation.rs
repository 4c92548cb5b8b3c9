//! Room `evaluation`: how good labels are.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{to_matrix, vector};
use crate::error::raise;
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use scansion_core::evaluation::{self, Confusion, SegmentationErrorParams, report as texts};
use scansion_core::segmentation::Partition;
use std::sync::Arc;

fn confusion(
    py: Python<'_>,
    truth: &PyReadonlyArray1<'_, u8>,
    predicted: &PyReadonlyArray1<'_, u8>,
    unlabelled: Vec<u8>,
) -> PyResult<Confusion> {
    let (truth, predicted) = (vector(truth, "truth")?, vector(predicted, "predicted")?);
    py.detach(|| Confusion::from_labels(truth, predicted, &unlabelled)).map_err(raise)
}

/// Counts by true (row) and predicted (column) class, and the code of each row.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn confusion_matrix<'py>(
    py: Python<'py>,
    truth: PyReadonlyArray1<'_, u8>,
    predicted: PyReadonlyArray1<'_, u8>,
    unlabelled: Vec<u8>,
) -> PyResult<(Bound<'py, PyArray2<u64>>, Bound<'py, PyArray1<u8>>)> {
    let confusion = confusion(py, &truth, &predicted, unlabelled)?;
    let codes: Vec<u8> = confusion.classes().classes().iter().map(|c| c.code).collect();
    let width = codes.len();
    let counts = (0..width * width).map(|i| confusion.count(i / width, i % width)).collect();
    Ok((to_matrix(py, counts, width)?, PyArray1::from_vec(py, codes)))
}

/// All scores as JSON.
#[pyfunction]
pub(crate) fn scores(
    py: Python<'_>,
    truth: PyReadonlyArray1<'_, u8>,
    predicted: PyReadonlyArray1<'_, u8>,
    unlabelled: Vec<u8>,
) -> PyResult<String> {
    texts::to_json(&confusion(py, &truth, &predicted, unlabelled)?).map_err(raise)
}

/// The scores as a table for people.
#[pyfunction]
pub(crate) fn report(
    py: Python<'_>,
    truth: PyReadonlyArray1<'_, u8>,
    predicted: PyReadonlyArray1<'_, u8>,
    unlabelled: Vec<u8>,
) -> PyResult<String> {
    confusion(py, &truth, &predicted, unlabelled).map(|confusion| texts::to_table(&confusion))
}

/// How well segments keep the edges of the classes, as JSON; class 0 is unlabelled.
#[pyfunction]
pub(crate) fn segmentation_error(
    py: Python<'_>,
    cloud: &Cloud,
    labels: PyReadonlyArray1<'_, u32>,
    truth: PyReadonlyArray1<'_, u8>,
    settings: &str,
) -> PyResult<String> {
    let params: SegmentationErrorParams = json::settings(settings)?;
    let (labels, truth) = (vector(&labels, "labels")?, vector(&truth, "truth")?);
    let cloud = Arc::clone(&cloud.inner);
    call(py, Some(1), |_| {
        let truth: Vec<Option<u8>> = truth.iter().map(|&code| (code > 0).then_some(code)).collect();
        let partition = Partition::from_labels(labels)?;
        json::text(&evaluation::segmentation_error(&points(&cloud, None)?, &partition, &truth, &params)?)
    })
}
