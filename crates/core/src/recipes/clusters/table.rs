//! Features of points from clusters, and from spheres whose radii are multiples of the clusters' radius.

use super::sets::{ClusterSet, spheres};
use crate::cloud::{Cloud, MetricCloud, Points};
use crate::error::Result;
use crate::features::definition::{Feature, Group};
use crate::features::{FeatureTable, colours};
use crate::memory;
use crate::parallel::Monitor;
use crate::segmentation::{Automatic, ClusterForm, ClusterInput, ClusterParams, automatic_parameters, cluster_levels};
use crate::terrain::{HeightParams, filtered_heights};
use serde::{Deserialize, Serialize};

/// Parameters of [`cluster_table`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClusterTableParams {
    /// The set of features.
    pub set: ClusterSet,
    /// The form of the clusters.
    pub form: ClusterForm,
    /// Whether red, green and blue are features too, and describe the categories; the cloud needs the columns.
    pub colour: bool,
    /// Metres per unit of the coordinates; `None` uses the cloud's own unit, else 1.
    pub metres_per_unit: Option<f64>,
    /// The clusters.
    pub clusters: ClusterParams,
    /// The ground.
    pub height: HeightParams,
}

/// Features of points, and the parameters found in the cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClusterTable {
    /// One row a point of the cloud; NaN for points that are not finite, or stray.
    pub table: FeatureTable,
    /// Radius, least size, angle and offset of segments, and where they come from.
    pub automatic: Automatic,
    /// Number of clusters on each level; 0 for set B.
    pub counts: [u32; 4],
}

/// Features of all points of a cloud by one of the three sets. Columns: the clusters; the covariance features at ε, then at
/// 2 ε and so on, with the multiple of ε appended, as in `Omnivariance_e2`; `Elevation`; red, green and blue.
///
/// Eigenvalues are those of the covariance divided by the number of points, in m². Memory 4 bytes a point and feature,
/// and about 100 bytes a point.
///
/// # Errors
/// As [`cluster_levels`]; if colours are wanted and the cloud has none; if no point has finite coordinates.
pub fn cluster_table(cloud: &Cloud, params: &ClusterTableParams, monitor: &Monitor) -> Result<ClusterTable> {
    let scene = MetricCloud::new(cloud, params.metres_per_unit, monitor)?;
    scene.oddities().into_iter().for_each(|text| monitor.warn(text));
    let points = scene.some_points(monitor)?;
    let found = table_of_points(&scene, &points, params, monitor)?;
    Ok(ClusterTable { table: in_cloud(&found.table, &points, cloud.len(), monitor)?, ..found })
}

/// The same of the points alone: row i belongs to point i.
pub(super) fn table_of_points(
    scene: &MetricCloud<'_>,
    points: &Points,
    params: &ClusterTableParams,
    monitor: &Monitor,
) -> Result<ClusterTable> {
    params.clusters.validate()?;
    params.height.validate()?;
    let colour = if params.colour { Some(colours(scene.cloud, &points.frame.index, monitor)?) } else { None };
    let heights = filtered_heights(points, &params.height, monitor)?;
    let mut found = ClusterTable::default();
    let mut parts: Vec<FeatureTable> = Vec::new();
    if params.set.has_clusters() {
        let input = ClusterInput { points: &points.positions, heights: Some(&heights), colours: colour.as_deref() };
        let levels = cluster_levels(&input, &params.clusters, monitor)?;
        parts.push(levels.features(params.form, monitor)?);
        found = ClusterTable { counts: levels.counts, automatic: levels.automatic, ..found };
    } else {
        found.automatic = automatic_parameters(&points.positions, &params.clusters, monitor)?;
    }
    if params.set != ClusterSet::A {
        parts.push(spheres(points, params.set, found.automatic.radius, monitor)?);
        parts.push(FeatureTable { names: vec![Feature::Elevation.definition().name.into()], values: heights });
    }
    if let Some(colour) = colour {
        parts.push(FeatureTable { names: Group::Colour.names().collect(), values: colour.into_flattened() });
    }
    found.table = parts.into_iter().reduce(|all, part| all.beside(&part)).unwrap_or_default();
    Ok(found)
}

