//! Module `contours`: lines along the edges of objects.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, to_matrix, vector};
use crate::error::raise;
use crate::json;
use crate::recipes::Model;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use scansion_core::contours::{Polyline, ScoreParams, score_lines as core_score_lines};
use scansion_core::io;
use scansion_core::recipes::{
    self, ContourParams, Contours as CoreContours, ContoursRecipe, Model as CoreModel, default_contour_model,
};
use scansion_core::synthetic::{SceneParams, scene};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// The lines of a cloud.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Contours {
    inner: CoreContours,
    cloud: Arc<scansion_core::Cloud>,
}

/// Lines of a cloud by a model of the recipe contours; `None`: the built-in one.
#[pyfunction]
#[pyo3(signature = (cloud, model, settings, codes, without, metres_per_unit = None, n_jobs = None))]
#[expect(clippy::too_many_arguments, reason = "Python's keywords are named on its own side")]
pub(crate) fn contours(
    py: Python<'_>,
    cloud: &Cloud,
    model: Option<&Model>,
    settings: Vec<String>,
    codes: Option<PyReadonlyArray1<'_, u8>>,
    without: Vec<u8>,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Contours> {
    let cloud = Arc::clone(&cloud.inner);
    let codes = codes.map(|codes| vector(&codes, "classes").map(<[u8]>::to_vec)).transpose()?;
    let params = ContourParams { metres_per_unit, codes, without };
    let inner = call(py, n_jobs, |monitor| {
        let base = model.map_or_else(default_contour_model, |model| Ok(model.inner.clone()))?;
        let fitted = base.fitted.with_settings(settings.iter().map(String::as_str))?;
        recipes::contours(&cloud, &CoreModel { fitted, ..base }, &params, monitor)
    })?;
    Ok(Contours { inner, cloud })
}

/// Vertices of all lines and the number of vertices of each.
type Vertices<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u64>>);

#[pymethods]
impl Contours {
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Vertices<'py>> {
        let lines = &self.inner.lines;
        let all = lines.iter().flat_map(|line| line.vertices.iter().flatten()).copied().collect();
        let counts = lines.iter().map(|line| line.vertices.len() as u64).collect();
        Ok((to_matrix(py, all, 3)?, PyArray1::from_vec(py, counts)))
    }

    /// Everything but the vertices.
    fn report(&self) -> PyResult<String> {
        let CoreContours { lines, voxel, points, seeds, candidates, energies, warnings } = &self.inner;
        let line = |l: &recipes::ContourLine| (l.closed, l.length, l.confidence, l.classes);
        let lines: Vec<_> = lines.iter().map(line).collect();
        json::text(&json!({
            "lines": lines, "voxel": voxel, "points": points, "seeds": seeds, "candidates": candidates,
            "energies": energies, "warnings": warnings,
        }))
        .map_err(raise)
    }

    /// Writes the lines as a drawing.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        call(py, Some(1), |monitor| {
            io::check_drawing_output(&path)?;
            io::write_drawing(&path, &self.inner.drawing(&self.cloud), monitor)
        })
    }
}

/// Pieces of rows as lines.
fn lines<'a, T: Copy>(rows: &'a [T], counts: &'a [u64]) -> PyResult<impl Iterator<Item = &'a [[T; 3]]>> {
    let (rows, _) = rows.as_chunks::<3>();
    let mut first = 0;
    let piece = |&count: &u64| {
        let found = rows.get(first..first + count as usize);
        first += count as usize;
        found.ok_or_else(|| PyValueError::new_err("counts: expected the number of vertices of each line"))
    };
    Ok(counts.iter().map(piece).collect::<PyResult<Vec<_>>>()?.into_iter())
}

/// Points, class codes, edges (both ends) and places of the scanner.
type Scene<'py> =
    (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<u8>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>);

/// A made-up scene; `settings` are those of the core on top of those of its kind.
#[pyfunction]
#[pyo3(signature = (kind, settings, n_jobs = None))]
pub(crate) fn synthetic_scene<'py>(
    py: Python<'py>,
    kind: &str,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Scene<'py>> {
    let kind = json::settings(&format!("{kind:?}"))?;
    let own = serde_json::to_value(SceneParams::of(kind)).map_err(|e| PyValueError::new_err(e.to_string()))?;
    let mut all: serde_json::Map<String, serde_json::Value> = json::settings(&own.to_string())?;
    all.extend(json::settings::<serde_json::Map<String, serde_json::Value>>(settings)?);
    let params: SceneParams = json::settings(&serde_json::Value::Object(all).to_string())?;
    let found = call(py, n_jobs, |monitor| scene(&params, monitor))?;
    let points: Vec<f32> = found.positions.iter().flatten().collect();
    Ok((
        to_matrix(py, points, 3)?,
        PyArray1::from_vec(py, found.codes),
        to_matrix(py, found.edges.into_iter().flatten().flatten().collect(), 6)?,
        to_matrix(py, found.scan_positions.concat(), 3)?,
    ))
}

/// Counts of samples of lines by the rules of the thesis.
#[pyfunction]
pub(crate) fn score_lines(
    py: Python<'_>,
    found: (PyReadonlyArray2<'_, f32>, PyReadonlyArray1<'_, u64>),
    reference: (PyReadonlyArray2<'_, f32>, PyReadonlyArray1<'_, u64>),
    params: &str,
) -> PyResult<String> {
    let params: ScoreParams = json::settings(params)?;
    let polylines = |(rows, counts): &(PyReadonlyArray2<'_, f32>, PyReadonlyArray1<'_, u64>)| {
        let (rows, counts) = (matrix(rows, "vertices")?, vector(counts, "counts")?);
        let line = |vertices: &[[f32; 3]]| Polyline { vertices: vertices.to_vec(), ..Polyline::default() };
        PyResult::Ok(lines(rows, counts)?.map(line).collect::<Vec<_>>())
    };
    let (found, reference) = (polylines(&found)?, polylines(&reference)?);
    let scores = call(py, None, |monitor| core_score_lines(&found, &reference, &params, monitor))?;
    json::text(&scores).map_err(raise)
}

/// Labels of points by their distance from lines: 1 near one, 0 far from all, -1 between.
#[pyfunction]
pub(crate) fn edge_labels<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    vertices: PyReadonlyArray2<'py, f64>,
    counts: PyReadonlyArray1<'py, u64>,
    voxel: Option<f64>,
) -> PyResult<Bound<'py, PyArray1<i16>>> {
    let cloud = Arc::clone(&cloud.inner);
    let rows = (matrix(&vertices, "vertices")?, vector(&counts, "counts")?);
    let edges: Vec<Vec<[f64; 3]>> = lines(rows.0, rows.1)?.map(<[[f64; 3]]>::to_vec).collect();
    let recipe = ContoursRecipe { voxel, ..ContoursRecipe::default() };
    let labels = call(py, None, |monitor| recipes::edge_labels(&recipe, &cloud, &edges, monitor))?;
    Ok(PyArray1::from_vec(py, labels.codes.iter().map(|code| code.map_or(-1, i16::from)).collect()))
}
