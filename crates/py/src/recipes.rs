//! Module `recipes`: training of a model on labelled clouds, and classification with it.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::to_matrix;
use crate::error::raise;
use crate::json;
use crate::words::in_python;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use scansion_core::classes::{Class, ClassTable, LabelMap};
use scansion_core::classification::Predictor;
use scansion_core::cloud::Cloud as CoreCloud;
use scansion_core::io::read_ascii_grid;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{
    self, AnyRecipe, CarTraining, ClassRules, ClassifyParams, Grid, GridAxis, LabelParams, LabelledCloud,
    Model as CoreModel, Regularise, SearchParams, TrainOptions, read_labels,
};
use scansion_core::terrain::ElevationModel;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A trained model: recipe, classes and classifier.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Model {
    pub(crate) inner: CoreModel,
    /// Whether it is the built-in model.
    builtin: bool,
}

/// Codes, confidence, entropy, probabilities, warnings.
type Answer<'py> = (
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
    Option<Bound<'py, PyArray2<f32>>>,
    Vec<String>,
);

/// Columns of a cloud that a recipe needs (besides its labels).
#[pyfunction]
pub(crate) fn recipe_columns(recipe: &str, settings: Vec<String>) -> PyResult<Vec<String>> {
    Ok(resolve(recipe, &settings).map_err(raise)?.columns())
}

/// The code that a map like `252-259=10` gives a larger one; None if it has no entry for it.
#[pyfunction]
pub(crate) fn mapped_code(map: &str, code: u32) -> PyResult<Option<u8>> {
    let map: LabelMap = map.parse().map_err(raise)?;
    Ok(map.of_value(f64::from(code)))
}

/// The mapping of codes 0..255 described by text like `3-4=5`.
#[pyfunction]
pub(crate) fn mapped_codes(py: Python<'_>, map: &str) -> PyResult<Py<PyBytes>> {
    let map: LabelMap = map.parse().map_err(raise)?;
    let codes: Vec<u8> = (0..=255u8).map(|code| map.apply(code)).collect();
    Ok(PyBytes::new(py, &codes).unbind())
}

/// The recipe from TOML text or a name, with changed settings.
fn resolve(recipe: &str, settings: &[String]) -> scansion_core::Result<AnyRecipe> {
    let word = !recipe.is_empty() && recipe.chars().all(|ch| ch.is_alphabetic() || ch == '-');
    let base = if word { AnyRecipe::named(recipe)? } else { AnyRecipe::from_toml(recipe)? };
    base.with_settings(settings.iter().map(String::as_str))
}

/// Cross-validation of a recipe, with all combinations of the values of some keys; the report as JSON.
#[pyfunction]
#[pyo3(signature = (clouds, recipe, settings, grid, dimension, map, unlabelled = None, folds = 5, block = None, n_jobs = None))]
#[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
pub(crate) fn search(
    py: Python<'_>,
    clouds: Vec<PyRef<'_, Cloud>>,
    recipe: &str,
    settings: Vec<String>,
    grid: Vec<(String, Vec<String>)>,
    dimension: String,
    map: &str,
    unlabelled: Option<Vec<u8>>,
    folds: usize,
    block: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<String> {
    let clouds: Vec<_> = clouds.iter().map(|c| Arc::clone(&c.inner)).collect();
    let recipe = resolve(recipe, &settings).map_err(raise)?;
    recipe.validate().map_err(raise)?;
    let labels = LabelParams { dimension, map: map.parse().map_err(raise)?, unlabelled, classes: Vec::new() };
    let axes = grid.into_iter().map(|(key, values)| GridAxis { key, values }).collect();
    let params = SearchParams { grid: Grid { axes }, folds, block, elevation: None };
    call(py, n_jobs, |monitor| {
        let mut clouds = labelled(clouds, &labels, monitor)?;
        json::text(&recipes::search(&recipe, &mut clouds, &params, monitor)?)
    })
}

/// The fold of each point, of whole squares.
#[pyfunction]
#[pyo3(signature = (cloud, folds, block = None, metres_per_unit = None))]
pub(crate) fn spatial_folds<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    folds: usize,
    block: Option<f64>,
    metres_per_unit: Option<f64>,
) -> PyResult<Bound<'py, PyArray1<u32>>> {
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, Some(1), |_| recipes::square_folds(&cloud, metres_per_unit, folds, block))?;
    Ok(PyArray1::from_vec(py, found))
}

