//! Module `filters`: noise, points in polygons, filtered files.

use crate::call::call;
use crate::cloud::Cloud;
use crate::json;
use numpy::PyArray1;
use pyo3::prelude::*;
use scansion_core::cloud::MetricCloud;
use scansion_core::filters::{self, Area, FilterParams, OutlierParams};
use scansion_core::io::{Bounds, WriteOptions, open};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Whether each point is a statistical outlier.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn statistical_outliers<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let params = OutlierParams::Statistical(json::settings(settings)?);
    outliers(py, cloud, params, metres_per_unit, n_jobs)
}

/// Whether each point has few neighbours within a radius.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn radius_outliers<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let params = OutlierParams::Radius(json::settings(settings)?);
    outliers(py, cloud, params, metres_per_unit, n_jobs)
}

fn outliers<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    params: OutlierParams,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let scene = MetricCloud::new(&cloud, metres_per_unit, monitor)?;
        filters::outliers(&scene, &vec![true; cloud.len()], &params, monitor)
    })?;
    Ok(PyArray1::from_vec(py, found))
}

/// Whether each point is inside the polygons of a text.
#[pyfunction]
#[pyo3(signature = (cloud, polygon, n_jobs = None))]
pub(crate) fn inside_polygon<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    polygon: &str,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| polygon.parse::<Area>()?.contains(&cloud, monitor))?;
    Ok(PyArray1::from_vec(py, found))
}

/// A text of polygons: well-known text as it is, else the content of the file of that name.
#[pyfunction]
pub(crate) fn polygon_text(py: Python<'_>, polygon: String) -> PyResult<String> {
    match Area::is_wkt(&polygon) {
        true => Ok(polygon),
        false => call(py, Some(1), |_| open::text(Path::new(&polygon), open::MOST_TABLE)),
    }
}

/// Writes the points of a file that all filters keep; returns the report as JSON.
#[pyfunction]
#[pyo3(signature = (input, output, settings, bounds = None, scale = None, n_jobs = None))]
pub(crate) fn filter(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    settings: &str,
    bounds: Option<Bounds>,
    scale: Option<[f64; 3]>,
    n_jobs: Option<i64>,
) -> PyResult<String> {
    let params = FilterParams { bounds, ..json::settings(settings)? };
    call(py, n_jobs, |monitor| {
        let options = WriteOptions { scale, monitor: monitor.clone(), ..WriteOptions::default() };
        json::text(&filters::filter_file(&input, &output, &params, &options)?)
    })
}
