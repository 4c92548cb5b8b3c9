//! Features of points from clusters, and from spheres whose radius the clusters give: the feature sets A, B and C of E.
//! Grilli, F. Poux, F. Remondino 2021, section 4.

use crate::cloud::{Cloud, MetricCloud, Points};
use crate::error::Result;
use crate::features::definition::{Definition, Feature, Group};
use crate::features::{Divisor, FeatureTable, Quantity, RadiusParams, colours, radius_features};
use crate::memory;
use crate::parallel::Monitor;
use crate::segmentation::{Automatic, ClusterForm, ClusterInput, ClusterParams, automatic_parameters, cluster_levels};
use crate::terrain::{HeightParams, filtered_heights};
use serde::{Deserialize, Serialize};

/// A set of features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClusterSet {
    /// The clusters at four levels: 4 features.
    A,
    /// Eight covariance features and verticality in spheres of ε, 2 ε, ... 8 ε, and the height above the ground: 73.
    B,
    /// The clusters; omnivariance, surface variation and verticality in spheres of ε to 4 ε; the height: 17.
    #[default]
    C,
}

/// Features of B.
const ALL: [Quantity; 9] = [
    Quantity::Sum,
    Quantity::Omnivariance,
    Quantity::Eigenentropy,
    Quantity::Anisotropy,
    Quantity::Planarity,
    Quantity::Linearity,
    Quantity::SurfaceVariation,
    Quantity::Sphericity,
    Quantity::Verticality,
];
/// Features of C.
const FEW: [Quantity; 3] = [Quantity::Omnivariance, Quantity::SurfaceVariation, Quantity::Verticality];

impl ClusterSet {
    fn has_clusters(self) -> bool {
        self != Self::B
    }

    /// Quantities in spheres.
    fn quantities(self) -> &'static [Quantity] {
        match self {
            Self::A => &[],
            Self::B => &ALL,
            Self::C => &FEW,
        }
    }

    /// Number of radii, multiples of ε.
    fn radii(self) -> u8 {
        match self {
            Self::A => 0,
            Self::B => 8,
            Self::C => 4,
        }
    }
}

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
    params.clusters.validate()?;
    params.height.validate()?;
    let scene = MetricCloud::new(cloud, params.metres_per_unit, monitor)?;
    let points = scene.some_points(monitor)?;
    scene.oddities().into_iter().for_each(|text| monitor.warn(text));
    let colour = if params.colour { Some(colours(cloud, &points.frame.index)?) } else { None };
    let heights = filtered_heights(&points, &params.height, monitor)?;
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
        parts.push(spheres(&points, params.set, found.automatic.radius, monitor)?);
        parts.push(FeatureTable { names: vec![Feature::Elevation.definition().name.into()], values: heights });
    }
    if let Some(colour) = colour {
        parts.push(FeatureTable { names: Group::Colour.names().collect(), values: colour.into_flattened() });
    }
    found.table = in_cloud(&parts, &points, cloud.len(), monitor)?;
    Ok(found)
}

/// The covariance features in spheres of multiples of the radius.
fn spheres(points: &Points, set: ClusterSet, radius: f64, monitor: &Monitor) -> Result<FeatureTable> {
    let definitions: Vec<&Definition> = set.quantities().iter().map(|&q| definition(q)).collect();
    let name = |factor: u8| definitions.iter().map(move |d| format!("{}_e{factor}", d.name)).collect::<Vec<_>>();
    let radii = (1..=set.radii()).map(|factor| radius * f64::from(factor)).collect();
    let params = RadiusParams { radii, divisor: Divisor::N, ..RadiusParams::default() };
    let values = radius_features(&points.positions, set.quantities(), &params, monitor)?;
    Ok(FeatureTable { names: (1..=set.radii()).flat_map(name).collect(), values })
}

/// The definition of a covariance feature.
fn definition(quantity: Quantity) -> &'static Definition {
    let feature = match quantity {
        Quantity::Omnivariance => Feature::Omnivariance,
        Quantity::Eigenentropy => Feature::Eigenentropy,
        Quantity::Anisotropy => Feature::Anisotropy,
        Quantity::Planarity => Feature::Planarity,
        Quantity::Linearity => Feature::Linearity,
        Quantity::SurfaceVariation => Feature::SurfaceVariation,
        Quantity::Sphericity => Feature::Sphericity,
        Quantity::Verticality => Feature::Verticality,
        _ => Feature::Sum,
    };
    feature.definition()
}

/// Tables of the points side by side, as a table of all points of the cloud.
fn in_cloud(parts: &[FeatureTable], points: &Points, len: usize, monitor: &Monitor) -> Result<FeatureTable> {
    let names: Vec<String> = parts.iter().flat_map(|part| part.names.iter().cloned()).collect();
    let width = names.len();
    let mut values = memory::filled(f32::NAN, len * width, &format!("{width} features of {len} points"))?;
    for (i, &point) in points.frame.index.iter().enumerate() {
        if i.is_multiple_of(1 << 16) {
            monitor.check()?;
        }
        let row = parts.iter().flat_map(|part| part.row(i));
        values[point as usize * width..][..width].iter_mut().zip(row).for_each(|(value, from)| *value = *from);
    }
    Ok(FeatureTable { names, values })
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