/// Clouds with their labels; a cloud that nobody else holds is not copied.
fn labelled(
    clouds: Vec<Arc<CoreCloud>>,
    labels: &LabelParams,
    monitor: &Monitor,
) -> scansion_core::Result<Vec<LabelledCloud>> {
    let read = |cloud: Arc<CoreCloud>| {
        let labels = read_labels(&cloud, labels)?;
        let cloud = Arc::try_unwrap(cloud).or_else(|shared| shared.copied(monitor))?;
        Ok(LabelledCloud { cloud, labels })
    };
    clouds.into_iter().map(read).collect()
}

/// The method of regularisation with that name.
fn method(name: Option<&str>) -> PyResult<Option<Regularise>> {
    let Some(name) = name else { return Ok(None) };
    let found = Regularise::ALL.into_iter().find(|method| method.name() == name);
    found.map(Some).ok_or_else(|| {
        let names = Regularise::ALL.map(|method| format!("'{}'", method.name()));
        PyValueError::new_err(format!("regularize: found {name:?}, expected one of {}", names.join(", ")))
    })
}

/// The elevation model in an ESRI ASCII grid.
fn elevation_of(path: Option<&Path>, monitor: &Monitor) -> scansion_core::Result<Option<ElevationModel>> {
    path.map(|path| ElevationModel::from_raster(read_ascii_grid(path)?, monitor)).transpose()
}

#[pymethods]
impl Model {
    #[staticmethod]
    #[pyo3(signature = (clouds, recipe, settings, dimension, map, unlabelled = None, names = vec![], strengths = vec![], elevation_model = None, checkpoint = None, n_jobs = None))]
    #[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
    fn train(
        py: Python<'_>,
        clouds: Vec<PyRef<'_, Cloud>>,
        recipe: &str,
        settings: Vec<String>,
        dimension: String,
        map: &str,
        unlabelled: Option<Vec<u8>>,
        names: Vec<String>,
        strengths: Vec<f64>,
        elevation_model: Option<PathBuf>,
        checkpoint: Option<PathBuf>,
        n_jobs: Option<i64>,
    ) -> PyResult<(Self, String)> {
        let clouds: Vec<_> = clouds.iter().map(|c| Arc::clone(&c.inner)).collect();
        let recipe = resolve(recipe, &settings).map_err(raise)?;
        let labels = LabelParams { dimension, map: map.parse().map_err(raise)?, unlabelled, classes: Vec::new() };
        let train = |monitor: &Monitor| {
            let clouds = labelled(clouds, &labels, monitor)?;
            let elevation = elevation_of(elevation_model.as_deref(), monitor)?;
            let options = TrainOptions { strengths, elevation, checkpoint, ..TrainOptions::default() };
            let (model, report) = recipe.train(&clouds, &options, monitor)?;
            Ok((model, report.json()?))
        };
        let (mut inner, report) = call(py, n_jobs, train)?;
        if !names.is_empty() {
            let classes = inner.trained.classes.classes().iter().cloned();
            let called = |c: Class| Class { name: names.get(usize::from(c.code)).cloned().unwrap_or(c.name), ..c };
            inner.trained.classes = ClassTable::new(classes.map(called).collect()).map_err(raise)?;
        }
        Ok((Self { inner, builtin: false }, report))
    }

    #[pyo3(signature = (clouds, dimension, map, code, unlabelled = None, n_jobs = None))]
    #[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
    fn with_cars(
        &self,
        py: Python<'_>,
        clouds: Vec<PyRef<'_, Cloud>>,
        dimension: String,
        map: &str,
        code: u8,
        unlabelled: Option<Vec<u8>>,
        n_jobs: Option<i64>,
    ) -> PyResult<(Self, String)> {
        let clouds: Vec<_> = clouds.iter().map(|c| Arc::clone(&c.inner)).collect();
        let labels = LabelParams { dimension, map: map.parse().map_err(raise)?, unlabelled, classes: Vec::new() };
        let training = CarTraining { code, ..CarTraining::default() };
        let learn = |monitor: &Monitor| {
            let clouds = labelled(clouds, &labels, monitor)?;
            let (model, report) = self.inner.with_cars(&clouds, &training, monitor)?;
            Ok((model, json::text(&report)?))
        };
        let (inner, report) = call(py, n_jobs, learn)?;
        Ok((Self::new(inner), report))
    }

