//! The clouds that the network learns from, with the inputs and the class of each point.

use super::UNetRecipe;
use crate::cloud::{MetricCloud, Positions};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::training::TrainingData;
use crate::recipes::training::networks::Labelled;
use crate::recipes::training::sources::{SampleSource, SampleSources};
use sha2::Digest;

/// A cloud, or a thinned copy of one.
pub(super) struct TrainingScene {
    pub(super) points: Positions,
    /// Count of further numbers of a point.
    pub(super) width: usize,
    numbers: Vec<f32>,
    /// Whether each point may be learned from without a label too: it is not excluded from training.
    pub(super) used: Vec<bool>,
    /// Class of each point, and those that may be centres of parts.
    pub(super) labelled: Labelled,
}

impl TrainingScene {
    /// The scenes of all sources, in their order.
    ///
    /// # Errors
    /// If a column is absent, or the work was cancelled.
    pub(super) fn all(
        recipe: &UNetRecipe,
        data: &TrainingData<'_>,
        sources: &SampleSources,
        monitor: &Monitor,
    ) -> Result<Vec<Self>> {
        let classes = &sources.classes;
        let of = |source: &SampleSource| {
            let codes = source.codes(data, classes, &recipe.training);
            source.with_scene(data, monitor, |scene: &MetricCloud<'_>| {
                let points = scene.some_points(monitor)?;
                let numbers = recipe.inputs.of_points(scene.cloud, &points, &recipe.ground, monitor)?;
                let labelled = Labelled::new(&points, &codes, source, classes);
                let used = |&i: &u32| {
                    let [x, y, _] = scene.cloud.xyz(i as usize);
                    !recipe.training.excludes(x, y)
                };
                let used = points.frame.index.iter().map(used).collect();
                Ok(Self { points: points.positions, width: recipe.inputs.width(), numbers, used, labelled })
            })
        };
        sources.list.iter().map(of).collect()
    }

    /// Feeds all that is learned from to a checksum.
    pub(super) fn feed(&self, sum: &mut impl Digest) {
        let Positions { x, y, z } = &self.points;
        [x, y, z, &self.numbers].into_iter().flatten().for_each(|v| sum.update(v.to_le_bytes()));
        self.labelled.feed(sum);
    }

    pub(super) fn numbers_of(&self, point: usize) -> &[f32] {
        &self.numbers[point * self.width..][..self.width]
    }
}
