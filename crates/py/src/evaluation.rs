//! Module `evaluation`: scores of labels.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::graph::graph_of;
use crate::json;
use crate::neighbours::{points_kept, values_at};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
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
    let codes = confusion.classes().codes();
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
    let confusion = confusion(py, &truth, &predicted, names)?;
    confusion.check_some().and_then(|()| texts::to_json(&confusion)).map_err(raise)
}

/// The scores as a text table.
#[pyfunction]
pub(crate) fn report(
    py: Python<'_>,
    truth: PyReadonlyArray1<'_, i16>,
    predicted: PyReadonlyArray1<'_, i16>,
    names: Vec<String>,
) -> PyResult<String> {
    let confusion = confusion(py, &truth, &predicted, names)?;
    confusion.check_some().map(|()| texts::to_table(&confusion)).map_err(raise)
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
        // A raster that spans stray points would have too many cells.
        let points = points_kept(&cloud, monitor)?;
        let truth = values_at(&points, &truth)?;
        let partition = Partition::from_labels_watched(&values_at(&points, labels)?, monitor)?;
        let labelled = LabelledPartition { points: &points.positions, partition: &partition, truth: &truth };
        json::text(&evaluation::segmentation_error(labelled, &params, monitor)?)
    })
}

/// Precision, sensitivity, specificity and accuracy of each class against the others, as JSON.
#[pyfunction]
pub(crate) fn one_vs_rest(
    py: Python<'_>,
    truth: PyReadonlyArray1<'_, i16>,
    predicted: PyReadonlyArray1<'_, i16>,
    names: Vec<String>,
) -> PyResult<String> {
    json::text(&confusion(py, &truth, &predicted, names)?.one_vs_rest()).map_err(raise)
}

/// Share of the most frequent label in each segment, NaN without labels; segments ordered by their first nodes.
#[pyfunction]
pub(crate) fn purities<'py>(
    py: Python<'py>,
    labels: PyReadonlyArray1<'_, u32>,
    truth: PyReadonlyArray1<'_, i16>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (labels, truth) = (vector(&labels, "labels")?, vector(&truth, "truth")?);
    let found = call(py, Some(1), |monitor| {
        let partition = Partition::from_labels_watched(labels, monitor)?;
        evaluation::purities(&partition, &codes(truth, monitor)?)
    })?;
    Ok(PyArray1::from_vec(py, found.into_iter().map(|purity| purity.unwrap_or(f64::NAN)).collect()))
}

/// Agreement of the segments' boundaries with those of the labels on the edges of a graph, as JSON.
#[pyfunction]
pub(crate) fn boundary_scores(
    py: Python<'_>,
    edges: PyReadonlyArray2<'_, u32>,
    labels: PyReadonlyArray1<'_, u32>,
    truth: PyReadonlyArray1<'_, i16>,
    hops: usize,
) -> PyResult<String> {
    let (edges, labels, truth) = (matrix(&edges, "edges")?, vector(&labels, "labels")?, vector(&truth, "truth")?);
    call(py, Some(1), |monitor| {
        let graph = graph_of(labels.len(), edges, None, monitor)?;
        let partition = Partition::from_labels_watched(labels, monitor)?;
        json::text(&evaluation::boundary_scores(&graph, &partition, &codes(truth, monitor)?, hops)?)
    })
}
