//! Teaches a model to find cars.

use super::Model;
use super::any::AnyFitted;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::auto_context::{CarLessons, CarReport, CarTraining};
use crate::recipes::classify::rules::CarParams;
use crate::recipes::labels::LabelledCloud;
use crate::recipes::trained::Trained;

impl Model {
    /// The same model with a classifier of cars beside it, learned from labelled clouds; what it says about other points
    /// stays. It replaces an earlier one. Clouds and copies of the densities of the model's recipe are classified, which
    /// takes most of the time.
    ///
    /// # Errors
    /// If the model is not of a recipe with two stages and heights above the ground, the clouds have no cars or nothing
    /// else that the model takes for vegetation or buildings, or the work was cancelled.
    pub fn with_cars(
        &self,
        clouds: &[LabelledCloud],
        training: &CarTraining,
        monitor: &Monitor,
    ) -> Result<(Self, CarReport)> {
        let AnyFitted::AutoContext(fitted) = &self.fitted else {
            let name = self.fitted.recipe().name();
            return Err(Error::ModelMismatch(format!("models of the recipe {name} cannot learn cars (airborne can)")));
        };
        let mut fitted = fitted.clone();
        let lessons = CarLessons { recipe: &fitted.recipe, trained: &self.trained, training };
        let (cars, report) = lessons.learn(clouds, monitor)?;
        if fitted.recipe.classes.cars.points == 0 {
            fitted.recipe.classes.cars = CarParams::default();
        }
        let trained = Trained { cars: Some(cars), ..self.trained.clone() };
        Ok((Self { fitted: AnyFitted::AutoContext(fitted), trained }, report))
    }
}
