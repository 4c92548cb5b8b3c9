//! Module `terrain`: ground points and heights above ground.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::vector;
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use scansion_core::terrain::{self, ElevationModel, ElevationParams, GroundParams};
use std::sync::Arc;

/// Whether each point is ground.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn ground_points<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let params: GroundParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        terrain::ground_points(&points(&cloud, metres_per_unit, monitor)?, &params, monitor)
    })?;
    Ok(PyArray1::from_vec(py, found))
}

/// Height of each point above the ground, given the ground points.
#[pyfunction]
#[pyo3(signature = (cloud, ground, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn heights<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    ground: PyReadonlyArray1<'py, bool>,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let params: ElevationParams = json::settings(settings)?;
    let ground = vector(&ground, "ground")?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?;
        ElevationModel::fit(&points, ground, &params, monitor)?.heights(&points, monitor)
    })?;
    Ok(PyArray1::from_vec(py, found))
}
