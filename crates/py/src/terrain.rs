//! Module `terrain`: ground points, heights above ground, terrain and surface models, outlines of buildings.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, to_matrix, vector};
use crate::json;
use crate::neighbours::{Told, points, told};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use scansion_core::classification::ForestParams;
use scansion_core::cloud::{MetricCloud, Raster};
use scansion_core::features::FeatureTable;
use scansion_core::io::{self, Georeference};
use scansion_core::terrain::{
    self, AlphaParams, AlphaShape, ElevationModel, ElevationParams, GroundParams, RoadExample,
};
use scansion_core::terrain::{FootprintParams, ProductParams, Survey};
use scansion_core::{Error, Result};
use std::path::PathBuf;
use std::sync::Arc;

/// Whether each point is ground.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn ground_points<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let params: GroundParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let Told { scene, all } = told(&cloud, metres_per_unit, monitor)?;
        if scene.strays.index.is_empty() {
            return terrain::ground_points(&all, &params, monitor);
        }
        let near = scene.points(monitor)?;
        let mut ground = vec![false; all.len()];
        let found = terrain::ground_points(&near, &params, monitor)?;
        near.frame.index.iter().zip(found).for_each(|(&i, is_ground)| ground[i as usize] = is_ground);
        Ok(ground)
    })?;
    Ok(PyArray1::from_vec(py, found))
}

/// Height of each point above the ground, given the ground points.
#[pyfunction]
#[pyo3(signature = (cloud, ground, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn heights<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    ground: PyReadonlyArray1<'py, bool>,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let params: ElevationParams = json::settings(settings)?;
    let ground = vector(&ground, "ground")?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let Told { scene, all } = told(&cloud, metres_per_unit, monitor)?;
        if scene.strays.index.is_empty() || ground.len() != all.len() {
            return ElevationModel::fit(&all, ground, &params, monitor)?.heights(&all, monitor);
        }
        let near = scene.points(monitor)?;
        let ground: Vec<bool> = near.frame.index.iter().map(|&i| ground[i as usize]).collect();
        ElevationModel::fit(&near, &ground, &params, monitor)?.heights(&all, monitor)
    })?;
    Ok(PyArray1::from_vec(py, found))
}

/// Position of each point with respect to the road, area of the road, and length of its border.
#[pyfunction]
#[pyo3(signature = (cloud, road, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn road_position<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    road: PyReadonlyArray1<'py, bool>,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, f64, f64)> {
    let params: AlphaParams = json::settings(settings)?;
    let road = vector(&road, "road")?;
    let cloud = Arc::clone(&cloud.inner);
    let (position, shape) = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?;
        let shape = AlphaShape::fit(&points, road, &params, monitor)?;
        Ok((terrain::position(&points, &shape, params.rim, monitor)?, shape))
    })?;
    Ok((PyArray1::from_vec(py, position), shape.area(), shape.border_length()))
}

/// The points that a forest considers road; `labels` are 1 (road), 0 (not road) or negative (unlabelled).
#[pyfunction]
#[pyo3(signature = (table, labels, trees, seed, n_jobs = None))]
pub(crate) fn road_points<'py>(
    py: Python<'py>,
    table: PyReadonlyArray2<'_, f32>,
    labels: PyReadonlyArray1<'_, i16>,
    trees: usize,
    seed: u64,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let params = ForestParams { trees, seed, ..ForestParams::breiman() };
    let (values, labels) = (matrix(&table, "features")?, vector(&labels, "labels")?);
    let local = FeatureTable {
        names: ["Linearity", "Planarity", "Scattering", "Verticality"].map(String::from).to_vec(),
        values: values.to_vec(),
    };
    let example = |(row, &label): (usize, &i16)| {
        let descriptors = *local.row(row).first_chunk()?;
        (label >= 0).then_some(RoadExample { descriptors, road: label > 0 })
    };
    let examples: Vec<RoadExample> = labels.iter().enumerate().filter_map(example).collect();
    let found = call(py, n_jobs, |monitor| terrain::road_points(&local, &examples, &params, monitor))?;
    Ok(PyArray1::from_vec(py, found))
}

/// Heights with the northernmost row first, the north-west corner, the cell, and how the ground was found.
type Grid<'py> = (Bound<'py, PyArray2<f64>>, [f64; 2], f64, String);

