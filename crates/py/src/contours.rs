//! Module `contours`: lines along the edges of objects.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, pieces, to_matrix, vector};
use crate::error::raise;
use crate::json;
use crate::recipes::Model;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use scansion_core::Error;
use scansion_core::cloud::Positions;
use scansion_core::contours::{ComparedLines, Marked, MatchParams, PathMatch, Polyline, ScoreParams, match_candidates};
use scansion_core::contours::{score_lines as core_score_lines, score_points as core_score_points};
use scansion_core::io;
use scansion_core::recipes::{
    self, AnyFitted, AnyRecipe, BaselineParams, ContourParams, Contours as CoreContours, ContoursRecipe, EdgeLines,
    Model as CoreModel, baseline_contours, default_contour_model,
};
use scansion_core::synthetic::{SceneParams, scene};
use serde::Deserialize;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// The lines of a cloud.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Contours {
    inner: CoreContours,
    cloud: Arc<scansion_core::Cloud>,
}

/// Settings from Python.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    /// Settings of the model's recipe.
    recipe: Vec<String>,
    without: Vec<u8>,
    min_confidence: f32,
    metres_per_unit: Option<f64>,
}

/// Lines of a cloud by a model of the recipe contours; `None`: the built-in one.
#[pyfunction]
#[pyo3(signature = (cloud, model, settings, codes, n_jobs = None))]
pub(crate) fn contours(
    py: Python<'_>,
    cloud: &Cloud,
    model: Option<&Model>,
    settings: &str,
    codes: Option<PyReadonlyArray1<'_, u8>>,
    n_jobs: Option<i64>,
) -> PyResult<Contours> {
    let Settings { recipe, without, min_confidence, metres_per_unit } = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let codes = codes.map(|codes| vector(&codes, "classes").map(<[u8]>::to_vec)).transpose()?;
    let params = ContourParams { metres_per_unit, codes, without, min_confidence };
    let inner = call(py, n_jobs, |monitor| {
        let base = model.map_or_else(default_contour_model, |model| Ok(model.inner.clone()))?;
        let fitted = base.fitted.with_settings(recipe.iter().map(String::as_str))?;
        recipes::contours(&cloud, &CoreModel { fitted, ..base }, &params, monitor)
    })?;
    Ok(Contours { inner, cloud })
}

/// The rated candidates of a cloud, from which lines can be drawn with several settings.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct ContourStages {
    inner: recipes::ContourStages,
    fitted: AnyFitted,
    cloud: Arc<scansion_core::Cloud>,
}

/// Rates points and candidates as [`contours`] does.
#[pyfunction]
#[pyo3(signature = (cloud, model, settings, n_jobs = None))]
pub(crate) fn contour_stages(
    py: Python<'_>,
    cloud: &Cloud,
    model: Option<&Model>,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<ContourStages> {
    let Settings { recipe, without, min_confidence, metres_per_unit } = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let params = ContourParams { metres_per_unit, codes: None, without, min_confidence };
    let (inner, fitted) = call(py, n_jobs, |monitor| {
        let base = model.map_or_else(default_contour_model, |model| Ok(model.inner.clone()))?;
        let fitted = base.fitted.with_settings(recipe.iter().map(String::as_str))?;
        let model = CoreModel { fitted, ..base };
        Ok((recipes::contour_stages(&cloud, &model, &params, monitor)?, model.fitted))
    })?;
    Ok(ContourStages { inner, fitted, cloud })
}

#[pymethods]
impl ContourStages {
    /// The lines that the random field chooses, with settings of the recipe below `trace`.
    fn lines(&self, py: Python<'_>, settings: Vec<String>) -> PyResult<Contours> {
        let inner =
            call(py, None, |monitor| match self.fitted.with_settings(settings.iter().map(String::as_str))?.recipe() {
                AnyRecipe::Contours(recipe) => self.inner.lines(&recipe.trace, monitor),
                other => Err(Error::ModelMismatch(format!("it is one of the recipe {}", other.name()))),
            })?;
        Ok(Contours { inner, cloud: Arc::clone(&self.cloud) })
    }

    /// Probability of each candidate, and the shares of its length along the reference and along unsure lines.
    fn candidates<'py>(
        &self,
        py: Python<'py>,
        reference: &Lines,
        unsure: &Lines,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let [reference, unsure] = [reference, unsure].map(|lines| self.inner.local(&lines.lines));
        let lines = ComparedLines { found: &[], reference: &reference, unsure: &unsure };
        let params = MatchParams::default();
        let matched = call(py, None, |monitor| match_candidates(&self.inner.candidates, &lines, &params, monitor))?;
        let row = |(p, m): (&f32, &PathMatch)| [*p, m.on, m.unsure];
        let rows: Vec<f32> = self.inner.probabilities.iter().zip(&matched).flat_map(row).collect();
        to_matrix(py, rows, 3)
    }

    /// The edge of a voxel, metres.
    #[getter]
    fn voxel(&self) -> f64 {
        self.inner.voxel()
    }
}

