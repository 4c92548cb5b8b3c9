//! Room `classification`: the forest for tables.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use scansion_core::classification::{Forest as CoreForest, ForestParams, Samples};
use scansion_core::parallel::Monitor;

/// Rows between two looks at whether the user has cancelled.
const BLOCK: usize = 1 << 16;

/// A fitted forest.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Forest {
    inner: CoreForest,
}

/// Fits a forest; returns it and, if asked for, its out-of-bag accuracy.
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
    let samples = Samples {
        features: matrix(&table, "table")?,
        width: table.shape()[1],
        labels: vector(&labels, "labels")?,
        weights: weights.as_ref().map(|w| vector(w, "weights")).transpose()?,
        classes,
    };
    let fit = |monitor: &_| match oob_score {
        true => {
            CoreForest::fit_with_report(&samples, &params, monitor).map(|(forest, report)| (forest, report.oob_score))
        }
        false => CoreForest::fit(&samples, &params, monitor).map(|forest| (forest, None)),
    };
    call(py, n_jobs, fit).map(|(inner, score)| (Forest { inner }, score))
}

#[pymethods]
impl Forest {
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        py.detach(|| CoreForest::from_bytes(data)).map(|inner| Self { inner }).map_err(raise)
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
        let (rows, width) = (table.shape()[0], table.shape()[1]);
        let values = matrix(&table, "table")?;
        if width != self.inner.width() {
            let message = format!("table: found {width} columns, expected {}", self.inner.width());
            return Err(PyValueError::new_err(message));
        }
        let classes = self.inner.classes();
        let mut result = vec![0.0; rows * classes];
        let mut blocks = values.chunks(BLOCK * width).zip(result.chunks_mut(BLOCK * classes));
        let predict = |monitor: &Monitor| {
            blocks.try_for_each(|(rows, out)| monitor.check().and_then(|()| self.inner.predict_proba(rows, out)))
        };
        call::<()>(py, n_jobs, predict)?;
        to_matrix(py, result, classes)
    }

    fn importance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.inner.importance())
    }
}
