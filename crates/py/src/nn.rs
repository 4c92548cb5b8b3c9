//! Module `nn`: sparse convolutions of arrays, and their gradients.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use scansion_core::Error;
use scansion_core::nn::sites::{Connections, Convolution, Kernel, KernelMap, Sites};
use scansion_core::nn::sparse::{Selection, Shape, SparseConvolution, SparseFilter, SparseTensor};
use scansion_core::parallel::Monitor;
use serde::Deserialize;

/// A sub-manifold convolution.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Submanifold {
    size: usize,
    dilation: usize,
    outputs: usize,
}

/// Rows of channels at sites, in the order of the sites.
struct Rows<const D: usize> {
    map: KernelMap,
    /// Site of each row.
    site_of: Vec<usize>,
}

impl<const D: usize> Rows<D> {
    fn new(coordinates: &[i64], kernel: Kernel, monitor: &Monitor) -> scansion_core::Result<Self> {
        let mut low = [i64::MAX; D];
        for row in coordinates.chunks_exact(D) {
            low.iter_mut().zip(row).for_each(|(low, &c)| *low = (*low).min(c));
        }
        let position = |row: &[i64]| std::array::from_fn(|a| row[a].saturating_sub(low[a]));
        let keys = coordinates.chunks_exact(D).map(|row| Sites::<D>::key(0, position(row)));
        let keys = keys.collect::<scansion_core::Result<Vec<_>>>()?;
        let sites = Sites::<D>::of_keys(keys.clone(), monitor)?;
        if sites.len() < keys.len() {
            return Err(Error::InvalidInput("coordinates: a row stands twice (allowed: each once)".into()));
        }
        let site_of = keys.iter().filter_map(|&key| sites.find(key)).collect();
        Ok(Self { map: KernelMap::new(&sites, &sites, kernel, monitor)?, site_of })
    }

    fn to_sites(&self, rows: &[f32], channels: usize) -> Vec<f32> {
        let mut values = vec![0.0; rows.len()];
        for (row, &site) in rows.chunks_exact(channels).zip(&self.site_of) {
            values[site * channels..][..channels].copy_from_slice(row);
        }
        values
    }

    fn to_rows(&self, values: &[f32], channels: usize) -> Vec<f32> {
        self.site_of.iter().flat_map(|&site| &values[site * channels..][..channels]).copied().collect()
    }
}

/// Calls a function that is generic over the number of axes.
macro_rules! by_axes {
    ($axes:expr, $work:ident($($argument:expr),*)) => {
        match $axes {
            1 => $work::<1>($($argument),*),
            2 => $work::<2>($($argument),*),
            3 => $work::<3>($($argument),*),
            4 => $work::<4>($($argument),*),
            other => Err(Error::InvalidInput(format!("coordinates of {other} axes (allowed: 1 to 4)"))),
        }
    };
}

/// Arrays of a sub-manifold convolution.
#[derive(Clone, Copy)]
struct Input<'a> {
    coordinates: &'a [i64],
    features: &'a [f32],
    channels: usize,
    weights: &'a [f32],
    layer: &'a Submanifold,
}

impl Input<'_> {
    fn kernel(&self) -> Kernel {
        let Submanifold { size, dilation, .. } = *self.layer;
        Kernel { dilation, padding: size / 2 * dilation, ..Kernel::centred(size) }
    }
}

fn forward<const D: usize>(input: Input<'_>, monitor: &Monitor) -> scansion_core::Result<Vec<f32>> {
    let rows = Rows::<D>::new(input.coordinates, input.kernel(), monitor)?;
    let (inputs, outputs) = (input.channels, input.layer.outputs);
    let layer = Convolution { connections: Connections::centred(&rows.map), weights: input.weights, inputs, outputs };
    let found = layer.forward(&rows.to_sites(input.features, inputs), monitor)?;
    Ok(rows.to_rows(&found, outputs))
}

/// Gradients of the features and of the weights.
type Gradients = (Vec<f32>, Vec<f32>);

fn backward<const D: usize>(input: Input<'_>, gradient: &[f32], monitor: &Monitor) -> scansion_core::Result<Gradients> {
    let rows = Rows::<D>::new(input.coordinates, input.kernel(), monitor)?;
    let (inputs, outputs) = (input.channels, input.layer.outputs);
    let layer = Convolution { connections: Connections::centred(&rows.map), weights: input.weights, inputs, outputs };
    let (values, gradient) = (rows.to_sites(input.features, inputs), rows.to_sites(gradient, outputs));
    let found = layer.backward(&values, &gradient, monitor)?;
    Ok((rows.to_rows(&found.values, inputs), found.weights))
}

/// The features of all rows after a sub-manifold convolution; `weights` are flat, (position, input, output).
#[pyfunction]
#[pyo3(signature = (coordinates, features, weights, layer, n_jobs = None))]
pub(crate) fn submanifold_convolution<'py>(
    py: Python<'py>,
    coordinates: PyReadonlyArray2<'py, i64>,
    features: PyReadonlyArray2<'py, f32>,
    weights: PyReadonlyArray1<'py, f32>,
    layer: &str,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let layer: Submanifold = json::settings(layer)?;
    let input = Input {
        coordinates: matrix(&coordinates, "coordinates")?,
        features: matrix(&features, "features")?,
        channels: features.shape()[1],
        weights: vector(&weights, "weights")?,
        layer: &layer,
    };
    let axes = coordinates.shape()[1];
    let found = call(py, n_jobs, |monitor| by_axes!(axes, forward(input, monitor)))?;
    to_matrix(py, found, layer.outputs)
}

