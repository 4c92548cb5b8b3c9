//! Direct sparse convolutions of arrays, and their gradients.

use crate::call::call;
use crate::convert::vector;
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use scansion_core::Error;
use scansion_core::nn::sparse::{Selection, Shape, SparseConvolution, SparseFilter, SparseTensor};
use serde::Deserialize;

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
    let (keys, values) = found.into_parts();
    Ok((PyArray1::from_vec(py, keys), PyArray1::from_vec(py, values)))
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
