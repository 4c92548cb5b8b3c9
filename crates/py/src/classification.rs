//! Module `classification`: forests, boosted trees and bagging for tables.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use scansion_core::classification::{
    BaggingParams, Boosting as CoreBoosting, BoostingParams, FitReport, Forest as CoreForest, ForestParams, Importance,
    PermutationParams, Predictor, Samples, permutation_importance as core_importance,
};
use scansion_core::parallel::Monitor;

/// Number of rows between two checks for cancellation.
const BLOCK: usize = 1 << 16;

/// A fitted forest.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Forest {
    inner: CoreForest,
}

/// Fitted boosted trees.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Boosting {
    inner: CoreBoosting,
}

/// Trains a forest; returns it and, if requested, its out-of-bag accuracy.
#[pyfunction]
#[pyo3(signature = (table, labels, weights, classes, params, oob_score = false, n_jobs = None))]
#[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
pub(crate) fn fit_forest(
    py: Python<'_>,
    table: PyReadonlyArray2<'_, f32>,
    labels: PyReadonlyArray1<'_, u16>,
    weights: Option<PyReadonlyArray1<'_, f32>>,
    classes: usize,
    params: &str,
    oob_score: bool,
    n_jobs: Option<i64>,
) -> PyResult<(Forest, Option<f64>)> {
    let params: ForestParams = json::settings(params)?;
    fit_trees(py, &samples(&table, &labels, &weights, classes)?, &params, (oob_score, n_jobs))
}

/// Trains bagged trees, stored as a forest; returns it and, if requested, its out-of-bag accuracy.
#[pyfunction]
#[pyo3(signature = (table, labels, weights, classes, params, oob_score = false, n_jobs = None))]
#[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
pub(crate) fn fit_bagging(
    py: Python<'_>,
    table: PyReadonlyArray2<'_, f32>,
    labels: PyReadonlyArray1<'_, u16>,
    weights: Option<PyReadonlyArray1<'_, f32>>,
    classes: usize,
    params: &str,
    oob_score: bool,
    n_jobs: Option<i64>,
) -> PyResult<(Forest, Option<f64>)> {
    let params: BaggingParams = json::settings(params)?;
    fit_trees(py, &samples(&table, &labels, &weights, classes)?, &params.forest(), (oob_score, n_jobs))
}

/// Mean loss of accuracy by shuffling each feature, and its standard deviation.
type Losses<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Permutation importance of every feature of a forest on samples.
#[pyfunction]
#[pyo3(signature = (forest, table, labels, weights, repeats, seed, n_jobs = None))]
#[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
pub(crate) fn permutation_importance<'py>(
    py: Python<'py>,
    forest: &Forest,
    table: PyReadonlyArray2<'_, f32>,
    labels: PyReadonlyArray1<'_, u16>,
    weights: Option<PyReadonlyArray1<'_, f32>>,
    repeats: usize,
    seed: u64,
    n_jobs: Option<i64>,
) -> PyResult<Losses<'py>> {
    let samples = samples(&table, &labels, &weights, forest.inner.classes())?;
    let params = PermutationParams { repeats, seed };
    let found = call(py, n_jobs, |monitor| core_importance(&forest.inner, &samples, params, monitor))?;
    let of = |value: fn(&Importance) -> f64| PyArray1::from_vec(py, found.iter().map(value).collect());
    Ok((of(|loss| loss.mean), of(|loss| loss.deviation)))
}

/// Trained trees, losses in training and validation, and number of rounds kept.
type Boosted<'py> = (Boosting, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, usize);

/// Trains boosted trees.
#[pyfunction]
#[pyo3(signature = (table, labels, weights, classes, params, n_jobs = None))]
pub(crate) fn fit_boosting<'py>(
    py: Python<'py>,
    table: PyReadonlyArray2<'_, f32>,
    labels: PyReadonlyArray1<'_, u16>,
    weights: Option<PyReadonlyArray1<'_, f32>>,
    classes: usize,
    params: &str,
    n_jobs: Option<i64>,
) -> PyResult<Boosted<'py>> {
    let params: BoostingParams = json::settings(params)?;
    let samples = samples(&table, &labels, &weights, classes)?;
    let fit = |monitor: &_| CoreBoosting::fit_with_report(&samples, None, &params, monitor);
    let (inner, report) = call(py, n_jobs, fit)?;
    let training = PyArray1::from_vec(py, report.training_loss);
    Ok((Boosting { inner }, training, PyArray1::from_vec(py, report.validation_loss), report.rounds))
}

