//! Module `graph`: edges between points, components, spanning trees.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, to_matrix, vector};
use crate::json;
use crate::neighbours::points;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use scansion_core::graph::{self, FelzenszwalbParams, Graph, KnnGraphParams, Parallel, WeightedPairs};
use scansion_core::neighbours::knn;
use scansion_core::parallel::{Held, Monitor, watched};
use scansion_core::{Error, Result};
use std::sync::Arc;

/// Edges `(m, 2)` and their weights.
type Edges<'py> = (Bound<'py, PyArray2<u32>>, Bound<'py, PyArray1<f32>>);

/// The nodes of each edge.
fn pairs_of(edges: &[u32]) -> Result<&[[u32; 2]]> {
    match edges.as_chunks::<2>() {
        (pairs, []) => Ok(pairs),
        _ => Err(Error::input(format!("edges: {} nodes are not pairs", edges.len()))),
    }
}

/// A graph from pairs of nodes; without weights every edge has weight 1.
pub(crate) fn graph_of(nodes: usize, edges: &[u32], weights: Option<&[f32]>, monitor: &Monitor) -> Result<Held<Graph>> {
    let pairs = pairs_of(edges)?;
    if let Some(weights) = weights {
        return Ok(Held::new(Graph::new_watched(nodes, pairs, weights, monitor)?, monitor));
    }
    let ones = ones(pairs.len(), monitor)?;
    Ok(Held::new(Graph::new_watched(nodes, pairs, &ones, monitor)?, monitor))
}

/// The weights of edges without any.
fn ones(count: usize, monitor: &Monitor) -> Result<Vec<f32>> {
    let mut ones = Vec::with_capacity(count);
    for piece in watched(count, monitor) {
        ones.resize(piece?.end, 1.0);
    }
    Ok(ones)
}

/// The elements of the weights, if there are any.
pub(crate) fn optional<'a>(array: Option<&'a PyReadonlyArray1<'_, f32>>, name: &str) -> PyResult<Option<&'a [f32]>> {
    array.map(|a| vector(a, name)).transpose()
}

fn give(py: Python<'_>, graph: Graph) -> PyResult<Edges<'_>> {
    let (edges, weights) = graph.into_edges();
    Ok((to_matrix(py, edges.into_flattened(), 2)?, PyArray1::from_vec(py, weights)))
}

/// Edges between each point and its nearest neighbours, with weights.
#[pyfunction]
#[pyo3(signature = (cloud, k, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn knn_graph<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    k: usize,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Edges<'py>> {
    let params: KnnGraphParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let graph = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?.positions;
        graph::knn_graph(points.len(), knn(&points, k, monitor)?, &params, monitor)
    })?;
    give(py, graph)
}

/// Component of each node, and the number of components.
#[pyfunction]
pub(crate) fn connected_components<'py>(
    py: Python<'py>,
    nodes: usize,
    edges: PyReadonlyArray2<'py, u32>,
) -> PyResult<(Bound<'py, PyArray1<u32>>, usize)> {
    let edges = matrix(&edges, "edges")?;
    let found = call(py, Some(1), |monitor| {
        let graph = graph_of(nodes, edges, None, monitor)?;
        graph::connected_components(&graph, monitor)
    })?;
    Ok((PyArray1::from_vec(py, found.of), found.count))
}

/// The edges of the minimum spanning forest and their weights.
#[pyfunction]
#[pyo3(signature = (nodes, edges, weights = None))]
pub(crate) fn minimum_spanning_tree<'py>(
    py: Python<'py>,
    nodes: usize,
    edges: PyReadonlyArray2<'py, u32>,
    weights: Option<PyReadonlyArray1<'py, f32>>,
) -> PyResult<Edges<'py>> {
    let (edges, weights) = (matrix(&edges, "edges")?, optional(weights.as_ref(), "weights")?);
    let tree = call(py, Some(1), |monitor| {
        let pairs = pairs_of(edges)?;
        let ones = if weights.is_none() { ones(pairs.len(), monitor)? } else { Vec::new() };
        let given = WeightedPairs { pairs, weights: weights.unwrap_or(&ones), parallel: Parallel::Least };
        let graph = Held::new(Graph::from_pairs(nodes, &given, monitor)?, monitor);
        let tree = graph::minimum_spanning_tree(&graph, monitor)?;
        let pairs: Vec<[u32; 2]> = tree.iter().map(|&e| graph.edges()[e as usize]).collect();
        let weights: Vec<f32> = tree.iter().map(|&e| graph.weights()[e as usize]).collect();
        Graph::new_watched(nodes, &pairs, &weights, monitor)
    })?;
    give(py, tree)
}

/// Component of each node, and the number of components, by the method of Felzenszwalb and Huttenlocher.
#[pyfunction]
#[pyo3(signature = (nodes, edges, weights, settings))]
pub(crate) fn felzenszwalb<'py>(
    py: Python<'py>,
    nodes: usize,
    edges: PyReadonlyArray2<'py, u32>,
    weights: PyReadonlyArray1<'py, f32>,
    settings: &str,
) -> PyResult<(Bound<'py, PyArray1<u32>>, usize)> {
    let params: FelzenszwalbParams = json::settings(settings)?;
    let (edges, weights) = (matrix(&edges, "edges")?, vector(&weights, "weights")?);
    let found = call(py, Some(1), |monitor| {
        let given = WeightedPairs { pairs: pairs_of(edges)?, weights, parallel: params.meaning.parallel() };
        graph::felzenszwalb(&Graph::from_pairs(nodes, &given, monitor)?, &params, monitor)
    })?;
    Ok((PyArray1::from_vec(py, found.of), found.count))
}
