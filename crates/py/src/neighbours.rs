//! Module `neighbours`: nearest neighbours and optimal neighbourhoods.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::to_matrix;
use crate::json;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use scansion_core::cloud::{MetricCloud, Points};
use scansion_core::features::optimal_features;
use scansion_core::neighbours::OptimalParams;
use scansion_core::parallel::{Monitor, watched};
use scansion_core::{Cloud as CoreCloud, Error, Result};
use std::sync::Arc;

/// All points of a cloud in metres, including stray ones, so that indices are those of the cloud.
pub(crate) fn points(cloud: &CoreCloud, metres_per_unit: Option<f64>, monitor: &Monitor) -> Result<Points> {
    of_all(&MetricCloud::new(cloud, metres_per_unit, monitor)?, monitor)
}

/// The points of a cloud that are not stray, in metres; warns of stray ones, and refuses points that are not finite.
pub(crate) fn points_kept(cloud: &CoreCloud, monitor: &Monitor) -> Result<Points> {
    let scene = MetricCloud::new(cloud, None, monitor)?;
    if let Some(text) = scene.strays.warning(cloud) {
        monitor.warn(format!("{text}; they are left out"));
    }
    let kept = scene.points(monitor)?;
    let strays = scene.strays.index.len();
    all_finite(cloud, kept.len() + strays)?;
    Ok(kept)
}

/// The values of some points of a cloud, from one value for each of its points.
pub(crate) fn values_at<T: Copy>(points: &Points, values: &[T]) -> Result<Vec<T>> {
    let at = |&i: &u32| values.get(i as usize).copied();
    let found: Option<Vec<T>> = points.frame.index.iter().map(at).collect();
    found.ok_or_else(|| Error::input(format!("{} values, fewer than the points of the cloud", values.len())))
}

fn of_all(scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Points> {
    let points = scene.points_and_strays(monitor)?;
    all_finite(scene.cloud, points.len())?;
    Ok(points)
}

/// Fails if fewer points than those of the cloud are finite.
fn all_finite(cloud: &CoreCloud, finite: usize) -> Result<()> {
    match cloud.len() - finite {
        0 => Ok(()),
        lost => Err(Error::input(format!("{lost} of {} points have NaN or infinite coordinates", cloud.len()))),
    }
}

/// A scene whose stray points are set aside, and all its points.
pub(crate) struct Told<'a> {
    pub(crate) scene: MetricCloud<'a>,
    pub(crate) all: Points,
}

/// Warns of what may change results, such as stray points, and refuses points that are not finite.
pub(crate) fn told<'a>(cloud: &'a CoreCloud, metres_per_unit: Option<f64>, monitor: &Monitor) -> Result<Told<'a>> {
    let scene = MetricCloud::new(cloud, metres_per_unit, monitor)?;
    scene.oddities().into_iter().for_each(|text| monitor.warn(text));
    let all = of_all(&scene, monitor)?;
    Ok(Told { scene, all })
}

/// Indices of the nearest points and their distances, `(n, k)` each.
#[pyfunction]
#[pyo3(signature = (cloud, k, metres_per_unit = None, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn knn<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    k: usize,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray2<u32>>, Bound<'py, PyArray2<f32>>)> {
    let cloud = Arc::clone(&cloud.inner);
    let (indices, distances) = call(py, n_jobs, |monitor| {
        let points = points(&cloud, metres_per_unit, monitor)?.positions;
        if k == 0 || k >= points.len() {
            let most = points.len().saturating_sub(1);
            return Err(Error::parameter("k", k, format!("1..{most} for {} points", points.len())));
        }
        let near = scansion_core::neighbours::knn(&points, k, monitor)?;
        let (mut indices, mut distances) = (Vec::new(), Vec::new());
        indices.reserve_exact(near.indices().len());
        distances.reserve_exact(near.indices().len());
        for piece in watched(near.len(), monitor) {
            let piece = piece?;
            piece.clone().for_each(|i| indices.extend_from_slice(near.of(i)));
            distances.extend(piece.flat_map(|i| near.squared_distances(i)).map(|d| d.sqrt()));
        }
        Ok((indices, distances))
    })?;
    Ok((to_matrix(py, indices, k)?, to_matrix(py, distances, k)?))
}

/// The points within a radius of each query: offsets of the groups `(queries + 1,)`, indices and distances.
#[pyfunction]
#[pyo3(signature = (cloud, queries, radius, metres_per_unit = None, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "three arrays")]
pub(crate) fn within<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    queries: Option<&Cloud>,
    radius: f64,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f32>>)> {
    let cloud = Arc::clone(&cloud.inner);
    let queries = queries.map(|queries| Arc::clone(&queries.inner));
    let (offsets, indices, distances) = call(py, n_jobs, |monitor| {
        let of = points(&cloud, metres_per_unit, monitor)?;
        let asked = queries.map(|queries| {
            // Positions without a unit are in that of the cloud.
            let own = cloud.metres_per_unit.filter(|_| !queries.is_in_degrees());
            points(&queries, metres_per_unit.or(queries.metres_per_unit).or(own), monitor)?.moved_to(of.frame.origin)
        });
        let asked = asked.transpose()?;
        let asked = asked.as_ref().unwrap_or(&of);
        let near = scansion_core::neighbours::within(&of.positions, &asked.positions, radius, monitor)?;
        let mut distances = Vec::new();
        distances.reserve_exact(near.groups().items().len());
        for piece in watched(near.len(), monitor) {
            distances.extend(piece?.flat_map(|i| near.squared_distances(i)).map(|d| d.sqrt()));
        }
        Ok((near.groups().offsets().to_vec(), near.groups().items().to_vec(), distances))
    })?;
    Ok((PyArray1::from_vec(py, offsets), PyArray1::from_vec(py, indices), PyArray1::from_vec(py, distances)))
}

/// Size of each point's optimal neighbourhood, and its four descriptors.
#[pyfunction]
#[pyo3(signature = (cloud, settings, metres_per_unit = None, n_jobs = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn optimal<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    metres_per_unit: Option<f64>,
    n_jobs: Option<i64>,
) -> PyResult<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f32>>)> {
    let params: OptimalParams = json::settings(settings)?;
    let cloud = Arc::clone(&cloud.inner);
    let found = call(py, n_jobs, |monitor| {
        optimal_features(&points(&cloud, metres_per_unit, monitor)?.positions, &params, monitor)
    })?;
    let width = found.table.width();
    Ok((PyArray1::from_vec(py, found.k), to_matrix(py, found.table.values, width)?))
}