fn samples<'a>(
    table: &'a PyReadonlyArray2<'_, f32>,
    labels: &'a PyReadonlyArray1<'_, u16>,
    weights: &'a Option<PyReadonlyArray1<'_, f32>>,
    classes: usize,
) -> PyResult<Samples<'a>> {
    Ok(Samples {
        features: matrix(table, "table")?,
        width: table.shape()[1],
        labels: vector(labels, "labels")?,
        weights: weights.as_ref().map(|w| vector(w, "weights")).transpose()?,
        classes,
    })
}

fn fit_trees(
    py: Python<'_>,
    samples: &Samples<'_>,
    params: &ForestParams,
    (oob_score, n_jobs): (bool, Option<i64>),
) -> PyResult<(Forest, Option<f64>)> {
    let fit = |monitor: &Monitor| {
        if !oob_score {
            return CoreForest::fit(samples, params, monitor).map(|forest| (forest, None));
        }
        let (forest, report) = CoreForest::fit_with_report(samples, params, monitor)?;
        warn_of_unjudged(samples, &report, monitor);
        Ok((forest, report.oob_score))
    };
    call(py, n_jobs, fit).map(|(inner, score)| (Forest { inner }, score))
}

/// Warns of samples that every tree was trained on.
fn warn_of_unjudged(samples: &Samples<'_>, report: &FitReport, monitor: &Monitor) {
    let rows = report.oob_probabilities.chunks_exact(samples.classes.max(1)).enumerate();
    let unjudged = rows.filter(|(i, row)| samples.weight(*i) > 0.0 && row.iter().any(|p| p.is_nan())).count();
    if unjudged > 0 {
        monitor.warn(format!(
            "oob_score: {unjudged} of {} samples were not left out by any tree and do not count; more trees leave out all",
            samples.active().len()
        ));
    }
}

/// The methods of a class of trees.
macro_rules! trees {
    ($name:ident, $core:ident) => {
        #[pymethods]
        impl $name {
            #[staticmethod]
            fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
                py.detach(|| $core::from_bytes(data)).map(|inner| Self { inner }).map_err(raise)
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
                let bytes = slf.get().inner.to_bytes().map_err(raise)?;
                Ok((slf.getattr("from_bytes")?, (PyBytes::new(slf.py(), &bytes),)))
            }

            #[pyo3(signature = (table, n_jobs = None))]
            fn predict_proba<'py>(
                &self,
                py: Python<'py>,
                table: PyReadonlyArray2<'_, f32>,
                n_jobs: Option<i64>,
            ) -> PyResult<Bound<'py, PyArray2<f32>>> {
                let shape = (self.inner.width(), self.inner.classes());
                predict(py, &table, (shape, n_jobs), |rows, out| self.inner.predict_proba(rows, out))
            }

            /// Positions of the most probable classes; faster than the probabilities.
            #[pyo3(signature = (table, n_jobs = None))]
            fn predict<'py>(
                &self,
                py: Python<'py>,
                table: PyReadonlyArray2<'_, f32>,
                n_jobs: Option<i64>,
            ) -> PyResult<Bound<'py, PyArray1<u16>>> {
                let values = fitting(&table, self.inner.width())?;
                let mut labels = Vec::with_capacity(table.shape()[0]);
                let all = |monitor: &Monitor| {
                    values.chunks(BLOCK * self.inner.width().max(1)).try_for_each(|rows| {
                        monitor.check()?;
                        labels.extend(self.inner.predict(rows)?);
                        Ok(())
                    })
                };
                call::<()>(py, n_jobs, all)?;
                Ok(PyArray1::from_vec(py, labels))
            }

            fn importance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
                PyArray1::from_slice(py, self.inner.importance())
            }
        }
    };
}

trees!(Forest, CoreForest);
trees!(Boosting, CoreBoosting);

/// The values of a table of that width.
fn fitting<'a>(table: &'a PyReadonlyArray2<'_, f32>, width: usize) -> PyResult<&'a [f32]> {
    match table.shape()[1] {
        found if found == width => matrix(table, "table"),
        found => Err(PyValueError::new_err(format!("table: found {found} columns, expected {width}"))),
    }
}

fn predict<'py>(
    py: Python<'py>,
    table: &PyReadonlyArray2<'_, f32>,
    ((width, classes), n_jobs): ((usize, usize), Option<i64>),
    ask: impl Fn(&[f32], &mut [f32]) -> scansion_core::Result<()> + Send + Sync,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let values = fitting(table, width)?;
    let mut result = vec![0.0; table.shape()[0] * classes];
    let mut blocks = values.chunks(BLOCK * width).zip(result.chunks_mut(BLOCK * classes));
    let all = |monitor: &Monitor| blocks.try_for_each(|(rows, out)| monitor.check().and_then(|()| ask(rows, out)));
    call::<()>(py, n_jobs, all)?;
    to_matrix(py, result, classes)
}