    #[staticmethod]
    fn default(py: Python<'_>) -> PyResult<Self> {
        py.detach(|| recipes::default_model().map(Self::new)).map_err(raise)
    }

    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        call(py, Some(1), |_| CoreModel::load(&path)).map(Self::new)
    }

    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        py.detach(|| CoreModel::from_bytes(data, Path::new("pickled model")).map(Self::new)).map_err(raise)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = slf.get().inner.to_bytes().map_err(raise)?;
        Ok((slf.getattr("from_bytes")?, (PyBytes::new(slf.py(), &bytes),)))
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.inner.save(&path)).map_err(raise)
    }

    #[pyo3(signature = (cloud, probabilities = false, regularize = None, metres_per_unit = None, elevation_model = None, abstain = None, divided = true, settings = vec![], n_jobs = None))]
    #[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
    fn classify<'py>(
        &self,
        py: Python<'py>,
        cloud: &Cloud,
        probabilities: bool,
        regularize: Option<&str>,
        metres_per_unit: Option<f64>,
        elevation_model: Option<PathBuf>,
        abstain: Option<f64>,
        divided: bool,
        settings: Vec<String>,
        n_jobs: Option<i64>,
    ) -> PyResult<Answer<'py>> {
        let cloud = Arc::clone(&cloud.inner);
        let regularise = method(regularize)?;
        let changed = self.changed(&settings).map_err(raise)?;
        let model = changed.as_ref().unwrap_or(&self.inner);
        let own = if divided { model.fitted.rules() } else { ClassRules::default() };
        let rules = ClassRules { abstain: abstain.unwrap_or(own.abstain), ..own };
        rules.validate().map_err(raise)?;
        let limits = recipes::builtin_limits(&rules);
        let found = call(py, n_jobs, |monitor| {
            let elevation = elevation_of(elevation_model.as_deref(), monitor)?;
            let params = ClassifyParams {
                probabilities,
                metres_per_unit,
                regularise,
                elevation,
                statistics: None,
                rules: Some(rules),
            };
            recipes::classify(&cloud, model, &params, monitor)
        })?;
        let misfit = self.builtin.then(|| recipes::builtin_misfit(&found)).flatten();
        let limits = self.builtin.then_some(limits);
        let warnings = found.warnings.iter().chain(&misfit).chain(&limits).map(|text| in_python(text)).collect();
        let classes = self.inner.trained.classes.len();
        let probabilities = found.probabilities.map(|p| to_matrix(py, p, classes)).transpose()?;
        Ok((
            PyArray1::from_vec(py, found.codes),
            PyArray1::from_vec(py, found.confidence),
            PyArray1::from_vec(py, found.entropy),
            probabilities,
            warnings,
        ))
    }

    /// A list, not `bytes`, for Python.
    fn codes(&self) -> Vec<u16> {
        self.inner.trained.classes.classes().iter().map(|c| u16::from(c.code)).collect()
    }

    fn class_names(&self) -> Vec<String> {
        self.inner.trained.classes.classes().iter().map(|c| c.name.clone()).collect()
    }

    fn feature_names(&self) -> Vec<String> {
        self.inner.trained.feature_names.clone()
    }

    fn recipe(&self) -> PyResult<String> {
        self.inner.fitted.recipe().to_toml().map_err(raise)
    }

    fn importance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.inner.trained.classifier.importance())
    }
}

impl Model {
    fn new(inner: CoreModel) -> Self {
        let builtin = recipes::is_builtin(&inner);
        Self { inner, builtin }
    }

    /// The model with other settings; `None` if there are none.
    fn changed(&self, settings: &[String]) -> scansion_core::Result<Option<CoreModel>> {
        if settings.is_empty() {
            return Ok(None);
        }
        let fitted = self.inner.fitted.with_settings(settings.iter().map(String::as_str))?;
        Ok(Some(CoreModel { fitted, trained: self.inner.trained.clone() }))
    }
}
