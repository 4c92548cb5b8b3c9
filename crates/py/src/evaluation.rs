//! Module `evaluation`: scores of labels.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{to_matrix, vector};
use crate::error::raise;
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use scansion_core::evaluation::{self, Confusion, LabelledPartition, SegmentationErrorParams, report as texts};
use scansion_core::parallel::{Monitor, map_watched};
use scansion_core::segmentation::Partition;
use std::sync::Arc;

/// Compares codes (negative: no label, or not predicted); `names` are the class names by code, if the labels were text.
fn confusion(
    py: Python<'_>,
    truth: &PyReadonlyArray1<'_, i16>,
    predicted: &PyReadonlyArray1<'_, i16>,
    names: Vec<String>,
) -> PyResult<Confusion> {
    let (truth, predicted) = (vector(truth, "truth")?, vector(predicted, "predicted")?);
    let confusion =
        call(py, Some(1), |monitor| Confusion::from_partial(&codes(truth, monitor)?, &codes(predicted, monitor)?))?;
    Ok(match names.is_empty() {
        true => confusion,
        false => confusion.called(|class| names.get(usize::from(class.code)).cloned().unwrap_or(class.name)),
    })
}

/// Codes of classes; negative: no label or no prediction.
fn codes(values: &[i16], monitor: &Monitor) -> scansion_core::Result<Vec<Option<u8>>> {
    map_watched(values.len(), monitor, |i| u8::try_from(values[i]).ok())
}

/// Counts by true (row) and predicted (column) class, and the code of each row.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn confusion_matrix<'py>(
    py: Python<'py>,
    truth: PyReadonlyArray1<'_, i16>,
    predicted: PyReadonlyArray1<'_, i16>,
    names: Vec<String>,
) -> PyResult<(Bound<'py, PyArray2<u64>>, Bound<'py, PyArray1<u8>>)> {
    let confusion = confusion(py, &truth, &predicted, names)?;
    let codes: Vec<u8> = confusion.classes().classes().iter().map(|c| c.code).collect();
    let width = codes.len();
    let counts = (0..width * width).map(|i| confusion.count(i / width, i % width)).collect();
    Ok((to_matrix(py, counts, width)?, PyArray1::from_vec(py, codes)))
}

/// All scores as JSON.
#[pyfunction]
pub(crate) fn scores(
    py: Python<'_>,
    truth: PyReadonlyArray1<'_, i16>,
    predicted: PyReadonlyArray1<'_, i16>,
    names: Vec<String>,
) -> PyResult<String> {
    texts::to_json(&confusion(py, &truth, &predicted, names)?).map_err(raise)
}

/// The scores as a text table.
#[pyfunction]
pub(crate) fn report(
    py: Python<'_>,
    truth: PyReadonlyArray1<'_, i16>,
    predicted: PyReadonlyArray1<'_, i16>,
    names: Vec<String>,
) -> PyResult<String> {
    confusion(py, &truth, &predicted, names).map(|confusion| texts::to_table(&confusion))
}

/// Agreement of segments with the boundaries of the classes, as JSON; negative codes are unlabelled.
#[pyfunction]
pub(crate) fn segmentation_error(
    py: Python<'_>,
    cloud: &Cloud,
    labels: PyReadonlyArray1<'_, u32>,
    truth: PyReadonlyArray1<'_, i16>,
    settings: &str,
) -> PyResult<String> {
    let params: SegmentationErrorParams = json::settings(settings)?;
    let (labels, truth) = (vector(&labels, "labels")?, vector(&truth, "truth")?);
    let cloud = Arc::clone(&cloud.inner);
    call(py, Some(1), |monitor| {
        let truth = codes(truth, monitor)?;
        let partition = Partition::from_labels_watched(labels, monitor)?;
        let points = points(&cloud, None, monitor)?.positions;
        let labelled = LabelledPartition { points: &points, partition: &partition, truth: &truth };
        json::text(&evaluation::segmentation_error(labelled, &params, monitor)?)
    })
}
