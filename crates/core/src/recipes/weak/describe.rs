//! The six descriptors of every point (document 000, section 2).

use super::WeakRecipe;
use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::features::{FeatureTable, optimal_features};
use crate::parallel::Monitor;
use crate::terrain::{DESCRIPTORS, Terrain};

/// Local coordinates of a cloud, metres.
pub(super) fn points_of(cloud: &Cloud, metres: Option<f64>) -> Result<Points> {
    let points = Points::from_cloud(cloud, metres.or(cloud.metres_per_unit).unwrap_or(1.0));
    if points.is_empty() {
        return Err(Error::input("the cloud has no point with finite coordinates"));
    }
    Ok(points)
}

/// Section 2.1: the four local descriptors.
pub(super) fn local(points: &Points, recipe: &WeakRecipe, monitor: &Monitor) -> Result<FeatureTable> {
    monitor.stage("describe", points.len() as u64);
    Ok(optimal_features(points, &recipe.neighbourhood, monitor)?.table)
}

/// Section 2.2: the local descriptors, height above the road and position with respect to it.
pub(super) fn all(
    cloud: &Cloud,
    points: &Points,
    local: &FeatureTable,
    recipe: &WeakRecipe,
    monitor: &Monitor,
) -> Result<FeatureTable> {
    monitor.stage("road", 0);
    let mut forest = recipe.forest.clone();
    forest.seed = forest.seed.wrapping_add(recipe.seed);
    let Terrain { elevation, position } = recipe.road.describe((cloud, points), local, &forest, monitor)?;
    let names = local.names.iter().cloned().chain(DESCRIPTORS.iter().map(|d| d.name.to_string())).collect();
    let mut values = Vec::with_capacity(points.len() * (local.width() + 2));
    for (row, (height, place)) in local.values.chunks_exact(local.width()).zip(elevation.iter().zip(&position)) {
        values.extend_from_slice(row);
        values.extend([height, place]);
    }
    Ok(FeatureTable { names, values })
}
