//! Sub-manifold convolutions of arrays, and their gradients.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::json;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use scansion_core::Error;
use scansion_core::nn::sites::{Connections, Convolution, Kernel, KernelMap, Sites};
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
    /// Checks that there are channels on both sides, and features of every row.
    fn check(&self, axes: usize) -> scansion_core::Result<()> {
        if self.channels == 0 {
            return Err(Error::InvalidInput("features: found 0 channels (allowed: 1 or more)".into()));
        }
        if self.layer.outputs == 0 {
            return Err(Error::InvalidInput("weights: found 0 output channels (allowed: 1 or more)".into()));
        }
        let (rows, points) = (self.features.len() / self.channels, self.coordinates.len() / axes.max(1));
        match rows == points {
            true => Ok(()),
            false => {
                Err(Error::InvalidInput(format!("features: found {rows} rows (allowed: {points}, one a position)")))
            }
        }
    }

    fn rows<const D: usize>(&self, monitor: &Monitor) -> scansion_core::Result<Rows<D>> {
        self.check(D)?;
        let Submanifold { size, dilation, .. } = *self.layer;
        // The kernel checks the dilation; a padding that does not fit belongs to one that is out of range.
        let padding = (size / 2).saturating_mul(dilation);
        Kernel { dilation, ..Kernel::centred(size) }.validate()?;
        let kernel = Kernel { dilation, padding, ..Kernel::centred(size) };
        Rows::new(self.coordinates, kernel, monitor)
    }

    fn convolution<'a, const D: usize>(&'a self, rows: &'a Rows<D>) -> Convolution<'a, f32> {
        let connections = Connections::centred(&rows.map);
        Convolution { connections, weights: self.weights, inputs: self.channels, outputs: self.layer.outputs }
    }
}

fn forward<const D: usize>(input: Input<'_>, monitor: &Monitor) -> scansion_core::Result<Vec<f32>> {
    let rows = input.rows::<D>(monitor)?;
    let found = input.convolution(&rows).forward(&rows.to_sites(input.features, input.channels), monitor)?;
    Ok(rows.to_rows(&found, input.layer.outputs))
}

/// Gradients of the features and of the weights.
type Gradients = (Vec<f32>, Vec<f32>);

fn backward<const D: usize>(input: Input<'_>, gradient: &[f32], monitor: &Monitor) -> scansion_core::Result<Gradients> {
    let rows = input.rows::<D>(monitor)?;
    let expected = rows.site_of.len() * input.layer.outputs;
    if gradient.len() != expected {
        let found = gradient.len();
        return Err(Error::InvalidInput(format!("gradient: found {found} values (allowed: {expected})")));
    }
    let values = rows.to_sites(input.features, input.channels);
    let found = input.convolution(&rows).backward(&values, &rows.to_sites(gradient, input.layer.outputs), monitor)?;
    Ok((rows.to_rows(&found.values, input.channels), found.weights))
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
