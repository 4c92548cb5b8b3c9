//! Module `regularisation`: labellings of least energy, smoothed probabilities, neighbours that agree.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, to_matrix, vector};
use crate::graph::{graph_of, optional};
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use scansion_core::graph::Graph;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{Probabilities, Regularise, RegulariseParams, regularise};
use scansion_core::regularisation::{self, Energy, ExpansionParams, IcmParams, Labelling, SwapParams};
use scansion_core::{Error, Result};
use std::sync::Arc;

/// Labels, energy, whether the search converged.
type Found<'py> = (Bound<'py, PyArray1<u16>>, f64, bool);

/// Arrays of a labelling problem.
#[derive(FromPyObject)]
pub(crate) struct Problem<'py>(
    PyReadonlyArray2<'py, f32>,
    PyReadonlyArray2<'py, u32>,
    Option<PyReadonlyArray1<'py, f32>>,
);

fn solve<'py>(
    py: Python<'py>,
    problem: &Problem<'py>,
    n_jobs: Option<i64>,
    search: impl FnOnce(&[f32], &Graph, &Monitor) -> Result<Labelling> + Send,
) -> PyResult<Found<'py>> {
    let nodes = problem.0.shape()[0];
    let (unary, edges) = (matrix(&problem.0, "unary")?, matrix(&problem.1, "edges")?);
    let weights = optional(problem.2.as_ref(), "weights")?;
    let found = call(py, n_jobs, |monitor| {
        let graph = graph_of(nodes, edges, weights, monitor)?;
        search(unary, &graph, monitor)
    })?;
    Ok((PyArray1::from_vec(py, found.labels), found.energy, found.converged))
}

#[pyfunction]
#[pyo3(signature = (problem, settings, n_jobs = None))]
pub(crate) fn alpha_expansion<'py>(
    py: Python<'py>,
    problem: Problem<'py>,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Found<'py>> {
    let params: ExpansionParams = json::settings(settings)?;
    solve(py, &problem, n_jobs, |unary, graph, m| regularisation::alpha_expansion(unary, graph, &params, m))
}

#[pyfunction]
#[pyo3(signature = (problem, settings, n_jobs = None))]
pub(crate) fn alpha_beta_swap<'py>(
    py: Python<'py>,
    problem: Problem<'py>,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Found<'py>> {
    let params: SwapParams = json::settings(settings)?;
    solve(py, &problem, n_jobs, |unary, graph, m| regularisation::alpha_beta_swap(unary, graph, &params, m))
}

#[pyfunction]
pub(crate) fn icm<'py>(py: Python<'py>, problem: Problem<'py>, settings: &str) -> PyResult<Found<'py>> {
    let params: IcmParams = json::settings(settings)?;
    solve(py, &problem, Some(1), |unary, graph, m| regularisation::iterated_conditional_modes(unary, graph, &params, m))
}

/// Labels, the probabilities that they are based on, energy.
type Agreed<'py> = (Bound<'py, PyArray1<u16>>, Bound<'py, PyArray2<f32>>, Option<f64>);

/// Whether the result of a method depends on a strength.
#[pyfunction]
pub(crate) fn has_strength(method: &str) -> bool {
    Regularise::ALL.iter().any(|known| known.name() == method && known.has_strength())
}

/// Labels that are consistent among neighbours, from class probabilities; the settings are those of recipes.
#[pyfunction]
#[pyo3(signature = (cloud, probabilities, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn regularize<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    probabilities: PyReadonlyArray2<'py, f32>,
    settings: Vec<String>,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Agreed<'py>> {
    let classes = probabilities.shape()[1];
    let values = matrix(&probabilities, "probabilities")?;
    let cloud = Arc::clone(&cloud.inner);
    let (labels, rows, energy) = call(py, n_jobs, |monitor| {
        let params = RegulariseParams::default().with_settings(settings.iter().map(String::as_str))?;
        let points = points(&cloud, metres_per_unit, monitor)?;
        let found = regularise(&points.positions, Probabilities { values, classes }, &params, monitor)?;
        let rows = (0..points.len()).flat_map(|point| found.row(point, classes)).copied().collect();
        Ok((found.labels, rows, found.energy))
    })?;
    Ok((PyArray1::from_vec(py, labels), to_matrix(py, rows, classes)?, energy))
}

/// Energy of given labels; the settings are those of `alpha_expansion`.
#[pyfunction]
pub(crate) fn energy(
    py: Python<'_>,
    problem: Problem<'_>,
    labels: PyReadonlyArray1<'_, u16>,
    settings: &str,
) -> PyResult<f64> {
    let params: ExpansionParams = json::settings(settings)?;
    let labels = vector(&labels, "labels")?;
    let found = solve(py, &problem, Some(1), |unary, graph, monitor| {
        let energy =
            Energy::new(unary, graph, params.strength, &params.pairwise)?.with_label_costs(&params.label_costs)?;
        match labels.iter().find(|label| usize::from(**label) >= energy.labels) {
            Some(label) => {
                Err(Error::input(format!("label {label} is not below the number of labels {}", energy.labels)))
            }
            None if labels.len() != graph.len() => {
                Err(Error::input(format!("{} labels for {} nodes", labels.len(), graph.len())))
            }
            None => Ok(Labelling { energy: energy.of_watched(labels, monitor)?, ..Labelling::default() }),
        }
    })?;
    Ok(found.1)
}

/// Weighted mean of the probabilities of each node and its neighbours.
#[pyfunction]
#[pyo3(signature = (problem, n_jobs = None))]
pub(crate) fn local_smoothing<'py>(
    py: Python<'py>,
    problem: Problem<'py>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let [nodes, classes] = [problem.0.shape()[0], problem.0.shape()[1]];
    let (rows, edges) = (matrix(&problem.0, "probabilities")?, matrix(&problem.1, "edges")?);
    let weights = optional(problem.2.as_ref(), "weights")?;
    let smooth = call(py, n_jobs, |monitor| {
        let graph = graph_of(nodes, edges, weights, monitor)?;
        regularisation::local_smoothing(rows, classes, &graph, monitor)
    })?;
    to_matrix(py, smooth, classes)
}
