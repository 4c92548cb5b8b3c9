//! Features of points: the six descriptors of Guinard & Landrieu 2017, section 2, and multi-scale features.

use super::road::{DescribedRoad, RoadScene};
use super::{Descriptors, WeakRecipe};
use crate::classification::{ClassWeight, Classifier, ForestParams, Predictor};
use crate::cloud::{MetricCloud, Points};
use crate::error::Result;
use crate::features::definition::Group;
use crate::features::{FeatureSet, FeatureTable, optimal_features, table_at};
use crate::parallel::Monitor;
use crate::recipes::classify::predict::{CloudPredictor, FirstColumns};
use crate::terrain::{ElevationModel, RoadExample, Terrain};

/// A cloud, its points and their four local descriptors.
pub(super) struct WeakScene<'a> {
    pub(super) metric: &'a MetricCloud<'a>,
    pub(super) points: Points,
    pub(super) local: FeatureTable,
}

impl<'a> WeakScene<'a> {
    /// Computes points and local descriptors.
    ///
    /// # Errors
    /// If there is no point, or the work was cancelled.
    pub(super) fn new(metric: &'a MetricCloud<'a>, recipe: &WeakRecipe, monitor: &Monitor) -> Result<Self> {
        let points = metric.some_points(monitor)?;
        monitor.stage("describe", points.len() as u64);
        let local = optimal_features(&points.positions, &recipe.neighbourhood, monitor)?.table;
        Ok(Self { metric, points, local })
    }
}

/// What the road of a cloud is found by.
#[derive(Clone, Copy)]
pub(super) struct RoadSources<'a> {
    /// Labelled points of road and of other classes.
    pub(super) examples: &'a [RoadExample],
    /// Ground heights, in the unit of the cloud, to use instead of those of the road points.
    pub(super) elevation: Option<&'a ElevationModel>,
}

/// The six descriptors of the points of a cloud.
pub(super) struct PaperDescriptors {
    pub(super) table: FeatureTable,
    /// The warning about a road that was not found.
    pub(super) warning: Option<String>,
}

/// The local descriptors, height above the road and position with respect to it.
pub(super) fn paper_descriptors(
    scene: &WeakScene<'_>,
    sources: RoadSources<'_>,
    recipe: &WeakRecipe,
    monitor: &Monitor,
) -> Result<PaperDescriptors> {
    monitor.stage("road", 0);
    let forest = road_forest(recipe);
    let RoadSources { examples, elevation } = sources;
    let WeakScene { metric, points, local } = scene;
    let elevation = elevation.map(|model| model.in_metres(metric.metres)).transpose()?;
    let scene =
        RoadScene { cloud: metric.cloud, points, local, examples, forest: &forest, elevation: elevation.as_ref() };
    let DescribedRoad { terrain: Terrain { elevation, position }, warning } = recipe.road.describe(&scene, monitor)?;
    let names = local.names.iter().cloned().chain(Group::Terrain.names()).collect();
    let mut values = Vec::with_capacity(points.len() * (local.width() + 2));
    for (row, (height, place)) in local.values.chunks_exact(local.width()).zip(elevation.iter().zip(&position)) {
        values.extend_from_slice(row);
        values.extend([height, place]);
    }
    Ok(PaperDescriptors { table: FeatureTable { names, values }, warning })
}

/// The forest that tells road from other points. Weights by class belong to the classes of the recipe, not to these two.
fn road_forest(recipe: &WeakRecipe) -> ForestParams {
    let forest = recipe.forest.clone();
    let class_weight = match forest.class_weight {
        ClassWeight::PerClass(_) => ClassWeight::None,
        same => same,
    };
    ForestParams { class_weight, seed: forest.seed.wrapping_add(recipe.seed), ..forest }
}

/// The features besides those of the paper, if any.
pub(super) fn scaled_features(recipe: &WeakRecipe) -> Option<&FeatureSet> {
    (recipe.descriptors == Descriptors::MultiScale).then_some(&recipe.features)
}

/// A cloud and the six descriptors of the paper.
pub(super) struct DescribedCloud<'a> {
    pub(super) scene: WeakScene<'a>,
    pub(super) paper: FeatureTable,
}

/// Some points of a cloud and their six descriptors.
pub(super) struct SelectedPoints {
    paper: FeatureTable,
    /// Their indices in the cloud.
    in_cloud: Vec<u32>,
}

impl SelectedPoints {
    /// All feature columns, and the finest scale.
    pub(super) fn rows(
        self,
        metric: &MetricCloud<'_>,
        scaled: Option<&FeatureSet>,
        monitor: &Monitor,
    ) -> Result<(FeatureTable, Option<f64>)> {
        let Some(set) = scaled else { return Ok((self.paper, None)) };
        let (scaled, scale) = table_at(metric, set, &self.in_cloud, monitor)?;
        Ok((self.paper.beside(&scaled), Some(scale)))
    }
}

impl DescribedCloud<'_> {
    /// Names of all columns.
    pub(super) fn names(&self, scaled: Option<&FeatureSet>) -> Vec<String> {
        let scaled = scaled.map(|set| set.names(set.pyramid.first_scale.unwrap_or_default()));
        self.paper.names.iter().cloned().chain(scaled.unwrap_or_default()).collect()
    }

    /// These points and their six descriptors.
    pub(super) fn select(&self, at: &[u32]) -> SelectedPoints {
        let index = &self.scene.points.frame.index;
        let in_cloud = at.iter().map(|&point| index[point as usize]).collect();
        SelectedPoints { paper: self.paper.select(at), in_cloud }
    }

    /// Class probabilities of all points, row-major; multi-scale features are computed and discarded block by block.
    pub(super) fn probabilities(
        &self,
        classifier: &Classifier,
        scaled: Option<&FeatureSet>,
        monitor: &Monitor,
    ) -> Result<Vec<f32>> {
        let WeakScene { metric, points, .. } = &self.scene;
        let Some(set) = scaled else {
            let mut values = vec![0.0; points.len() * classifier.classes()];
            monitor.stage("classify", points.len() as u64);
            classifier.predict_proba(&self.paper.values, &mut values)?;
            return Ok(values);
        };
        let row_of = points.frame.rows(metric.cloud.len());
        let first = FirstColumns { classifier, table: &self.paper, row_of: &row_of };
        let predictor = CloudPredictor::after(first, metric, set, monitor)?;
        Ok(predictor.of_points(&row_of, points.len(), monitor)?.probabilities)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_the_classes_are_not_those_of_the_road() {
        let of = |class_weight: ClassWeight| {
            let forest = ForestParams { class_weight, seed: 2, ..ForestParams::breiman() };
            road_forest(&WeakRecipe { seed: 3, forest, ..WeakRecipe::default() })
        };
        let plain = ForestParams { seed: 5, ..ForestParams::breiman() };
        assert_eq!(of(ClassWeight::PerClass(vec![1.0, 5.0])), plain);
        assert_eq!(of(ClassWeight::None), plain);
        assert_eq!(of(ClassWeight::Balanced), ForestParams { class_weight: ClassWeight::Balanced, ..plain });
    }
}
