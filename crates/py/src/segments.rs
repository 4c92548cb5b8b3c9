//! Rooms `segmentation` and `recipes`: segments of a cloud, and which of them to label next.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::vector;
use crate::json;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use scansion_core::cloud::{Cloud as CoreCloud, names};
use scansion_core::recipes::{self, LabelParams, Labels, SegmentParams, SuggestParams, read_labels};
use std::sync::Arc;

/// Segment of each point, from 1 (0: not finite), and the report as JSON.
type Parted<'py> = (Bound<'py, PyArray1<u32>>, String);

/// Parts a cloud into segments.
#[pyfunction]
#[pyo3(signature = (cloud, settings, n_jobs = None))]
pub(crate) fn segment<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Parted<'py>> {
    let params: SegmentParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let (clusters, report) = call(py, n_jobs, |monitor| {
        let found = recipes::segment(&cloud, labels(&cloud)?.as_ref(), &params, monitor)?;
        Ok((found.clusters, json::text(&found.report)?))
    })?;
    Ok((PyArray1::from_vec(py, clusters), report))
}

/// Parts a cloud and names the segments whose labels would help most.
#[pyfunction]
#[pyo3(signature = (cloud, settings, wishes, uncertainty = None, labelled = false, n_jobs = None))]
pub(crate) fn suggest<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    wishes: &str,
    uncertainty: Option<PyReadonlyArray1<'_, f32>>,
    labelled: bool,
    n_jobs: Option<i64>,
) -> PyResult<Parted<'py>> {
    let params: SegmentParams = json::settings(settings)?;
    let wishes: SuggestParams = json::settings(wishes)?;
    let uncertainty = uncertainty.as_ref().map(|u| vector(u, "uncertainty").map(<[f32]>::to_vec)).transpose()?;
    let cloud = Arc::clone(&cloud.inner);
    let (clusters, found) = call(py, n_jobs, |monitor| {
        let labels = labels(&cloud)?;
        let parted = recipes::segment(&cloud, labels.as_ref(), &params, monitor)?;
        let known = labels.as_ref().filter(|_| labelled);
        let found = recipes::suggest(&parted, uncertainty.as_deref(), known, &wishes)?;
        Ok((parted.clusters, json::text(&found)?))
    })?;
    Ok((PyArray1::from_vec(py, clusters), found))
}

/// The labels of a cloud that has some: codes 0 and 1 and negative ones say nothing.
fn labels(cloud: &CoreCloud) -> scansion_core::Result<Option<Labels>> {
    match cloud.column(names::CLASSIFICATION) {
        Some(_) => Ok(Some(read_labels(cloud, &LabelParams::default())?).filter(|l| l.unlabelled < cloud.len() as u64)),
        None => Ok(None),
    }
}
