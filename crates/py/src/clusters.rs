//! Modules `segmentation` and `features`: clusters at four levels.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::to_matrix;
use crate::error::raise;
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use scansion_core::features::colours;
use scansion_core::recipes::{ClusterTableParams, cluster_table as table_of};
use scansion_core::segmentation::{self, ClusterInput, ClusterParams};
use scansion_core::terrain::filtered_heights;
use std::sync::Arc;

/// The parameters of the segmentation and the number of clusters on each level, as JSON.
type Report = String;

/// Radius, least size, angle and offset of segments as JSON.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn automatic_parameters(
    py: Python<'_>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<String> {
    let params: ClusterParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?;
        segmentation::automatic_parameters(&points.positions, &params, monitor)
    })?;
    json::text(&found).map_err(raise)
}

/// Cluster of each point on levels 1 to 4, level after level, the centrality of each point, and the report.
#[pyfunction]
#[pyo3(signature = (cloud, settings, colour, metres_per_unit = None, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays and a text")]
pub(crate) fn cluster_levels<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    colour: bool,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<u32>>, Bound<'py, PyArray1<f32>>, Report)> {
    let params: ClusterParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let (labels, central, found) = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?;
        let heights = filtered_heights(&points, &Default::default(), monitor)?;
        let colour = if colour { Some(colours(&cloud, &points.frame.index, monitor)?) } else { None };
        let input = ClusterInput { points: &points.positions, heights: Some(&heights), colours: colour.as_deref() };
        let found = segmentation::cluster_levels(&input, &params, monitor)?;
        let mut labels = Vec::with_capacity(4 * found.len());
        for level in 1..=4 {
            labels.extend(found.labels(level, monitor)?);
        }
        let central = found.centralities(monitor)?;
        Ok((labels, central, (found.automatic, found.counts)))
    })?;
    let width = central.len();
    let report = json::text(&serde_json::json!({ "automatic": found.0, "counts": found.1 })).map_err(raise)?;
    let labels = to_matrix(py, labels, width)?;
    Ok((labels, PyArray1::from_vec(py, central), report))
}

/// The features of one of the three sets, the names of their columns, and the report.
#[pyfunction]
#[pyo3(signature = (cloud, settings, n_jobs = None))]
pub(crate) fn cluster_table<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Vec<String>, Report)> {
    let params: ClusterTableParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| table_of(&cloud, &params, monitor))?;
    let report =
        json::text(&serde_json::json!({ "automatic": found.automatic, "counts": found.counts })).map_err(raise)?;
    let width = found.table.width();
    Ok((to_matrix(py, found.table.values, width)?, found.table.names, report))
}
