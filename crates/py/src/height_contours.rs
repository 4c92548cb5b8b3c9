//! Module `terrain`: height contours of a raster.

use crate::call::call;
use crate::convert::{matrix, pieces, to_matrix};
use crate::json;
use crate::terrain::raster;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use scansion_core::io::{self, Drawing, Georeference};
use scansion_core::terrain::{self, Isoline, IsolineParams};
use std::path::PathBuf;

/// Lines of equal height, and where they lie on earth.
#[pyclass(module = "scansion._core", frozen)]
pub(crate) struct HeightContours {
    lines: Vec<Isoline>,
    place: Georeference,
}

/// Lines of equal height of a raster whose first row is the northernmost; `corner` is the north-west corner.
#[pyfunction]
#[pyo3(signature = (values, corner, cell, settings, crs = None, metres_per_unit = None))]
pub(crate) fn height_contours(
    py: Python<'_>,
    values: PyReadonlyArray2<'_, f64>,
    corner: [f64; 2],
    cell: f64,
    settings: &str,
    crs: Option<String>,
    metres_per_unit: Option<f64>,
) -> PyResult<HeightContours> {
    let params: IsolineParams = json::settings(settings)?;
    let [rows, columns] = [values.shape()[0], values.shape()[1]];
    let heights = matrix(&values, "values")?;
    let lines = call(py, Some(1), |monitor| {
        let south = corner[1] - cell * rows as f64;
        terrain::isolines(&raster(heights, columns, [corner[0], south], cell)?, &params, monitor)
    })?;
    Ok(HeightContours { lines, place: Georeference { crs, metres_per_unit } })
}

/// Vertices of all lines and the number of vertices of each.
type Vertices<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u64>>);

/// What each line is besides its vertices: its height, whether it is an index contour, whether it is closed.
type Lines = Vec<(f64, bool, bool)>;

#[pymethods]
impl HeightContours {
    /// Lines from what `vertices` and `rest` give.
    #[staticmethod]
    fn restored(
        vertices: PyReadonlyArray2<'_, f64>,
        counts: PyReadonlyArray1<'_, u64>,
        lines: Lines,
        crs: Option<String>,
        metres_per_unit: Option<f64>,
    ) -> PyResult<Self> {
        let pieces = pieces::<2>(&vertices, &counts)?;
        if lines.len() != pieces.len() {
            return Err(PyValueError::new_err("height contours: expected a height of each line"));
        }
        let of = |(vertices, (height, index, closed))| Isoline { height, index, vertices, closed };
        let lines = pieces.into_iter().zip(lines).map(of).collect();
        Ok(Self { lines, place: Georeference { crs, metres_per_unit } })
    }

    /// What `restored` takes besides the vertices.
    fn rest(&self) -> (Lines, Option<String>, Option<f64>) {
        let lines = self.lines.iter().map(|line| (line.height, line.index, line.closed)).collect();
        (lines, self.place.crs.clone(), self.place.metres_per_unit)
    }

    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Vertices<'py>> {
        let all = self.lines.iter().flat_map(|line| line.vertices.iter().flatten()).copied().collect();
        let counts = self.lines.iter().map(|line| line.vertices.len() as u64).collect();
        Ok((to_matrix(py, all, 2)?, PyArray1::from_vec(py, counts)))
    }

    fn heights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.lines.iter().map(|line| line.height).collect())
    }

    fn closed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_vec(py, self.lines.iter().map(|line| line.closed).collect())
    }

    fn lengths<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.lines.iter().map(Isoline::length).collect())
    }

    /// Writes the lines as a drawing.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        call(py, Some(1), |monitor| {
            io::check_drawing_output(&path)?;
            let lines = self.lines.iter().map(Isoline::drawn).collect();
            io::write_drawing(&path, &Drawing { lines, place: self.place.clone() }, monitor)
        })
    }
}
