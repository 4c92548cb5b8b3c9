//! Occupied positions, the sub-manifold convolutions of rows at them, and their gradients.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use scansion_core::nn::sites::{self, Connections, Convolution, Kernel, KernelMap, Ranked};
use scansion_core::parallel::Monitor;
use scansion_core::{Error, Result};
use serde::Deserialize;
use std::sync::{Arc, Mutex, PoisonError};

/// A sub-manifold convolution.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Submanifold {
    size: usize,
    dilation: usize,
    outputs: usize,
}

impl Submanifold {
    fn kernel(&self) -> Result<Kernel> {
        // The kernel checks the dilation; a padding that does not fit belongs to one that is out of range.
        Kernel { dilation: self.dilation, ..Kernel::centred(self.size) }.validate()?;
        let padding = (self.size / 2).saturating_mul(self.dilation);
        Ok(Kernel { dilation: self.dilation, padding, ..Kernel::centred(self.size) })
    }
}

/// Occupied positions in the order of the caller's rows, with the kernel maps that were made of them.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Sites {
    axes: usize,
    rows: usize,
    /// Site of each row; none if the rows are in the order of the sites.
    site_of: Option<Vec<u32>>,
    sites: Box<dyn Neighbours>,
    maps: Mutex<Vec<Known>>,
}

/// A kernel whose neighbours are known.
struct Known {
    kernel: Kernel,
    map: Arc<KernelMap>,
}

/// Positions that are sorted in a few milliseconds.
const LIGHT: usize = 1 << 18;

/// Sites of any number of axes.
trait Neighbours: Send + Sync {
    fn map(&self, kernel: Kernel, monitor: &Monitor) -> Result<KernelMap>;

    /// Coordinates of a site, from the lowest along each axis.
    fn position(&self, site: usize) -> Vec<i64>;

    fn bytes(&self) -> usize;
}

impl<const D: usize> Neighbours for sites::Sites<D> {
    fn map(&self, kernel: Kernel, monitor: &Monitor) -> Result<KernelMap> {
        KernelMap::new(self, self, kernel, monitor)
    }

    fn position(&self, site: usize) -> Vec<i64> {
        self.position(site).1.to_vec()
    }

    fn bytes(&self) -> usize {
        self.bytes()
    }
}

impl Sites {
    fn of<const D: usize>(coordinates: &[i64], monitor: &Monitor) -> Result<Self> {
        let mut low = [i64::MAX; D];
        for row in coordinates.chunks_exact(D) {
            low.iter_mut().zip(row).for_each(|(low, &c)| *low = (*low).min(c));
        }
        let position = |row: &[i64]| std::array::from_fn(|a| row[a].saturating_sub(low[a]));
        let keys = coordinates.chunks_exact(D).map(|row| sites::Sites::<D>::key(0, position(row)));
        let keys = keys.collect::<Result<Vec<_>>>()?;
        let Ranked { sites, site_of } = sites::Sites::<D>::ranked(&keys, monitor)?;
        if sites.len() < keys.len() {
            return Err(Error::InvalidInput("coordinates: a row stands twice (allowed: each once)".into()));
        }
        let site_of = Some(site_of).filter(|places| !places.is_sorted());
        Ok(Self { axes: D, rows: keys.len(), site_of, sites: Box::new(sites), maps: Mutex::default() })
    }

    /// The kernel map, which is made at the first use.
    fn map(&self, kernel: Kernel, monitor: &Monitor) -> Result<Arc<KernelMap>> {
        let known = |maps: &[Known]| maps.iter().find(|own| own.kernel == kernel).map(|own| own.map.clone());
        if let Some(map) = known(&self.maps.lock().unwrap_or_else(PoisonError::into_inner)) {
            return Ok(map);
        }
        // Not while others wait: another thread may find the same.
        let map = Arc::new(self.sites.map(kernel, monitor)?);
        let mut maps = self.maps.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(known(&maps).unwrap_or_else(|| {
            maps.push(Known { kernel, map: map.clone() });
            map
        }))
    }

    /// Gives the values of all rows, in the order of the sites, to a function.
    fn with_sites<T>(&self, rows: &[f32], channels: usize, work: impl FnOnce(&[f32]) -> T) -> T {
        let Some(site_of) = &self.site_of else { return work(rows) };
        let mut values = vec![0.0; rows.len()];
        for (row, &site) in rows.chunks_exact(channels).zip(site_of) {
            values[site as usize * channels..][..channels].copy_from_slice(row);
        }
        work(&values)
    }

    /// The values of all sites, in the order of the rows.
    fn to_rows(&self, values: Vec<f32>, channels: usize) -> Vec<f32> {
        let Some(site_of) = &self.site_of else { return values };
        let mut rows = Vec::with_capacity(values.len());
        for &site in site_of {
            rows.extend_from_slice(&values[site as usize * channels..][..channels]);
        }
        rows
    }
}

#[pymethods]
impl Sites {
    #[new]
    #[pyo3(signature = (coordinates, n_jobs = None))]
    fn new(py: Python<'_>, coordinates: PyReadonlyArray2<'_, i64>, n_jobs: Option<i64>) -> PyResult<Self> {
        let places = matrix(&coordinates, "coordinates")?;
        let axes = coordinates.shape()[1];
        let of = |monitor: &Monitor| match axes {
            1 => Self::of::<1>(places, monitor),
            2 => Self::of::<2>(places, monitor),
            3 => Self::of::<3>(places, monitor),
            4 => Self::of::<4>(places, monitor),
            other => Err(Error::InvalidInput(format!("coordinates of {other} axes (allowed: 1 to 4)"))),
        };
        match coordinates.shape()[0] {
            // A few milliseconds: starting threads would take a part of that.
            0..LIGHT => py.detach(|| of(&Monitor::default())).map_err(raise),
            _ => call(py, n_jobs, of),
        }
    }