/// Lines of a cloud by a simpler method, from a strength of each point.
#[pyfunction]
#[pyo3(signature = (cloud, strengths, params, n_jobs = None))]
pub(crate) fn baseline(
    py: Python<'_>,
    cloud: &Cloud,
    strengths: PyReadonlyArray1<'_, f32>,
    params: &str,
    n_jobs: Option<i64>,
) -> PyResult<Contours> {
    let params: BaselineParams = json::settings(params)?;
    let strengths = vector(&strengths, "strengths")?.to_vec();
    let cloud = Arc::clone(&cloud.inner);
    let inner = call(py, n_jobs, |monitor| baseline_contours(&cloud, &strengths, &params, monitor))?;
    Ok(Contours { inner, cloud })
}

/// Vertices of all lines and the number of vertices of each.
type Vertices<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u64>>);

/// Everything but the vertices, as `Contours::report` tells it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Report {
    /// Whether each line is closed, its length, confidence and classes.
    lines: Vec<(bool, f64, f32, Option<[u8; 2]>)>,
    voxel: f64,
    points: usize,
    seeds: usize,
    candidates: usize,
    energies: Vec<f64>,
    warnings: Vec<String>,
}

#[pymethods]
impl Contours {
    /// Lines from their vertices and their report; `place` is a cloud with their reference system, unit and class list.
    #[staticmethod]
    fn restored(
        vertices: PyReadonlyArray2<'_, f64>,
        counts: PyReadonlyArray1<'_, u64>,
        report: Report,
        place: &Cloud,
    ) -> PyResult<Self> {
        let pieces = pieces::<3>(&vertices, &counts)?;
        let Report { lines, voxel, points, seeds, candidates, energies, warnings } = report;
        if lines.len() != pieces.len() {
            return Err(PyValueError::new_err("contours: expected a row of the report for each line"));
        }
        let of = |(vertices, (closed, length, confidence, classes))| recipes::ContourLine {
            vertices,
            closed,
            length,
            confidence,
            classes,
        };
        let lines = pieces.into_iter().zip(lines).map(of).collect();
        let inner = CoreContours { lines, voxel, points, seeds, candidates, energies, warnings };
        Ok(Self { inner, cloud: Arc::clone(&place.inner) })
    }

    /// A cloud without points that has the reference system, the unit and the class list of the lines.
    fn place(&self) -> Cloud {
        Cloud::of(self.cloud.select(&[]))
    }

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

    /// Writes the lines of some confidence as a drawing.
    fn write(&self, py: Python<'_>, path: PathBuf, min_confidence: f32) -> PyResult<()> {
        call(py, Some(1), |monitor| {
            io::check_drawing_output(&path)?;
            let mut inner = self.inner.clone();
            inner.lines.retain(|line| line.confidence >= min_confidence);
            io::write_drawing(&path, &inner.drawing(&self.cloud), monitor)
        })
    }
}

/// Lines: the vertices of all of them, one after the other.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct Lines {
    lines: Vec<Vec<[f64; 3]>>,
}

#[pymethods]
impl Lines {
    /// `counts` are the numbers of vertices.
    #[new]
    fn new(vertices: PyReadonlyArray2<'_, f64>, counts: PyReadonlyArray1<'_, u64>) -> PyResult<Self> {
        Ok(Self { lines: pieces::<3>(&vertices, &counts)? })
    }
}

impl Lines {
    /// The lines around an origin.
    fn around(&self, origin: [f64; 3]) -> Vec<Polyline> {
        let place = |at: &[f64; 3]| std::array::from_fn(|axis| (at[axis] - origin[axis]) as f32);
        let line =
            |line: &Vec<[f64; 3]>| Polyline { vertices: line.iter().map(place).collect(), ..Polyline::default() };
        self.lines.iter().map(line).collect()
    }
}

/// A synthetic scene.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct SyntheticScene {
    inner: scansion_core::synthetic::Scene,
}

