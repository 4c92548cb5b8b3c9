//! Features of points: the six descriptors of Guinard & Landrieu 2017, section 2, and multi-scale features.

use super::learned::RoadExample;
use super::road::RoadScene;
use super::{Descriptors, WeakRecipe};
use crate::classification::{Classifier, Predictor};
use crate::cloud::{Cloud, Points, Positions};
use crate::error::Result;
use crate::features::definition::Group;
use crate::features::{FeatureSet, FeatureTable, optimal_features, table_at};
use crate::parallel::Monitor;
use crate::recipes::predict::{CloudPredictor, FirstColumns};
use crate::terrain::{ElevationModel, Terrain};

/// Section 2.1: the four local descriptors.
pub(super) fn local(points: &Positions, recipe: &WeakRecipe, monitor: &Monitor) -> Result<FeatureTable> {
    monitor.stage("describe", points.len() as u64);
    Ok(optimal_features(points, &recipe.neighbourhood, monitor)?.table)
}

/// Section 2.2: the local descriptors, height above the road and position with respect to it.
pub(super) fn six(
    scene: &DescribedScene<'_>,
    local: FeatureTable,
    recipe: &WeakRecipe,
    monitor: &Monitor,
) -> Result<FeatureTable> {
    monitor.stage("road", 0);
    let mut forest = recipe.forest.clone();
    forest.seed = forest.seed.wrapping_add(recipe.seed);
    let DescribedScene { cloud, points, examples, elevation } = *scene;
    let scene = RoadScene { cloud, points, local: &local, examples, forest: &forest, elevation };
    let Terrain { elevation, position } = recipe.road.describe(&scene, monitor)?;
    let names = local.names.iter().cloned().chain(Group::Terrain.names()).collect();
    let mut values = Vec::with_capacity(points.len() * (local.width() + 2));
    for (row, (height, place)) in local.values.chunks_exact(local.width()).zip(elevation.iter().zip(&position)) {
        values.extend_from_slice(row);
        values.extend([height, place]);
    }
    Ok(FeatureTable { names, values })
}

/// A cloud whose points are described, and what its road is found by.
pub(super) struct DescribedScene<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: &'a Points,
    /// Labelled points of road and of other classes.
    pub(super) examples: &'a [RoadExample],
    /// Ground heights to use instead of those of the road points.
    pub(super) elevation: Option<&'a ElevationModel>,
}

/// The points of a cloud and their six descriptors.
pub(super) struct Described<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: Points,
    pub(super) six: FeatureTable,
}

/// The features besides the six descriptors, if any.
pub(super) fn more(recipe: &WeakRecipe, metres: Option<f64>) -> Option<FeatureSet> {
    let mut set = recipe.features.clone();
    set.metres_per_unit = metres.or(set.metres_per_unit);
    (recipe.descriptors == Descriptors::MultiScale).then_some(set)
}

/// The four local descriptors, which the segments are based on.
pub(super) fn head(features: &FeatureTable) -> FeatureTable {
    let rows = features.values.chunks_exact(features.width());
    FeatureTable { names: features.names[..4].to_vec(), values: rows.flat_map(|r| &r[..4]).copied().collect() }
}

/// The rows of these points.
pub(super) fn select(table: &FeatureTable, at: &[u32]) -> FeatureTable {
    let values = at.iter().flat_map(|&point| table.row(point as usize)).copied().collect();
    FeatureTable { names: table.names.clone(), values }
}

/// Labelled points whose six descriptors are known.
pub(super) struct LabelledRows<'a> {
    pub(super) six: FeatureTable,
    /// Their indices in the cloud.
    pub(super) places: &'a [u32],
}

/// All feature columns of some points, and the finest scale.
pub(super) fn rows(
    cloud: &Cloud,
    labelled: LabelledRows<'_>,
    more: Option<&FeatureSet>,
    monitor: &Monitor,
) -> Result<(FeatureTable, Option<f64>)> {
    let LabelledRows { six, places } = labelled;
    let Some(set) = more else { return Ok((six, None)) };
    let (scaled, scale) = table_at(cloud, set, places, monitor)?;
    let names: Vec<String> = six.names.iter().chain(&scaled.names).cloned().collect();
    let mut values = Vec::with_capacity(places.len() * names.len());
    for row in 0..places.len() {
        values.extend_from_slice(six.row(row));
        values.extend_from_slice(scaled.row(row));
    }
    Ok((FeatureTable { names, values }, Some(scale)))
}

impl Described<'_> {
    /// Names of all columns.
    pub(super) fn names(&self, more: Option<&FeatureSet>) -> Vec<String> {
        let scaled = more.map(|set| set.names(set.pyramid.first_scale.unwrap_or_default()));
        self.six.names.iter().cloned().chain(scaled.unwrap_or_default()).collect()
    }

    /// Class probabilities of all points, row-major; multi-scale features are computed and discarded block by block.
    pub(super) fn probabilities(
        &self,
        classifier: &Classifier,
        more: Option<&FeatureSet>,
        monitor: &Monitor,
    ) -> Result<Vec<f32>> {
        let classes = classifier.classes();
        let mut values = vec![0.0; self.points.len() * classes];
        let Some(set) = more else {
            monitor.stage("classify", self.points.len() as u64);
            classifier.predict_proba(&self.six.values, &mut values)?;
            return Ok(values);
        };
        let mut row_of = vec![0u32; self.cloud.len()];
        self.points.frame.index.iter().zip(0..).for_each(|(&place, point)| row_of[place as usize] = point);
        let first = FirstColumns { table: &self.six, row_of: &row_of };
        let predictor = CloudPredictor::after(first, self.cloud, set, classifier, monitor)?;
        let place = |points: &[u32], rows: &[f32]| {
            for (&point, row) in points.iter().zip(rows.chunks_exact(classes)) {
                values[row_of[point as usize] as usize * classes..][..classes].copy_from_slice(row);
            }
        };
        predictor.run(place, monitor)?;
        Ok(values)
    }
}
