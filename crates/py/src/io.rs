//! Module `io`: input and output files.

use crate::call::{call, call_with};
use crate::cloud::Cloud;
use crate::convert::{values, vector};
use crate::words::in_python;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use scansion_core::cloud::{Column, MetricCloud};
use scansion_core::io::{self, Bounds, Columns, ConvertParams, Edit, ReadOptions, Selection, WriteOptions};
use scansion_core::parallel::Monitor;
use scansion_core::voxels::planar_density;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Columns to keep besides the coordinates, box, resolution, and names of the columns of text.
type Part = (Option<Vec<String>>, Option<Bounds>, Option<f64>, Vec<String>);

fn part((columns, bounds, resolution, text_columns): Part, monitor: &Monitor) -> ReadOptions {
    let columns = columns.map_or(Columns::All, Columns::Only);
    ReadOptions {
        columns,
        bounds,
        resolution,
        metres_per_unit: None,
        text_columns,
        monitor: monitor.clone(),
        ..ReadOptions::default()
    }
}

/// The name of a column that is called so in a file.
#[pyfunction]
pub(crate) fn column_name(name: &str) -> String {
    io::column_name(name)
}

/// Reads a file, or a part of it.
#[pyfunction]
#[pyo3(signature = (path, part = (None, None, None, vec![]), n_jobs = None))]
pub(crate) fn read(py: Python<'_>, path: PathBuf, part: Part, n_jobs: Option<i64>) -> PyResult<Cloud> {
    call(py, n_jobs, |monitor| io::read_with(&path, &self::part(part, monitor))).map(Cloud::of)
}

/// A file as clouds of at most a given number of points.
#[pyclass(module = "scansion._core")]
pub(crate) struct Blocks {
    /// `None` after the last block, and while one is being read.
    inner: Mutex<Option<io::Blocks>>,
    monitor: Monitor,
    n_jobs: Option<i64>,
}

#[pymethods]
impl Blocks {
    #[new]
    #[pyo3(signature = (path, size, part = (None, None, None, vec![]), n_jobs = None))]
    fn new(py: Python<'_>, path: PathBuf, size: usize, part: Part, n_jobs: Option<i64>) -> PyResult<Self> {
        let monitor = Monitor::default();
        let blocks = call_with(py, n_jobs, &monitor, |monitor| io::blocks(&path, size, &self::part(part, monitor)))?;
        Ok(Self { inner: Mutex::new(Some(blocks)), monitor, n_jobs })
    }

    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Cloud>> {
        let take = || self.inner.lock().ok().and_then(|mut inner| inner.take());
        let Some(mut blocks) = take() else { return Ok(None) };
        let (block, blocks) =
            call_with(py, self.n_jobs, &self.monitor, move |_| Ok((blocks.next().transpose()?, blocks)))?;
        if let (Some(_), Ok(mut inner)) = (&block, self.inner.lock()) {
            *inner = Some(blocks);
        }
        Ok(block.map(Cloud::of))
    }
}

/// Information from a file's header and statistics of its points, as JSON.
#[pyfunction]
#[pyo3(signature = (path, n_jobs = None))]
pub(crate) fn statistics(py: Python<'_>, path: PathBuf, n_jobs: Option<i64>) -> PyResult<String> {
    call(py, n_jobs, |monitor| {
        let options = ReadOptions { monitor: monitor.clone(), ..Default::default() };
        let (found, cloud) = io::statistics::statistics(&path, &options)?;
        let unit = cloud.metres_per_unit.unwrap_or(1.0);
        let points = MetricCloud::new(&cloud, Some(unit), monitor)?.points(monitor)?;
        let density = planar_density(&points.positions, monitor)?;
        let text = crate::json::text(&(found, density, cloud.bounds_watched(monitor)?))?;
        Ok(in_python(&text))
    })
}

/// Writes a cloud in the format of the path's extension.
#[pyfunction]
#[pyo3(signature = (path, cloud, scale = None, n_jobs = None))]
pub(crate) fn write(
    py: Python<'_>,
    path: PathBuf,
    cloud: &Cloud,
    scale: Option<[f64; 3]>,
    n_jobs: Option<i64>,
) -> PyResult<()> {
    let cloud = Arc::clone(&cloud.inner);
    call(py, n_jobs, |monitor| io::write(&path, &cloud, &options(scale, monitor)))
}