    /// Positions in the order of the rows, from the lowest coordinate along each axis: convolutions depend on differences only.
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let site = |row: usize| self.site_of.as_ref().map_or(row, |places| places[row] as usize);
        let all = (0..self.rows).flat_map(|row| self.sites.position(site(row))).collect();
        to_matrix(py, all, self.axes)
    }

    /// Number of positions.
    fn __len__(&self) -> usize {
        self.rows
    }

    /// Number of axes.
    #[getter]
    fn axes(&self) -> usize {
        self.axes
    }

    /// Bytes in memory, those of the kernel maps included.
    #[getter]
    fn nbytes(&self) -> usize {
        let maps = self.maps.lock().unwrap_or_else(PoisonError::into_inner);
        let places = self.site_of.as_ref().map_or(0, |places| places.len() * size_of::<u32>());
        self.sites.bytes() + places + maps.iter().map(|own| own.map.bytes()).sum::<usize>()
    }
}

/// Arrays of a sub-manifold convolution.
#[derive(Clone, Copy)]
struct Input<'a> {
    sites: &'a Sites,
    features: &'a [f32],
    channels: usize,
    weights: &'a [f32],
    layer: &'a Submanifold,
}

impl Input<'_> {
    /// Checks that there are channels on both sides, and features of every row.
    fn check(&self) -> Result<()> {
        if self.channels == 0 {
            return Err(Error::InvalidInput("features: found 0 channels (allowed: 1 or more)".into()));
        }
        if self.layer.outputs == 0 {
            return Err(Error::InvalidInput("weights: found 0 output channels (allowed: 1 or more)".into()));
        }
        let (rows, places) = (self.features.len() / self.channels, self.sites.rows);
        match rows == places {
            true => Ok(()),
            false => {
                Err(Error::InvalidInput(format!("features: found {rows} rows (allowed: {places}, one a position)")))
            }
        }
    }

    /// Gives the convolution to a function.
    fn with_convolution<T>(
        &self,
        monitor: &Monitor,
        work: impl FnOnce(Convolution<'_, f32>) -> Result<T>,
    ) -> Result<T> {
        self.check()?;
        let map = self.sites.map(self.layer.kernel()?, monitor)?;
        let connections = Connections::centred(&map);
        work(Convolution { connections, weights: self.weights, inputs: self.channels, outputs: self.layer.outputs })
    }

    fn forward(&self, monitor: &Monitor) -> Result<Vec<f32>> {
        self.with_convolution(monitor, |layer| {
            let found = self.sites.with_sites(self.features, self.channels, |x| layer.forward(x, monitor))?;
            Ok(self.sites.to_rows(found, self.layer.outputs))
        })
    }

    fn backward(&self, gradient: &[f32], monitor: &Monitor) -> Result<Gradients> {
        let (rows, outputs) = (self.sites.rows, self.layer.outputs);
        if gradient.len() != rows * outputs {
            let (found, expected) = (gradient.len(), rows * outputs);
            return Err(Error::InvalidInput(format!("gradient: found {found} values (allowed: {expected})")));
        }
        self.with_convolution(monitor, |layer| {
            let found = self.sites.with_sites(self.features, self.channels, |x| {
                self.sites.with_sites(gradient, outputs, |towards| layer.backward(x, towards, monitor))
            })?;
            let features = self.sites.to_rows(found.values, self.channels);
            Ok(Gradients { features, weights: found.weights })
        })
    }
}

/// Gradients of a loss.
struct Gradients {
    features: Vec<f32>,
    weights: Vec<f32>,
}

/// The features of all rows after a sub-manifold convolution; `weights` are flat, (position, input, output).
#[pyfunction]
#[pyo3(signature = (sites, features, weights, layer, n_jobs = None))]
pub(crate) fn submanifold_convolution<'py>(
    py: Python<'py>,
    sites: &Sites,
    features: PyReadonlyArray2<'py, f32>,
    weights: PyReadonlyArray1<'py, f32>,
    layer: &str,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let layer: Submanifold = json::settings(layer)?;
    let channels = features.shape()[1];
    let (features, weights) = (matrix(&features, "features")?, vector(&weights, "weights")?);
    let input = Input { sites, features, channels, weights, layer: &layer };
    let found = call(py, n_jobs, |monitor| input.forward(monitor))?;
    to_matrix(py, found, layer.outputs)
}

/// The gradients of features and weights, given that of the outputs.
#[pyfunction]
#[pyo3(signature = (sites, features, weights, gradient, layer, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn submanifold_gradient<'py>(
    py: Python<'py>,
    sites: &Sites,
    features: PyReadonlyArray2<'py, f32>,
    weights: PyReadonlyArray1<'py, f32>,
    gradient: PyReadonlyArray2<'py, f32>,
    layer: &str,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f32>>)> {
    let layer: Submanifold = json::settings(layer)?;
    let channels = features.shape()[1];
    let (features, weights) = (matrix(&features, "features")?, vector(&weights, "weights")?);
    let input = Input { sites, features, channels, weights, layer: &layer };
    let gradient = matrix(&gradient, "gradient")?;
    let found = call(py, n_jobs, |monitor| input.backward(gradient, monitor))?;
    Ok((to_matrix(py, found.features, channels)?, PyArray1::from_vec(py, found.weights)))
}
