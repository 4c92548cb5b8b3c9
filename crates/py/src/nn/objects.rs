//! Networks that classify whole objects.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use scansion_core::nn::arrays::{Array, Arrays};
use scansion_core::nn::networks::{
    LabelKind, ObjectLearning, ObjectModel as CoreModel, ObjectNetParams, ObjectPreset, ObjectTraining as CoreTraining,
};
use scansion_core::nn::objects::{Objects as CoreObjects, Sample};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard};

/// Samples with or without labels.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Objects {
    inner: CoreObjects,
}

/// Pieces of a sequence, from each start to the next.
fn pieces<'a, T>(values: &'a [T], starts: &'a [usize]) -> PyResult<impl Iterator<Item = &'a [T]>> {
    let wrong = |_| PyValueError::new_err("starts: expected ascending numbers up to the number of rows");
    let piece = |pair: &[usize]| values.get(pair[0]..pair[1]).ok_or(());
    let found: Result<Vec<_>, ()> = starts.windows(2).map(piece).collect();
    Ok(found.map_err(wrong)?.into_iter())
}

#[pymethods]
impl Objects {
    /// Samples of entries: places and values from each start to the next.
    #[staticmethod]
    fn of_entries(
        shape: &str,
        starts: Vec<usize>,
        places: PyReadonlyArray1<'_, u64>,
        values: PyReadonlyArray1<'_, f32>,
        labels: Vec<u16>,
    ) -> PyResult<Self> {
        let (places, values) = (vector(&places, "places")?, vector(&values, "values")?);
        let samples = pieces(places, &starts)?.zip(pieces(values, &starts)?);
        let samples = samples.map(|(places, values)| Sample::Entries(places.to_vec(), values.to_vec())).collect();
        Self::checked(CoreObjects { shape: json::settings(shape)?, samples, labels })
    }

    /// Samples of points: rows of x, y, z from each start to the next.
    #[staticmethod]
    fn of_points(
        shape: &str,
        starts: Vec<usize>,
        points: PyReadonlyArray2<'_, f32>,
        labels: Vec<u16>,
    ) -> PyResult<Self> {
        let (rows, _) = matrix(&points, "points")?.as_chunks::<3>();
        let samples = pieces(rows, &starts)?.map(|rows| Sample::Points(rows.to_vec())).collect();
        Self::checked(CoreObjects { shape: json::settings(shape)?, samples, labels })
    }
}

impl Objects {
    fn checked(inner: CoreObjects) -> PyResult<Self> {
        inner.validate().map_err(raise)?;
        Ok(Self { inner })
    }
}

/// A network that is being trained.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct ObjectTraining {
    inner: Mutex<CoreTraining>,
}

#[pymethods]
impl ObjectTraining {
    #[new]
    fn new(network: &str, learning: &str, objects: &Objects, classes: Vec<String>) -> PyResult<Self> {
        let network: ObjectNetParams = json::settings(network)?;
        let learning: ObjectLearning = json::settings(learning)?;
        let inner = CoreTraining::new(&network, &learning, &objects.inner, &classes).map_err(raise)?;
        Ok(Self { inner: Mutex::new(inner) })
    }

    /// One pass through all samples; a report.
    #[pyo3(signature = (objects, n_jobs = None))]
    fn epoch(&self, py: Python<'_>, objects: &Objects, n_jobs: Option<i64>) -> PyResult<String> {
        call(py, n_jobs, |monitor| json::text(&self.locked().epoch(&objects.inner, monitor)?))
    }

    /// Number of epochs that were done.
    fn epochs(&self) -> usize {
        self.locked().epochs()
    }

    /// The network as it is now; `labels` says what the names of the classes stand for, `preset` with which settings it began.
    fn model(&self, labels: &str, preset: &str) -> PyResult<ObjectModel> {
        let mut inner = self.locked().model();
        inner.about.labels = Some(json::settings::<LabelKind>(labels)?);
        inner.about.preset = Some(preset.into());
        Ok(ObjectModel { inner })
    }

    fn save(&self, py: Python<'_>, path: PathBuf, objects: &Objects) -> PyResult<()> {
        py.detach(|| self.locked().to_arrays(&objects.inner)?.save(&path)).map_err(raise)
    }

    fn resume(&self, py: Python<'_>, path: PathBuf, objects: &Objects) -> PyResult<()> {
        py.detach(|| self.locked().resume(&Arrays::load_checked(&path)?, &objects.inner)).map_err(raise)
    }
}

impl ObjectTraining {
    fn locked(&self) -> MutexGuard<'_, CoreTraining> {
        self.inner.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// A trained network.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct ObjectModel {
    inner: CoreModel,
}

#[pymethods]
impl ObjectModel {
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let inner = py.detach(|| CoreModel::from_arrays(&Arrays::load(&path)?)).map_err(raise)?;
        Ok(Self { inner })
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.inner.to_arrays()?.save(&path)).map_err(raise)
    }

    /// Shape of network and samples, and the names of the classes.
    fn about(&self) -> PyResult<String> {
        json::text(&self.inner.about).map_err(raise)
    }

    /// The parameters by name.
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for (name, array) in self.inner.to_arrays().map_err(raise)?.iter() {
            if let Array::Single(shape, values) = array {
                found.set_item(name, PyArray1::from_slice(py, values).reshape(shape.clone())?)?;
            }
        }
        Ok(found)
    }

    #[pyo3(signature = (objects, n_jobs = None))]
    fn predict_proba<'py>(
        &self,
        py: Python<'py>,
        objects: &Objects,
        n_jobs: Option<i64>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let found = call(py, n_jobs, |monitor| self.inner.predict_proba(&objects.inner, monitor))?;
        to_matrix(py, found, self.inner.about.classes.len())
    }
}

/// The settings of a network and of its training by their name, for objects of so many cells along each axis; one bound of
/// density for all sparse levels if it is given; the dense twin if asked for; then changes `key=value`, one after the other.
#[pyfunction]
#[pyo3(signature = (name, resolution, density = None, dense = false, settings = Vec::new()))]
pub(crate) fn object_preset(
    name: &str,
    resolution: usize,
    density: Option<f64>,
    dense: bool,
    settings: Vec<String>,
) -> PyResult<String> {
    let mut preset = ObjectPreset::named(name, resolution).map_err(raise)?;
    if let Some(density) = density {
        preset = preset.with_density(density);
    }
    if dense {
        preset.network = preset.network.dense_twin();
    }
    preset.with_settings(settings.iter().map(String::as_str)).and_then(|preset| json::text(&preset)).map_err(raise)
}