/// The gradients of features and weights, given that of the outputs.
#[pyfunction]
#[pyo3(signature = (coordinates, features, weights, gradient, layer, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn submanifold_gradient<'py>(
    py: Python<'py>,
    coordinates: PyReadonlyArray2<'py, i64>,
    features: PyReadonlyArray2<'py, f32>,
    weights: PyReadonlyArray1<'py, f32>,
    gradient: PyReadonlyArray2<'py, f32>,
    layer: &str,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f32>>)> {
    let layer: Submanifold = json::settings(layer)?;
    let input = Input {
        coordinates: matrix(&coordinates, "coordinates")?,
        features: matrix(&features, "features")?,
        channels: features.shape()[1],
        weights: vector(&weights, "weights")?,
        layer: &layer,
    };
    let gradient = matrix(&gradient, "gradient")?;
    let axes = coordinates.shape()[1];
    let (values, weights) = call(py, n_jobs, |monitor| by_axes!(axes, backward(input, gradient, monitor)))?;
    Ok((to_matrix(py, values, input.channels)?, PyArray1::from_vec(py, weights)))
}

/// A direct sparse convolution.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Direct {
    /// Samples, channels, cells along each axis.
    shape: Vec<usize>,
    /// Weights along an axis.
    size: usize,
    outputs: usize,
    selection: Option<Selection>,
}

/// Arrays of a direct sparse convolution.
struct Tensors {
    input: SparseTensor<f32>,
    filter: SparseFilter<f32>,
}

impl Direct {
    /// The tensor of these entries, and the filters without the weights that are 0.
    fn tensors(&self, keys: &[u64], values: &[f32], weights: &[f32]) -> scansion_core::Result<Tensors> {
        let [samples, channels, extent @ ..] = &self.shape[..] else {
            return Err(Error::InvalidInput("shape: samples, channels and one or more axes".into()));
        };
        let shape = Shape::new(*samples, *channels, extent)?;
        let filter = SparseFilter::of_dense([*channels, self.outputs], self.size, extent.len(), weights.to_vec())?;
        Ok(Tensors {
            input: SparseTensor::new(shape, keys.to_vec(), values.to_vec())?,
            filter: filter.pruned(|_, weight| weight != 0.0),
        })
    }
}

/// Keys and values of the responses; `weights` are flat, (output, input, position), `bias` may be empty.
#[pyfunction]
#[pyo3(signature = (keys, values, weights, bias, layer, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn sparse_convolution<'py>(
    py: Python<'py>,
    keys: PyReadonlyArray1<'py, u64>,
    values: PyReadonlyArray1<'py, f32>,
    weights: PyReadonlyArray1<'py, f32>,
    bias: PyReadonlyArray1<'py, f32>,
    layer: &str,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray1<u64>>, Bound<'py, PyArray1<f32>>)> {
    let layer: Direct = json::settings(layer)?;
    let (keys, values) = (vector(&keys, "keys")?, vector(&values, "values")?);
    let (weights, bias) = (vector(&weights, "weights")?, vector(&bias, "bias")?);
    let found = call(py, n_jobs, |monitor| {
        let Tensors { input, filter } = layer.tensors(keys, values, weights)?;
        SparseConvolution { filter: &filter, bias, selection: layer.selection }.forward(&input, monitor)
    })?;
    Ok((PyArray1::from_slice(py, found.keys()), PyArray1::from_slice(py, found.values())))
}

/// The gradients of the values (in the order of ascending keys), of all weights (0 where there is none) and of the bias.
#[pyfunction]
#[pyo3(signature = (keys, values, weights, bias, gradient_keys, gradient_values, layer, n_jobs = None))]
#[expect(clippy::type_complexity, clippy::too_many_arguments, reason = "the arrays of a layer")]
pub(crate) fn sparse_gradient<'py>(
    py: Python<'py>,
    keys: PyReadonlyArray1<'py, u64>,
    values: PyReadonlyArray1<'py, f32>,
    weights: PyReadonlyArray1<'py, f32>,
    bias: PyReadonlyArray1<'py, f32>,
    gradient_keys: PyReadonlyArray1<'py, u64>,
    gradient_values: PyReadonlyArray1<'py, f32>,
    layer: &str,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>)> {
    let layer: Direct = json::settings(layer)?;
    let (keys, values) = (vector(&keys, "keys")?, vector(&values, "values")?);
    let (weights, bias) = (vector(&weights, "weights")?, vector(&bias, "bias")?);
    let Tensors { input, filter } = layer.tensors(keys, values, weights).map_err(raise)?;
    let extent = &layer.shape[2..];
    let shape = Shape::new(layer.shape[0], layer.outputs, extent).map_err(raise)?;
    let towards = SparseTensor::new(
        shape,
        vector(&gradient_keys, "gradient keys")?.to_vec(),
        vector(&gradient_values, "gradient values")?.to_vec(),
    )
    .map_err(raise)?;
    let found = call(py, n_jobs, |monitor| {
        SparseConvolution { filter: &filter, bias, selection: layer.selection }.backward(&input, &towards, monitor)
    })?;
    let mut dense = vec![0.0; weights.len()];
    filter.keys().iter().zip(&found.weights).for_each(|(&key, &value)| dense[key as usize] = value);
    Ok((PyArray1::from_vec(py, found.values), PyArray1::from_vec(py, dense), PyArray1::from_vec(py, found.bias)))
}