/// Class codes, and dimensions with their names.
type Edits<'py> = (Option<PyReadonlyArray1<'py, u8>>, Vec<(String, Bound<'py, PyAny>)>);

/// Copies a file, or some of its points, with other classes or more dimensions; returns notes on what had to change.
#[pyfunction]
#[pyo3(signature = (input, output, edits = (None, Vec::new()), keep = None, scale = None, n_jobs = None))]
pub(crate) fn rewrite(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    edits: Edits<'_>,
    keep: Option<PyReadonlyArray1<'_, bool>>,
    scale: Option<[f64; 3]>,
    n_jobs: Option<i64>,
) -> PyResult<Vec<String>> {
    let (classification, dimensions) = edits;
    let kept = keep.as_ref().map(|keep| vector(keep, "keep")).transpose()?;
    let mut edits = Vec::new();
    if let Some(codes) = &classification {
        edits.push(Edit::Classification(vector(codes, "classification")?.to_vec()));
    }
    for (name, array) in &dimensions {
        edits.push(Edit::Dimension(Column::new(name, values(array, name)?)));
    }
    let selection = Selection { kept, edits: &edits };
    call(py, n_jobs, |monitor| io::select(&input, &output, &selection, &options(scale, monitor)))
        .map(|report| report.notes)
}

/// The text of a settings file or a pipe.
#[pyfunction]
pub(crate) fn settings_text(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    call(py, Some(1), |_| io::open::text(&path, io::open::MOST_SETTINGS))
}

/// Information from a file's header, as JSON.
#[pyfunction]
pub(crate) fn inspect(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    call(py, Some(1), |_| crate::json::text(&io::inspect(&path)?))
}

/// The differences between two files, as JSON.
#[pyfunction]
#[pyo3(signature = (a, b, n_jobs = None))]
pub(crate) fn diff(py: Python<'_>, a: PathBuf, b: PathBuf, n_jobs: Option<i64>) -> PyResult<String> {
    call(py, n_jobs, |monitor| {
        let found = io::diff(&a, &b, &ReadOptions { monitor: monitor.clone(), ..ReadOptions::default() })?;
        crate::json::text(&(found.is_empty(), found.summary(), found))
    })
}

/// Copies a file into another format; returns what the target could not store.
#[pyfunction]
#[pyo3(signature = (input, output, point_format = None, part = (None, None), scale = None, n_jobs = None))]
pub(crate) fn convert(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    point_format: Option<u8>,
    part: (Option<Bounds>, Option<f64>),
    scale: Option<[f64; 3]>,
    n_jobs: Option<i64>,
) -> PyResult<Vec<String>> {
    let params = ConvertParams { point_format, bounds: part.0, resolution: part.1 };
    call(py, n_jobs, |monitor| io::convert(&input, &output, &params, &options(scale, monitor)))
        .map(|report| report.notes)
}

/// Merges files; returns notes on what had to change.
#[pyfunction]
#[pyo3(signature = (inputs, output, scale = None, n_jobs = None))]
pub(crate) fn merge(
    py: Python<'_>,
    inputs: Vec<PathBuf>,
    output: PathBuf,
    scale: Option<[f64; 3]>,
    n_jobs: Option<i64>,
) -> PyResult<Vec<String>> {
    call(py, n_jobs, |monitor| io::merge(&inputs, &output, &options(scale, monitor))).map(|report| report.notes)
}

fn options(scale: Option<[f64; 3]>, monitor: &Monitor) -> WriteOptions {
    let mut options = WriteOptions { scale, ..WriteOptions::default() };
    options.monitor.clone_from(monitor);
    options
}

/// The losses of a damaged file, as JSON; with an output, its intact part is written there.
#[pyfunction]
#[pyo3(signature = (input, output = None, n_jobs = None))]
pub(crate) fn salvage(
    py: Python<'_>,
    input: PathBuf,
    output: Option<PathBuf>,
    n_jobs: Option<i64>,
) -> PyResult<String> {
    call(py, n_jobs, |monitor| {
        let losses = match &output {
            Some(output) => io::salvage::copy(&input, output, &[], &options(None, monitor))?.1,
            None => io::salvage::examine(&input, monitor)?,
        };
        crate::json::text(&losses)
    })
}