/// A table of the points as one of all points of the cloud.
fn in_cloud(table: &FeatureTable, points: &Points, len: usize, monitor: &Monitor) -> Result<FeatureTable> {
    let width = table.width();
    let mut values = memory::filled(f32::NAN, len * width, &format!("{width} features of {len} points"))?;
    for (i, &point) in points.frame.index.iter().enumerate() {
        if i.is_multiple_of(1 << 16) {
            monitor.check()?;
        }
        values[point as usize * width..][..width].copy_from_slice(table.row(i));
    }
    Ok(FeatureTable { names: table.names.clone(), values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};
    use crate::random::stream;

    /// Flat ground at a height of 100 m and a box of 4 x 4 x 3 m on it, with colours; the last point is not finite.
    fn scene() -> Cloud {
        let mut random = stream(21, 0);
        let mut u = |from: f64, to: f64| from + (to - from) * random.uniform();
        let mut rows: Vec<[f64; 3]> = (0..9000).map(|_| [u(0.0, 30.0), u(0.0, 30.0), 100.0]).collect();
        rows.retain(|p| !((10.0..14.0).contains(&p[0]) && (10.0..14.0).contains(&p[1])));
        rows.extend((0..900).map(|_| [u(10.0, 14.0), u(10.0, 14.0), 103.0]));
        rows.extend((0..900).map(|_| [10.0, u(10.0, 14.0), u(100.0, 103.0)]));
        rows.push([f64::NAN, 0.0, 0.0]);
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        for name in crate::cloud::names::COLOUR {
            let values = Values::U16((0..rows.len()).map(|i| (i % 7 * 9000) as u16).collect());
            cloud.set_column(Column::new(name, values)).unwrap();
        }
        cloud
    }

    #[test]
    fn the_sets_have_the_sizes_of_the_paper_and_three_more_with_colour() {
        let cloud = scene();
        for (set, width) in [(ClusterSet::A, 4), (ClusterSet::B, 73), (ClusterSet::C, 17)] {
            for colour in [false, true] {
                let params = ClusterTableParams { set, colour, ..ClusterTableParams::default() };
                let found = cluster_table(&cloud, &params, &Monitor::default()).unwrap().table;
                assert_eq!((found.width(), found.rows()), (width + if colour { 3 } else { 0 }, cloud.len()));
                let mut names = found.names.clone();
                names.sort();
                names.dedup();
                assert_eq!(names.len(), found.names.len());
                assert!(found.row(cloud.len() - 1).iter().all(|v| v.is_nan()));
                assert!(found.values[..(cloud.len() - 1) * found.width()].iter().all(|v| v.is_finite()));
            }
        }
    }

    #[test]
    fn heights_are_above_the_ground_and_spheres_have_multiples_of_the_radius() {
        let cloud = scene();
        let params = ClusterTableParams { set: ClusterSet::B, ..ClusterTableParams::default() };
        let found = cluster_table(&cloud, &params, &Monitor::default()).unwrap();
        let column = |name: &str| found.table.names.iter().position(|n| n == name).unwrap();
        let value = |i: usize, name: &str| f64::from(found.table.row(i)[column(name)]);
        let roof = cloud.len() - 2 - 900;
        assert!(value(0, "Elevation").abs() < 0.05 && (value(roof, "Elevation") - 3.0).abs() < 0.05);
        // On a plane of even density Σλ = r² / 2; the roof's centre is far from its borders for few radii.
        let inner =
            (0..8000).find(|&i| (20.0..22.0).contains(&cloud.xyz(i)[0]) && (14.0..16.0).contains(&cloud.xyz(i)[1]));
        for factor in [4.0, 8.0] {
            let radius = factor * found.automatic.radius;
            let sum = value(inner.unwrap(), &format!("Sum_e{factor}"));
            assert!((sum / (0.5 * radius * radius) - 1.0).abs() < 0.15, "{sum} {radius}");
        }
    }

    #[test]
    fn colours_that_are_not_there_are_refused() {
        let cloud = Cloud::from_rows(&[[0.0; 3]; 40]).unwrap();
        let params = ClusterTableParams { colour: true, ..ClusterTableParams::default() };
        assert!(cluster_table(&cloud, &params, &Monitor::default()).unwrap_err().to_string().contains("Red"));
    }
}
