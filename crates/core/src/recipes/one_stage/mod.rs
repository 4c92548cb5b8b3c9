//! What methods share that describe each point and learn one classifier on the descriptions: training and
//! classification. Such a method is a recipe that implements [`OneStage`].

mod classify;
mod description;
mod report;
mod train;

pub(in crate::recipes) use classify::classify;
pub(in crate::recipes) use description::Description;
pub use report::OneStageReport;
pub(in crate::recipes) use train::train;

use super::system::System;
use super::training::samples::TrainingParams;
use crate::classification::ClassifierParams;
use crate::cloud::MetricCloud;
use crate::error::Result;
use crate::parallel::Monitor;

/// A method of one classifier on features of points.
pub(in crate::recipes) trait OneStage: System {
    /// Selection of the training points.
    fn training(&self) -> &TrainingParams;

    /// Parameters of the selected classifier.
    fn classifier_params(&self) -> ClassifierParams;

    /// The features of the points of a cloud.
    ///
    /// # Errors
    /// If a column is absent, a parameter is out of range, or the work was cancelled.
    fn describe(&self, scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Description>;

    /// The same recipe with the choices that it leaves open, as made for the first cloud.
    fn settled(self, _first: &Description) -> Self {
        self
    }
}
