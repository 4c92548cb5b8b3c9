//! Teaches a model to find cars.

use super::Model;
use super::any::AnyFitted;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::auto_context::{AutoContextRecipe, CarLessons, CarReport, CarTraining};
use crate::recipes::classify::candidates::Candidates;
use crate::recipes::classify::rules::CarParams;
use crate::recipes::labels::LabelledCloud;
use crate::recipes::system::Fitted;
use crate::recipes::trained::Trained;

/// The recipe of a model that can have a classifier of cars.
///
/// # Errors
/// If the recipe is another one, does not use heights above the ground, or the model has other classes.
pub(super) fn knows_cars<'a>(fitted: &'a AnyFitted, trained: &Trained) -> Result<&'a Fitted<AutoContextRecipe>> {
    let AnyFitted::AutoContext(own) = fitted else {
        let name = fitted.recipe().name();
        return Err(Error::ModelMismatch(format!("models of the recipe {name} cannot learn cars (airborne can)")));
    };
    Candidates::to_learn(trained, &[])?;
    match own.recipe.features.height {
        true => Ok(own),
        false => {
            Err(Error::ModelMismatch("cars are looked for by heights above the ground, which it does not use".into()))
        }
    }
}

impl Model {
    /// The same model with a classifier of cars beside it, learned from labelled clouds; what it says about other points
    /// stays. It replaces an earlier one, and the rule `classes.cars` is turned on if it was off. Of the model's recipe
    /// count `training.densities` and `training.exclude`. The clouds and their thinned copies are classified, which takes
    /// most of the time; 4 bytes a feature and labelled point are held that may be a car, of one cloud or copy at a time.
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
        let mut fitted = knows_cars(&self.fitted, &self.trained)?.clone();
        let lessons = CarLessons { recipe: &fitted.recipe, trained: &self.trained, training };
        let (cars, report) = lessons.learn(clouds, monitor)?;
        if fitted.recipe.classes.cars.points == 0 {
            fitted.recipe.classes.cars.points = CarParams::default().points;
        }
        let trained = Trained { cars: Some(cars), ..self.trained.clone() };
        Ok((Self { fitted: AnyFitted::AutoContext(Box::new(fitted)), trained }, report))
    }
}
