//! The clouds that the network learns from, with the inputs and the class of each point.

use super::UNetRecipe;
use crate::cloud::{MetricCloud, Positions};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::training::TrainingData;
use crate::recipes::training::sources::{Source, Sources};

/// The class of a point without one.
pub(super) const NONE: u16 = u16::MAX;

/// A cloud, or a thinned copy of one.
pub(super) struct TrainingScene {
    pub(super) points: Positions,
    /// Count of further numbers of a point.
    pub(super) width: usize,
    numbers: Vec<f32>,
    /// Class of each point, [`NONE`] without one.
    pub(super) labels: Vec<u16>,
    /// For each class the points that may be centres of parts.
    centres: Vec<Vec<u32>>,
}

impl TrainingScene {
    /// The scene of a source.
    ///
    /// # Errors
    /// If a column is absent, or the work was cancelled.
    pub(super) fn new(
        recipe: &UNetRecipe,
        data: &TrainingData<'_>,
        source: &Source,
        sources: &Sources,
        monitor: &Monitor,
    ) -> Result<Self> {
        let classes = &sources.classes;
        let codes = source.codes(data, classes, &recipe.training);
        source.with_scene(data, monitor, |scene: &MetricCloud<'_>| {
            let points = scene.some_points(monitor)?;
            let numbers = recipe.inputs.of_points(scene.cloud, &points, &recipe.ground, monitor)?;
            let class = |&point: &u32| {
                let position = codes[point as usize].and_then(|code| classes.position(code));
                position.map_or(NONE, |position| position as u16)
            };
            let labels: Vec<u16> = points.frame.index.iter().map(class).collect();
            let row_of = points.frame.rows(scene.cloud.len());
            let mut centres = vec![Vec::new(); classes.len()];
            for candidate in &source.candidates {
                let row = row_of[candidate.point as usize];
                let class = labels.get(row as usize).copied().filter(|&class| class != NONE);
                if let Some(class) = class {
                    centres[usize::from(class)].push(row);
                }
            }
            Ok(Self { points: points.positions, width: recipe.inputs.width(), numbers, labels, centres })
        })
    }

    pub(super) fn numbers_of(&self, point: usize) -> &[f32] {
        &self.numbers[point * self.width..][..self.width]
    }

    /// Points of a class that may be centres of parts.
    pub(super) fn centres(&self, class: usize) -> &[u32] {
        &self.centres[class]
    }
}
