//! Modules `segmentation` and `recipes`: segments of a cloud, and which of them to label next.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::matrix;
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use scansion_core::classes::ClassTable;
use scansion_core::cloud::{Cloud as CoreCloud, names};
use scansion_core::io::atomic;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{
    self, Doubt, KnownPoints, LabelParams, Labels, SegmentParams, SuggestParams, read_labels,
};
use scansion_core::segmentation::Intent;
use std::path::PathBuf;
use std::sync::Arc;

/// Segment of each point, from 1 (0: not finite), and the report as JSON.
type Parted<'py> = (Bound<'py, PyArray1<u32>>, String);

/// The same, with the segments of each level in between.
type Levels<'py> = (Bound<'py, PyArray1<u32>>, Vec<Bound<'py, PyArray1<u32>>>, String);

/// Settings from TOML text, single settings, and JSON of an aim and a size.
fn params(text: &str, settings: &[String], (aim, size): (&str, Option<f64>)) -> PyResult<SegmentParams> {
    let aim: Option<Intent> = json::settings(aim)?;
    let base = match SegmentParams::named(text) {
        Some(params) => params,
        None => SegmentParams::from_toml(text).map_err(raise)?,
    };
    let mut params = base.with_settings(settings.iter().map(String::as_str)).map_err(raise)?;
    if let Some(aim) = aim {
        params = params.aimed(aim).map_err(raise)?;
    }
    size.map_or(Ok(params.clone()), |size| params.with_size(size)).map_err(raise)
}

/// Columns of a cloud that a method needs (besides labels).
#[pyfunction]
pub(crate) fn segment_columns(recipe: &str, settings: Vec<String>) -> PyResult<Vec<String>> {
    Ok(params(recipe, &settings, ("null", None))?.columns())
}

/// Refuses options that were given but have no effect with the method.
#[pyfunction]
pub(crate) fn check_segment_options(recipe: &str, settings: Vec<String>, cutoff: bool, k_min: bool) -> PyResult<()> {
    let params = params(recipe, &settings, ("null", None))?;
    let cutoff = if cutoff { params.check_cutoff() } else { Ok(()) };
    let k_min = if k_min { params.check_neighbourhood() } else { Ok(()) };
    cutoff.and(k_min).map_err(raise)
}

/// Divides a cloud into segments.
#[pyfunction]
#[pyo3(signature = (cloud, recipe, settings, aim, size = None, n_jobs = None))]
pub(crate) fn segment<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    recipe: &str,
    settings: Vec<String>,
    aim: &str,
    size: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Levels<'py>> {
    let params = params(recipe, &settings, (aim, size))?;
    let cloud = Arc::clone(&cloud.inner);
    let (clusters, levels, report) = call(py, n_jobs, |monitor| {
        let found = recipes::segment(&cloud, labels(&cloud, false, monitor)?.as_ref(), &params, monitor)?;
        Ok((found.clusters, found.levels, json::text(&found.report)?))
    })?;
    let levels = levels.into_iter().map(|level| PyArray1::from_vec(py, level)).collect();
    Ok((PyArray1::from_vec(py, clusters), levels, report))
}

/// Divides a cloud into segments and suggests those whose labels would help most. `doubt` is a column of uncertainties, or
/// a column of probabilities for each of several classes.
#[pyfunction]
#[pyo3(signature = (cloud, recipe, settings, aim, wishes, size = None, doubt = None, labelled = false, page = None, n_jobs = None))]
#[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
pub(crate) fn suggest<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    recipe: &str,
    settings: Vec<String>,
    aim: &str,
    wishes: &str,
    size: Option<f64>,
    doubt: Option<PyReadonlyArray2<'_, f32>>,
    labelled: bool,
    page: Option<(PathBuf, String)>,
    n_jobs: Option<i64>,
) -> PyResult<Parted<'py>> {
    let params = params(recipe, &settings, (aim, size))?;
    let wishes: SuggestParams = json::settings(wishes)?;
    let doubt = match &doubt {
        Some(values) => Some((matrix(values, "uncertainty")?, values.shape()[1])),
        None => None,
    };
    let offered = |text: String| text.parse::<ClassTable>().map_err(raise);
    let page = page.map(|(path, text)| offered(text).map(|classes| (path, classes))).transpose()?;
    let cloud = Arc::clone(&cloud.inner);
    let (clusters, found) = call(py, n_jobs, |monitor| {
        page.as_ref().map_or(Ok(()), |(path, _)| atomic::check_output(path))?;
        let labels = labels(&cloud, labelled, monitor)?;
        let mut parted = recipes::segment(&cloud, labels.as_ref(), &params, monitor)?;
        parted.describe(&params.neighbourhood, monitor)?;
        let labels = labels.as_ref().filter(|_| labelled);
        let doubt = doubt.map(|(values, width)| match width {
            1 => Doubt::Uncertainty(values),
            classes => Doubt::Probabilities(values, classes),
        });
        let known = KnownPoints { doubt, labels };
        let found = recipes::suggest(&parted, known, &wishes, monitor)?;
        if let Some((path, offered)) = &page {
            let text = recipes::suggestion_page(&found, &parted, offered, monitor)?;
            atomic::write_bytes(path, text.as_bytes())?;
        }
        Ok((parted.clusters, json::text(&found)?))
    })?;
    Ok((PyArray1::from_vec(py, clusters), found))
}

/// The labels of a cloud, if it has any; codes 0, 1 and negative ones are unlabelled. Without need for them, those that are no
/// codes from 0 to 255 are left out with a warning.
fn labels(cloud: &CoreCloud, needed: bool, monitor: &Monitor) -> scansion_core::Result<Option<Labels>> {
    if cloud.column(names::CLASSIFICATION).is_none() {
        return Ok(None);
    }
    match read_labels(cloud, &LabelParams::default()) {
        Err(error) if !needed => {
            monitor.warn(format!("segments are not compared with the classes: {error}"));
            Ok(None)
        }
        found => Ok(Some(found?).filter(|l| l.unlabelled < cloud.len() as u64)),
    }
}
