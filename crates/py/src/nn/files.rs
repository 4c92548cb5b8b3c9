//! Files in which sets of objects come.

use crate::convert::{axes, matrix, to_matrix};
use crate::error::raise;
use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use scansion_core::nn::objects::{Mesh, XyzObject, read_idx as read_bytes, read_off as read_mesh, read_xyz_folder};
use std::path::PathBuf;

/// The array of an IDX file.
#[pyfunction]
pub(crate) fn read_idx(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArrayDyn<u8>>> {
    let found = py.detach(|| read_bytes(&path)).map_err(raise)?;
    PyArray1::from_vec(py, found.values).reshape(found.shape)
}

/// Vertices and triangles.
type Surface<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>);

/// The mesh of an OFF file.
#[pyfunction]
pub(crate) fn read_off(py: Python<'_>, path: PathBuf) -> PyResult<Surface<'_>> {
    let mesh = py.detach(|| read_mesh(&path)).map_err(raise)?;
    Ok((to_matrix(py, mesh.vertices.concat(), 3)?, to_matrix(py, mesh.triangles.concat(), 3)?))
}

/// The points of the objects of a folder of files `.xyz`, one below the other; where each object begins and the last ends;
/// their names.
type Folder<'py> = (Bound<'py, PyArray2<f64>>, Vec<usize>, Vec<String>);

/// The objects of a folder of files `.xyz`.
#[pyfunction]
pub(crate) fn load_xyz(py: Python<'_>, folder: PathBuf) -> PyResult<Folder<'_>> {
    let objects = py.detach(|| read_xyz_folder(&folder)).map_err(raise)?;
    let mut starts = vec![0];
    let mut rows = Vec::new();
    let mut names = Vec::new();
    for XyzObject { name, points } in objects {
        rows.extend(points.into_iter().flatten());
        starts.push(rows.len() / 3);
        names.push(name);
    }
    Ok((to_matrix(py, rows, 3)?, starts, names))
}

/// Points on the surface of a mesh.
#[pyfunction]
pub(crate) fn sample_surface<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    triangles: PyReadonlyArray2<'py, u32>,
    count: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let [x, y, z] = axes(py, &vertices, "vertices")?;
    let vertices = x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect();
    let (triangles, _) = matrix(&triangles, "triangles")?.as_chunks::<3>();
    let mesh = Mesh { vertices, triangles: triangles.to_vec() };
    let points = py.detach(|| mesh.sampled(count, seed)).map_err(raise)?;
    to_matrix(py, points.concat(), 3)
}