#[pymethods]
impl SyntheticScene {
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        to_matrix(py, self.inner.positions.iter().flatten().collect(), 3)
    }

    fn codes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        PyArray1::from_vec(py, self.inner.codes.clone())
    }

    /// Both ends of each edge.
    fn edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        to_matrix(py, self.inner.edges.iter().flatten().flatten().copied().collect(), 6)
    }

    fn edge_spacing<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_vec(py, self.inner.edge_spacing.clone())
    }

    fn scan_positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        to_matrix(py, self.inner.scan_positions.concat(), 3)
    }
}

/// A synthetic scene; `settings` are those of the core on top of those of its kind.
#[pyfunction]
#[pyo3(signature = (kind, settings, n_jobs = None))]
pub(crate) fn synthetic_scene(
    py: Python<'_>,
    kind: &str,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<SyntheticScene> {
    let kind = json::settings(&format!("{kind:?}"))?;
    let own = serde_json::to_value(SceneParams::of(kind)).map_err(|e| PyValueError::new_err(e.to_string()))?;
    let mut all: serde_json::Map<String, serde_json::Value> = json::settings(&own.to_string())?;
    all.extend(json::settings::<serde_json::Map<String, serde_json::Value>>(settings)?);
    let params: SceneParams = json::settings(&serde_json::Value::Object(all).to_string())?;
    Ok(SyntheticScene { inner: call(py, n_jobs, |monitor| scene(&params, monitor))? })
}

/// Counts of samples of lines by the rules of the thesis, with precision, recall and F1.
#[pyfunction]
pub(crate) fn score_lines(
    py: Python<'_>,
    found: &Lines,
    reference: &Lines,
    unsure: &Lines,
    params: &str,
) -> PyResult<String> {
    let params: ScoreParams = json::settings(params)?;
    let all = [reference, found, unsure];
    let origin = all.iter().find_map(|part| part.lines.first()?.first().copied()).unwrap_or_default();
    let [reference, found, unsure] = all.map(|part| part.around(origin));
    let lines = ComparedLines { found: &found, reference: &reference, unsure: &unsure };
    let scores = call(py, None, |monitor| core_score_lines(&lines, &params, monitor))?;
    text_of(&scores)
}

/// Counts of marked points by the rules of the thesis, with precision, recall and F1.
#[pyfunction]
pub(crate) fn score_points(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    found: PyReadonlyArray1<'_, bool>,
    reference: PyReadonlyArray1<'_, bool>,
    params: &str,
) -> PyResult<String> {
    let params: ScoreParams = json::settings(params)?;
    let (rows, _) = matrix(&points, "points")?.as_chunks::<3>();
    let origin = rows.first().copied().unwrap_or_default();
    let place = |at: &[f64; 3]| std::array::from_fn(|axis| (at[axis] - origin[axis]) as f32);
    let positions: Positions = rows.iter().map(place).collect();
    let (found, reference) = (vector(&found, "found")?, vector(&reference, "reference")?);
    let marked = Marked { positions: &positions, found, reference };
    let scores = call(py, None, |monitor| core_score_points(&marked, &params, monitor))?;
    text_of(&scores)
}

fn text_of(scores: &scansion_core::contours::LineScores) -> PyResult<String> {
    let wrong = |e: serde_json::Error| PyValueError::new_err(e.to_string());
    let mut all = serde_json::to_value(scores).map_err(wrong)?;
    all["precision"] = json!(scores.precision());
    all["recall"] = json!(scores.recall());
    all["recall_by_length"] = json!(scores.recall_by_length());
    all["f1"] = json!(scores.f1());
    json::text(&all).map_err(raise)
}

/// Labels of points by their distance from lines: 1 near one, 0 far from all, -1 between.
#[pyfunction]
pub(crate) fn edge_labels<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    lines: &Lines,
    voxel: Option<f64>,
) -> PyResult<Bound<'py, PyArray1<i16>>> {
    let cloud = Arc::clone(&cloud.inner);
    let edges = EdgeLines { lines: lines.lines.clone(), unsure: Vec::new() };
    let recipe = ContoursRecipe { voxel, ..ContoursRecipe::default() };
    let labels = call(py, None, |monitor| recipes::edge_labels(&recipe, &cloud, edges, monitor))?;
    Ok(PyArray1::from_vec(py, labels.codes.iter().map(|code| code.map_or(-1, i16::from)).collect()))
}
