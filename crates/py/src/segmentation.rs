//! Module `segmentation`: segments on which values are nearly constant.

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
use scansion_core::segmentation::{
    self, CutPursuitParams, Interface, MergeParams, Partition, PartitionInput, PartitionParams, SegmentShape, Signal,
};
use scansion_core::{Error, Result};
use std::sync::Arc;

/// Segment of each node, strength, and the trials as JSON.
type Aimed<'py> = (Bound<'py, PyArray1<u32>>, f64, String);

/// Segment of each node, mean of each segment, energy.
type Segments<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f64>>, f64);

/// Values `(n, d)`, edges `(m, 2)`, weights of the edges and of the nodes.
#[derive(FromPyObject)]
pub(crate) struct Valued<'py>(
    PyReadonlyArray2<'py, f32>,
    PyReadonlyArray2<'py, u32>,
    Option<PyReadonlyArray1<'py, f32>>,
    Option<PyReadonlyArray1<'py, f32>>,
);

/// Runs `search` on the signal and the graph.
fn solve<'py, T: Send>(
    py: Python<'py>,
    valued: &Valued<'py>,
    n_jobs: Option<i64>,
    search: impl FnOnce(&Signal<'_>, &Graph, &Monitor) -> Result<T> + Send,
) -> PyResult<T> {
    let [nodes, width] = [valued.0.shape()[0], valued.0.shape()[1]];
    let (values, edges) = (matrix(&valued.0, "values")?, matrix(&valued.1, "edges")?);
    let weights = optional(valued.2.as_ref(), "weights")?;
    let node_weights = optional(valued.3.as_ref(), "node_weights")?;
    call(py, n_jobs, |monitor| {
        if width == 0 {
            return Err(Error::input(format!("values: found shape ({nodes}, 0), expected 1 column or more")));
        }
        let signal = Signal::new(values, width)?;
        let signal = match node_weights {
            Some(weights) => signal.with_weights(weights)?,
            None => signal,
        };
        let graph = graph_of(nodes, edges, weights, monitor)?;
        search(&signal, &graph, monitor)
    })
}

fn segments<'py>(
    py: Python<'py>,
    (partition, centroids, energy): (Partition, Vec<f64>, f64),
    width: usize,
) -> PyResult<Segments<'py>> {
    Ok((PyArray1::from_slice(py, partition.segments()), to_matrix(py, centroids, width)?, energy))
}

#[pyfunction]
#[pyo3(signature = (valued, settings, n_jobs = None))]
pub(crate) fn cut_pursuit<'py>(
    py: Python<'py>,
    valued: Valued<'py>,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Segments<'py>> {
    let params: CutPursuitParams = json::settings(settings)?;
    let found = solve(py, &valued, n_jobs, |signal, graph, monitor| {
        let found = segmentation::cut_pursuit(signal, graph, &params, monitor)?;
        Ok((found.partition, found.centroids, found.energy))
    })?;
    segments(py, found, valued.0.shape()[1])
}

#[pyfunction]
pub(crate) fn merge_regions<'py>(py: Python<'py>, valued: Valued<'py>, settings: &str) -> PyResult<Segments<'py>> {
    let params: MergeParams = json::settings(settings)?;
    let found = solve(py, &valued, Some(1), |signal, graph, monitor| {
        let found = segmentation::merge(signal, graph, &params, monitor)?;
        Ok((found.partition, found.centroids, found.energy))
    })?;
    segments(py, found, valued.0.shape()[1])
}

/// Partitions a graph by an intent; labels are codes, negative: unlabelled.
#[pyfunction]
#[pyo3(signature = (valued, settings, cloud = None, labels = None, n_jobs = None))]
pub(crate) fn partition<'py>(
    py: Python<'py>,
    valued: Valued<'py>,
    settings: &str,
    cloud: Option<&Cloud>,
    labels: Option<PyReadonlyArray1<'_, i16>>,
    n_jobs: Option<i64>,
) -> PyResult<Aimed<'py>> {
    let params: PartitionParams = json::settings(settings)?;
    let cloud = cloud.map(|cloud| Arc::clone(&cloud.inner));
    let labels: Option<Vec<Option<u8>>> = match &labels {
        Some(codes) => Some(vector(codes, "labels")?.iter().map(|&code| u8::try_from(code).ok()).collect()),
        None => None,
    };
    let (found, trials) = solve(py, &valued, n_jobs, |signal, graph, monitor| {
        let points = cloud.as_deref().map(|cloud| points(cloud, None, monitor)).transpose()?;
        let points = points.as_ref().map(|points| &points.positions);
        let scene = PartitionInput { signal: *signal, graph, points, labels: labels.as_deref() };
        let found = segmentation::partition_by_intent(&scene, &params, monitor)?;
        let trials = json::text(&found.trials)?;
        Ok((found, trials))
    })?;
    Ok((PyArray1::from_slice(py, found.partition.segments()), found.strength, trials))
}

/// The graph of adjacent segments: pairs of segments and the weight of each.
#[pyfunction]
#[pyo3(signature = (edges, labels, weights = None, weighted = false))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn segment_graph<'py>(
    py: Python<'py>,
    edges: PyReadonlyArray2<'_, u32>,
    labels: PyReadonlyArray1<'_, u32>,
    weights: Option<PyReadonlyArray1<'_, f32>>,
    weighted: bool,
) -> PyResult<(Bound<'py, PyArray2<u32>>, Bound<'py, PyArray1<f32>>)> {
    let (edges, labels) = (matrix(&edges, "edges")?, vector(&labels, "labels")?);
    let weights = optional(weights.as_ref(), "weights")?;
    let interface = if weighted { Interface::Weight } else { Interface::Count };
    let (pairs, weights) = call(py, Some(1), |monitor| {
        let graph = graph_of(labels.len(), edges, weights, monitor)?;
        let partition = Partition::from_labels_watched(labels, monitor)?;
        Ok(segmentation::segment_graph(&graph, &partition, interface, monitor)?.into_edges())
    })?;
    Ok((to_matrix(py, pairs.into_flattened(), 2)?, PyArray1::from_vec(py, weights)))
}

/// Of each segment: number of points; centroid, lowest and highest corner, sides and axes of the oriented box.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn segment_shapes<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    labels: PyReadonlyArray1<'_, u32>,
) -> PyResult<(Bound<'py, PyArray1<u64>>, Bound<'py, PyArray2<f64>>)> {
    let labels = vector(&labels, "labels")?;
    let cloud = Arc::clone(&cloud.inner);
    let (shapes, origin) = call(py, Some(1), |monitor| {
        let points = points(&cloud, None, monitor)?;
        let partition = Partition::from_labels_watched(labels, monitor)?;
        Ok((segmentation::segment_shapes(&partition, &points.positions)?, points.frame.origin))
    })?;
    let placed = |at: [f64; 3]| [0, 1, 2].map(|a| at[a] + origin[a]);
    let row = |shape: &SegmentShape| {
        let SegmentShape { centroid, low, high, oriented, .. } = shape;
        let places = [placed(*centroid), placed(*low), placed(*high), placed(oriented.centre), oriented.sides];
        [places.into_iter().flatten().collect::<Vec<_>>(), oriented.axes.into_iter().flatten().collect()].concat()
    };
    let counts = shapes.iter().map(|shape| shape.points as u64).collect();
    Ok((PyArray1::from_vec(py, counts), to_matrix(py, shapes.iter().flat_map(row).collect(), 24)?))
}
