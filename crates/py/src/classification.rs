//! Room `classification`: the forest for tables.

use crate::call::call;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use scansion_core::classification::{Forest as CoreForest, ForestParams, Samples};

/// A fitted forest.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Forest {
    inner: CoreForest,
}

/// Fits a forest; returns it and its out-of-bag accuracy if some samples were out of a bag.
#[pyfunction]
#[pyo3(signature = (table, labels, weights, classes, params, n_jobs = None))]
pub(crate) fn fit_forest(
    py: Python<'_>,
    table: PyReadonlyArray2<'_, f32>,
    labels: PyReadonlyArray1<'_, u16>,
    weights: Option<PyReadonlyArray1<'_, f32>>,
    classes: usize,
    params: &str,
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
    let (inner, report) = call(py, n_jobs, |monitor| CoreForest::fit_with_report(&samples, &params, monitor))?;
    Ok((Forest { inner }, report.oob_score))
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
        self.inner.check_width(width).map_err(raise)?;
        let mut result = vec![0.0; rows * self.inner.classes()];
        call(py, n_jobs, |_| self.inner.predict_proba(values, rows, &mut result))?;
        to_matrix(py, result, self.inner.classes())
    }

    fn importance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.inner.importance())
    }
}