/// The terrain model (`dtm`), surface model (`dsm`) or their difference (`chm`), in the unit of the cloud.
#[pyfunction]
#[pyo3(signature = (cloud, product, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn terrain_raster<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    product: &str,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<Grid<'py>> {
    let params: ProductParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let (raster, note) = call(py, n_jobs, |monitor| {
        let scene = MetricCloud::new(&cloud, metres_per_unit, monitor)?;
        scene.oddities().into_iter().for_each(|text| monitor.warn(text));
        let find = if product == "dsm" { Survey::of_points } else { Survey::new };
        let survey = find(&scene, &params, monitor)?;
        let terrain = || terrain::terrain_model(&survey, &params, monitor);
        let surface = || terrain::surface_model(&survey, params.cell, monitor);
        let raster = match product {
            "dtm" => terrain()?,
            "dsm" => surface()?,
            "chm" => terrain::normalised(&surface()?, &terrain()?)?,
            other => return Err(Error::parameter("product", other, "dtm, dsm or chm")),
        };
        Ok((raster.in_unit(scene.metres)?, survey.note))
    })?;
    let [west, south] = raster.origin();
    let corner = [west, south + raster.cell() * raster.rows() as f64];
    let rows = raster.values().chunks_exact(raster.columns()).rev();
    let values = to_matrix(py, rows.flatten().copied().collect(), raster.columns())?;
    Ok((values, corner, raster.cell(), note))
}

/// Height of each point above ground in the unit of the cloud, and how the ground was found.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
pub(crate) fn height_above_ground<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, String)> {
    let params: ProductParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let (heights, note) = call(py, n_jobs, |monitor| {
        let scene = MetricCloud::new(&cloud, metres_per_unit, monitor)?;
        scene.oddities().into_iter().for_each(|text| monitor.warn(text));
        let survey = Survey::new(&scene, &params, monitor)?;
        let mut heights = terrain::heights_above_ground(&scene, &survey, &params, monitor)?;
        heights.iter_mut().for_each(|height| *height /= scene.metres as f32);
        Ok((heights, survey.note))
    })?;
    Ok((PyArray1::from_vec(py, heights), note))
}

/// Outlines of the buildings, as the text of a GeoJSON file.
#[pyfunction]
#[pyo3(signature = (cloud, settings, shape, metres_per_unit = None, n_jobs = None))]
pub(crate) fn footprints(
    py: Python<'_>,
    cloud: &Cloud,
    settings: &str,
    shape: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<String> {
    let (params, shape): (ProductParams, FootprintParams) = (json::settings(settings)?, json::settings(shape)?);
    let cloud = Arc::clone(&cloud.inner);
    call(py, n_jobs, |monitor| {
        let scene = MetricCloud::new(&cloud, metres_per_unit, monitor)?;
        scene.oddities().into_iter().for_each(|text| monitor.warn(text));
        let survey = Survey::new(&scene, &params, monitor)?;
        let heights = terrain::heights_above_ground(&scene, &survey, &params, monitor)?;
        let found = terrain::footprints(&scene, &heights, &shape, monitor)?;
        Ok(io::geojson(&terrain::outlines(&found, scene.metres), &Georeference::of(&cloud)))
    })
}

/// Writes the outlines in the text of a GeoJSON file, in the format of the path's extension.
#[pyfunction]
pub(crate) fn write_footprints(py: Python<'_>, path: PathBuf, text: &str) -> PyResult<()> {
    call(py, Some(1), |monitor| {
        io::check_outline_output(&path)?;
        let found = io::outlines_of(text)?;
        io::write_outlines(&path, &found.outlines, &found.place, monitor)
    })
}

/// Writes heights with the northernmost row first; `corner` is the north-west corner.
#[pyfunction]
#[pyo3(signature = (path, values, corner, cell, crs = None, metres_per_unit = None))]
pub(crate) fn write_raster(
    py: Python<'_>,
    path: PathBuf,
    values: PyReadonlyArray2<'_, f64>,
    corner: [f64; 2],
    cell: f64,
    crs: Option<String>,
    metres_per_unit: Option<f64>,
) -> PyResult<()> {
    let [rows, columns] = [values.shape()[0], values.shape()[1]];
    let heights = matrix(&values, "values")?;
    let place = Georeference { crs, metres_per_unit };
    call(py, Some(1), |monitor| {
        io::check_raster_output(&path)?;
        let south = corner[1] - cell * rows as f64;
        let raster = raster(heights, columns, [corner[0], south], cell)?;
        io::write_raster(&path, &raster, &place, monitor)
    })
}

/// A raster from heights whose first row is the northernmost.
pub(crate) fn raster(heights: &[f64], columns: usize, origin: [f64; 2], cell: f64) -> Result<Raster> {
    let rows = heights.chunks(columns.max(1)).rev();
    Raster::new(origin, cell, columns, rows.flatten().copied().collect())
}
