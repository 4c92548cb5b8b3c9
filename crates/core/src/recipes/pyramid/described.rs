//! Step 3: feature vectors of the chosen points.

use super::PyramidRecipe;
use crate::classes::ClassTable;
use crate::classification::Samples;
use crate::error::Result;
use crate::features::{self, FeatureSet};
use crate::parallel::Monitor;
use crate::recipes::regularise::Regularise;
use crate::recipes::training::TrainingData;
use crate::recipes::training::blocks::Place;
use crate::recipes::training::checkerboard::Checkerboard;
use crate::recipes::training::choice::{Labelled, NeededPoints, Trial};
use crate::recipes::training::sources::SampleSources;

/// Feature vectors of the chosen points, the position of their class, and their places.
#[derive(Default)]
pub(super) struct SampleTable {
    pub(super) values: Vec<f32>,
    pub(super) labels: Vec<u16>,
    /// Weight of each sample; empty if all are equal.
    pub(super) weights: Vec<f32>,
    /// For cross-validation, which holds out whole squares.
    pub(super) places: Vec<Place>,
    /// Colour of the square of each sample on the checkerboard of the choice of a regularisation.
    pub(super) colours: Vec<usize>,
    /// The patches of that choice; empty if there is nothing to choose.
    pub(super) trials: Vec<Trial>,
    pub(super) names: Vec<String>,
    pub(super) classes: ClassTable,
    /// The features; the first scale is set.
    pub(super) features: FeatureSet,
}

impl SampleTable {
    pub(super) fn samples(&self) -> Samples<'_> {
        let (features, labels) = (&self.values[..], &self.labels[..]);
        let weights = (!self.weights.is_empty()).then_some(&self.weights[..]);
        Samples { features, width: self.names.len(), labels, weights, classes: self.classes.len() }
    }
}

impl SampleTable {
    /// Computes the feature vectors of the chosen points, all with the first scale of the first cloud.
    pub(super) fn new(
        data: &TrainingData<'_>,
        sources: &SampleSources,
        recipe: &PyramidRecipe,
        monitor: &Monitor,
    ) -> Result<Self> {
        let mut described = Self {
            classes: sources.classes.clone(),
            features: recipe.features.clone(),
            weights: sources.sample_weights(),
            ..Self::default()
        };
        for (number, source) in (0..).zip(&sources.list) {
            let board = Checkerboard::of_cloud(&data.scenes[source.cloud].metric, recipe.regularise.choice.square);
            described.labels.extend(source.labels(&sources.classes));
            source.with_scene(data, monitor, |scene| {
                let points = source.points();
                let plan = match recipe.regularise.method {
                    Regularise::Auto => {
                        let codes = source.codes(data, &sources.classes, &recipe.training);
                        let seed = recipe.seed.wrapping_add(number);
                        let labelled = Labelled { scene, codes: &codes, board, seed };
                        NeededPoints::new(&labelled, &points, &recipe.regularise.choice, monitor)?
                    }
                    _ => NeededPoints::samples(&points),
                };
                let (table, first_scale) = features::table_at(scene, &described.features, &plan.points, monitor)?;
                let pyramid = &mut described.features.pyramid;
                (pyramid.first_scale, pyramid.levels) = (Some(first_scale), Some(pyramid.count(first_scale)));
                described.values.extend_from_slice(&table.values[..points.len() * table.width()]);
                described.trials.push(plan.into_trial(&table));
                let xyz = |&p: &u32| scene.cloud.xyz(p as usize);
                described.places.extend(points.iter().map(|p| Place::new(source.cloud, xyz(p), scene.metres)));
                described.colours.extend(points.iter().map(|p| board.colour(xyz(p))));
                described.names = table.names;
                Ok(())
            })?;
        }
        Ok(described)
    }
}
