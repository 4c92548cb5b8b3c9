//! Module `segmentation`: supervoxels, regions and objects of a cloud.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::{matrix, to_matrix, vector};
use crate::json;
use crate::neighbours::{points, points_kept, values_at};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use scansion_core::Result;
use scansion_core::cloud::{Cloud as CoreCloud, Points};
use scansion_core::features::normals;
use scansion_core::neighbours::knn;
use scansion_core::parallel::Monitor;
use scansion_core::segmentation::{
    self, NO_SUPERVOXEL, ObjectAttributes, OctreeGrowingParams, Partition, PointAttributes, RegionGrowingParams,
    RiemannianParams, SlicParams, VccsParams,
};
use std::sync::Arc;

/// A label for each point.
type Labels<'py> = Bound<'py, PyArray1<u32>>;

/// Rows of three numbers, if there are any.
pub(crate) fn triples<'a>(
    array: Option<&'a PyReadonlyArray2<'_, f32>>,
    name: &str,
) -> PyResult<Option<&'a [[f32; 3]]>> {
    let Some(array) = array else { return Ok(None) };
    let (rows, rest) = matrix(array, name)?.as_chunks::<3>();
    match rest.is_empty() {
        true => Ok(Some(rows)),
        false => Err(PyValueError::new_err(format!("{name}: expected shape (n, 3)"))),
    }
}

/// Supervoxel of each point; 2^32 - 1 for none.
#[pyfunction]
#[pyo3(signature = (cloud, method, settings, normals = None, colours = None, n_jobs = None))]
pub(crate) fn supervoxels<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    method: &str,
    settings: &str,
    normals: Option<PyReadonlyArray2<'py, f32>>,
    colours: Option<PyReadonlyArray2<'py, f32>>,
    n_jobs: Option<i64>,
) -> PyResult<Labels<'py>> {
    let (directions, colours) = (triples(normals.as_ref(), "normals")?, triples(colours.as_ref(), "colours")?);
    let cloud = Arc::clone(&cloud.inner);
    let found = match method {
        "slic" => {
            let params: SlicParams = json::settings(settings)?;
            call(py, n_jobs, |monitor| {
                let of = Attributed::new(&cloud, [directions, colours], monitor)?;
                let found = segmentation::slic(&of.points.positions, &of.attributes(), &params, monitor)?;
                Ok(of.in_cloud(found.labels()))
            })
        }
        _ => {
            let params: VccsParams = json::settings(settings)?;
            call(py, n_jobs, |monitor| {
                let of = Attributed::new(&cloud, [directions, colours], monitor)?;
                let found = segmentation::vccs(&of.points.positions, &of.attributes(), &params, monitor)?;
                Ok(of.in_cloud(found.labels()))
            })
        }
    }?;
    Ok(PyArray1::from_vec(py, found))
}

/// The points of a cloud that are not stray, and their attributes.
struct Attributed {
    /// Number of points of the cloud.
    all: usize,
    points: Points,
    normals: Option<Vec<[f32; 3]>>,
    colours: Option<Vec<[f32; 3]>>,
}

impl Attributed {
    /// `attributes`: normals and colours, one a point of the cloud.
    fn new(cloud: &CoreCloud, attributes: [Option<&[[f32; 3]]>; 2], monitor: &Monitor) -> Result<Self> {
        let points = points_kept(cloud, monitor)?;
        let [normals, colours] = attributes.map(|rows| rows.map(|rows| values_at(&points, rows)).transpose());
        Ok(Self { all: cloud.len(), normals: normals?, colours: colours?, points })
    }

    fn attributes(&self) -> PointAttributes<'_> {
        PointAttributes { normals: self.normals.as_deref(), colours: self.colours.as_deref() }
    }

    /// Labels of all points of the cloud; stray ones have none.
    fn in_cloud(&self, labels: &[u32]) -> Vec<u32> {
        let mut all = vec![NO_SUPERVOXEL; self.all];
        self.points.frame.index.iter().zip(labels).for_each(|(&i, &label)| all[i as usize] = label);
        all
    }
}

/// Supervoxel and segment of each point, and a report as JSON.
#[pyfunction]
#[pyo3(signature = (cloud, settings, n_jobs = None))]
pub(crate) fn riemannian<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<(Labels<'py>, Labels<'py>, String)> {
    let params: RiemannianParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let (found, report) = call(py, n_jobs, |monitor| {
        let found = segmentation::riemannian(&points(&cloud, None, monitor)?, &params, monitor)?;
        let report = serde_json::json!({
            "supervoxels": found.supervoxels.len(),
            "segments": found.segments.len(),
            "edges": found.sizes.edges,
            "iterations": found.iterations,
            "energy": found.energy,
            "seconds": found.seconds,
        });
        Ok((found, report.to_string()))
    })?;
    let labels = |partition: &Partition| PyArray1::from_slice(py, partition.segments());
    Ok((labels(&found.supervoxels), labels(&found.segments), report))
}

/// Region of each point, from 1; 0 for none.
#[pyfunction]
#[pyo3(signature = (cloud, neighbours, settings, n_jobs = None))]
pub(crate) fn region_growing<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    neighbours: usize,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Labels<'py>> {
    let params: RegionGrowingParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        let points = points(&cloud, None, monitor)?.positions;
        let near = knn(&points, neighbours, monitor)?;
        segmentation::region_growing(&near, &normals(&points, &near, monitor)?, &params, monitor)
    })?;
    Ok(PyArray1::from_vec(py, found.labels))
}

/// Region of each point, from 1; 0 for none.
#[pyfunction]
#[pyo3(signature = (cloud, settings, n_jobs = None))]
pub(crate) fn octree_region_growing<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    n_jobs: Option<i64>,
) -> PyResult<Labels<'py>> {
    let params: OctreeGrowingParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let grow = |monitor: &Monitor| {
        segmentation::octree_region_growing(&points(&cloud, None, monitor)?.positions, &params, monitor)
    };
    Ok(PyArray1::from_vec(py, call(py, n_jobs, grow)?.labels))
}

/// Features of each segment, row-major, and their names; segments in ascending order of their labels.
#[pyfunction]
#[pyo3(signature = (cloud, labels, colours = None, heights = None, n_jobs = None))]
pub(crate) fn object_features<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    labels: PyReadonlyArray1<'py, u32>,
    colours: Option<PyReadonlyArray2<'py, f32>>,
    heights: Option<PyReadonlyArray1<'py, f32>>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, Vec<String>)> {
    let labels = vector(&labels, "labels")?;
    let colours = triples(colours.as_ref(), "colours")?;
    let heights = heights.as_ref().map(|h| vector(h, "heights")).transpose()?;
    let cloud = Arc::clone(&cloud.inner);
    let table = call(py, n_jobs, |monitor| {
        let points: Points = points(&cloud, None, monitor)?;
        let partition = Partition::from_labels_watched(labels, monitor)?;
        let attributes = ObjectAttributes { colours, heights };
        segmentation::object_features(&points, &partition, &attributes, monitor)
    })?;
    let names = table.names.clone();
    Ok((to_matrix(py, table.values, names.len())?, names))
}
