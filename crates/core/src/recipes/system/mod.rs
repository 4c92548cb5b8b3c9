//! The interface of a published method: its recipe (the settings), training and classification.
//!
//! A new method needs a folder with a recipe that implements [`System`], one line in the list of `model/any.rs` and a page
//! in `docs/`. Models, command line and Python know methods only through this trait.

#[cfg(test)]
pub(in crate::recipes) mod height;
pub(in crate::recipes) mod report;
pub(in crate::recipes) mod settings;

use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::rules::ClassRules;
use crate::recipes::classify::statistics::CloudStatistics;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::labels::LabelledCloud;
use crate::recipes::regularise::{Regularise, RegulariseParams};
use crate::recipes::system::report::Report;
use crate::recipes::trained::Trained;
use crate::terrain::ElevationModel;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use std::path::PathBuf;

/// A published method. The value is its recipe: the settings, which training does not change.
pub trait System: Clone + Debug + Default + PartialEq + Serialize + DeserializeOwned {
    /// The name of the recipe, in its TOML and on the command line.
    const NAME: &'static str;

    /// Names of further recipes of the method: the same settings with other defaults, for other kinds of scans.
    const PRESETS: &'static [&'static str] = &[];

    /// Whether an elevation model of the terrain can be given to it.
    const TAKES_ELEVATION: bool = false;

    /// Whether training can try maximum depths of the trees, and cross-validate.
    const TRIES_DEPTHS: bool = false;

    /// Whether training can try strengths of the random field.
    const TRIES_STRENGTHS: bool = false;

    /// Whether training can go on from a file.
    const KEEPS_CHECKPOINTS: bool = false;

    /// Keys of the recipe, or their beginnings, that only training reads: changes of a trained model's are refused.
    const TRAINING_ONLY: &'static [&'static str] =
        &["training", "classifier", "forest", "boosting", "bagging", "linear"];

    /// What training learns besides the classifier; [`Nothing`] if nothing.
    type Learned: Clone + Debug + PartialEq + Serialize + DeserializeOwned;

    /// What training reports.
    type Report: Report + 'static;

    /// The recipe with this name, one of [`System::NAME`] and [`System::PRESETS`], with all defaults.
    fn named(name: &str) -> Option<Self> {
        (name == Self::NAME).then(Self::default)
    }

    /// The name of this recipe.
    fn name(&self) -> &'static str {
        Self::NAME
    }

    /// Checks all parts.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    fn validate(&self) -> Result<()>;

    /// The settings that every method has.
    fn shared(&self) -> SharedSettings<'_>;

    /// The same recipe with another seed.
    fn with_seed(self, seed: u64) -> Self;

    /// Seed of all random draws.
    fn seed(&self) -> u64 {
        self.shared().seed
    }

    /// Regularisation of the labels.
    fn regularise(&self) -> &RegulariseParams {
        self.shared().regularise
    }

    /// What the classes of its models become in the end.
    fn rules(&self) -> ClassRules {
        ClassRules::default()
    }

    /// Metres per unit of the coordinates that the recipe prescribes; `None`: what each cloud says, else 1.
    fn metres_per_unit(&self) -> Option<f64> {
        self.shared().metres_per_unit
    }

    /// Columns of a cloud that it reads, besides labels.
    fn columns(&self) -> Vec<String>;

    /// Least number of bytes a point that classification needs.
    fn bytes_a_point(&self, _method: Regularise) -> u64 {
        200
    }

    /// Lowest density, points per square metre, of the thinned copies used in training; infinite if there are none.
    fn lowest_density(&self) -> f64 {
        self.shared().densities.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Largest distance, metres, between a label picked by hand and the nearest point.
    fn label_distance(&self) -> f64 {
        0.5
    }

    /// The method's own part of [`System::train`], with options that it takes.
    ///
    /// # Errors
    /// As [`System::train`].
    fn learn(
        &self,
        clouds: &[LabelledCloud],
        options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>>;

    /// Trains a model on labelled clouds. Choices that the recipe leaves open (the finest voxel, the use of colours) or
    /// that `options` ask for (depth, strength) are made here and written into the model's recipe.
    ///
    /// # Errors
    /// If fewer than two classes are labelled, a parameter is out of range, an option is not one of this method, a column
    /// is absent, or the work was cancelled.
    fn train(
        &self,
        clouds: &[LabelledCloud],
        options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>> {
        self.check_options(options)?;
        self.learn(clouds, options, monitor)
    }

    /// Checks that an elevation model, if one is given, is of use to the method.
    ///
    /// # Errors
    /// If it is not.
    fn check_elevation(&self, given: bool) -> Result<()> {
        match given && !Self::TAKES_ELEVATION {
            true => {
                let expected = format!("none: the recipe {} does not use it", self.name());
                Err(Error::parameter("elevation model", "one", expected))
            }
            false => Ok(()),
        }
    }

    /// Checks that the method takes all options of a training.
    ///
    /// # Errors
    /// Names the first option that it has no use for.
    fn check_options(&self, options: &TrainOptions) -> Result<()> {
        let refused = |name, found: String, text: &str| {
            Err(Error::parameter(name, found, format!("none: the recipe {} {text}", self.name())))
        };
        self.check_elevation(options.elevation.is_some())?;
        if let (Some(first), false) = (options.strengths.first(), Self::TRIES_STRENGTHS) {
            return refused("strengths", first.to_string(), "does not try any");
        }
        if let (Some(first), false) = (options.depths.first(), Self::TRIES_DEPTHS) {
            return refused("depths", first.to_string(), "does not try any");
        }
        if let (Some(folds), false, true) = (options.folds, Self::TRIES_DEPTHS, options.strengths.is_empty()) {
            return refused("folds", folds.to_string(), "has no cross-validation of its own");
        }
        if options.checkpoint.is_some() && !Self::KEEPS_CHECKPOINTS {
            return refused("checkpoint", "one".into(), "writes none");
        }
        Ok(())
    }

    /// What classification of a part needs to know of the whole cloud: the first pass over it.
    ///
    /// # Errors
    /// As [`System::classify`].
    fn statistics(_fitted: &Fitted<Self>, _job: &Job<'_>, _monitor: &Monitor) -> Result<CloudStatistics> {
        Ok(CloudStatistics::default())
    }

    /// Classifies all points of a cloud.
    ///
    /// # Errors
    /// If the model needs something that this version or this cloud does not have, or the work was cancelled.
    fn classify(fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified>;
}

/// The settings that every method has.
#[derive(Clone, Copy, Debug)]
pub struct SharedSettings<'a> {
    /// Seed of all random draws.
    pub seed: u64,
    /// Regularisation of the labels.
    pub regularise: &'a RegulariseParams,
    /// Metres per unit of the coordinates that the recipe prescribes.
    pub metres_per_unit: Option<f64>,
    /// Densities of the thinned copies used in training, points per square metre.
    pub densities: &'a [f64],
}

/// A recipe after training: all automatic choices are replaced by their values; what was learned is stored separately.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted<S: System> {
    /// The settings in use.
    pub recipe: S,
    /// What training has learned besides the classifier.
    pub learned: S::Learned,
}

/// What training returns.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingResult<S: System> {
    /// The recipe with its choices made, and what only this method learns.
    pub fitted: Fitted<S>,
    /// Classes, features and classifiers.
    pub trained: Trained,
    /// What there is to say about it.
    pub report: S::Report,
}

/// For methods that learn only a classifier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}

/// Choices to make by cross-validation, and data beside the clouds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainOptions {
    /// Number of folds of the cross-validation; `None` is 5, and only if there is something to choose.
    pub folds: Option<usize>,
    /// Edge of the squares that the folds consist of, metres; `None`: 50, halved until there are two squares a fold.
    pub block: Option<f64>,
    /// Maximum depths of the trees to try (pyramid); the best is used.
    pub depths: Vec<usize>,
    /// Strengths of the random field to try (weak); the best is used.
    pub strengths: Vec<f64>,
    /// Ground heights, in the unit of the clouds, to use instead of those of the road points (weak).
    pub elevation: Option<ElevationModel>,
    /// File that training writes from time to time and goes on from if it exists, to the same model (unet, windows).
    pub checkpoint: Option<PathBuf>,
}

impl TrainOptions {
    /// Number of folds.
    pub fn folds(&self) -> usize {
        self.folds.unwrap_or(5)
    }

    /// Whether accuracy is to be estimated by cross-validation, or a depth to be chosen by it.
    pub fn cross_validates(&self) -> bool {
        self.folds.is_some() || !self.depths.is_empty()
    }
}
