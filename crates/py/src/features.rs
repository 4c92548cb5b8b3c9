//! Module `features`: the multi-scale features of a cloud.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::to_matrix;
use crate::error::raise;
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use scansion_core::features::{self, FeatureSet, PyramidParams, Quantity, RadiusParams};
use scansion_core::graph::{NormalParams, Orientation};
use std::sync::Arc;

/// Features of every point, one row a point.
#[pyfunction]
#[pyo3(signature = (cloud, settings, n_jobs = None))]
pub(crate) fn multiscale<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let set: FeatureSet = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let table = call(py, n_jobs, |monitor| features::table(&cloud, &set, monitor))?;
    let width = table.width();
    to_matrix(py, table.values, width)
}

/// Names of the columns of `multiscale`.
#[pyfunction]
pub(crate) fn feature_names(settings: &str, first_scale: f64) -> PyResult<Vec<String>> {
    let set: FeatureSet = json::settings(settings)?;
    set.validate().map_err(raise)?;
    Ok(set.names(first_scale))
}

/// Columns of the cloud that the features need.
#[pyfunction]
pub(crate) fn feature_columns(settings: &str) -> PyResult<Vec<String>> {
    json::settings::<FeatureSet>(settings).map(|set| set.columns())
}

/// The registry of features as JSON.
#[pyfunction]
pub(crate) fn feature_definitions() -> PyResult<String> {
    json::text(&features::definition::ALL).map_err(raise)
}

/// A preset's settings as JSON.
#[pyfunction]
pub(crate) fn feature_preset(name: &str) -> PyResult<String> {
    PyramidParams::preset(name).and_then(|params| json::text(&params)).map_err(raise)
}

/// Unit normals `(n, 3)` and surface variation `(n,)`.
#[pyfunction]
#[pyo3(signature = (cloud, k, orientation, metres_per_unit = None, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn normals<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    k: usize,
    orientation: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f32>>)> {
    let orientation: Orientation = json::settings(orientation)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?;
        NormalParams { neighbours: k, orientation }.find(&points, monitor)
    })?;
    let directions = to_matrix(py, found.directions.into_flattened(), 3)?;
    Ok((directions, PyArray1::from_vec(py, found.variation)))
}

/// Quantities of the points within each radius of each point, one row a point, radius after radius.
#[pyfunction]
#[pyo3(signature = (cloud, names, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn radius_features<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    names: Vec<String>,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let params: RadiusParams = json::settings(settings)?;
    let quantities = names.iter().map(|name| Quantity::named(name)).collect::<Result<Vec<_>, _>>().map_err(raise)?;
    let cloud = Arc::clone(&cloud.inner);
    let values = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?;
        features::radius_features(&points.positions, &quantities, &params, monitor)
    })?;
    to_matrix(py, values, quantities.len() * params.radii.len())
}

/// Names of all quantities of `radius_features`.
#[pyfunction]
pub(crate) fn radius_names() -> Vec<&'static str> {
    Quantity::ALL.iter().map(|quantity| quantity.name()).collect()
}
