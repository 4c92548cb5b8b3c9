//! The pyramid recipe: multi-scale features of every point and a random forest (or another classifier).
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, doctoral thesis, ETH Zurich 2018,
//! doi:10.3929/ethz-b-000264691, chapter 4.4. `docs/pyramid.md` has the equations and our deviations.

mod classify;
mod described;
mod report;
mod select;
mod train;

pub use report::{DepthScore, PyramidReport};

use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::{Regularise, RegulariseParams, automatic};
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::classifiers::offers_classifiers;
use super::training::samples::TrainingParams;
use crate::classification::{BaggingParams, BoostingParams, ClassifierKind, ForestParams, LinearParams};
use crate::error::Result;
use crate::features::{FeatureSet, PyramidParams};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PyramidKind {
    /// Hackel 2018, chapter 4.4.
    #[default]
    Pyramid,
}

/// The parameters of the pyramid recipe (Hackel 2018, chapter 4.4); the defaults are the thesis's, except
/// for rare classes and the finest scale, which is the point spacing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PyramidRecipe {
    /// Always `pyramid`.
    pub recipe: PyramidKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// The classifier: `rf` (the paper's), `gbt` or `bagging`; each has its own section of parameters.
    pub classifier: ClassifierKind,
    /// Features and their scales.
    pub features: FeatureSet,
    /// Selection of the training points.
    pub training: TrainingParams,
    /// The forest (`rf`).
    pub forest: ForestParams,
    /// Gradient-boosted trees (`gbt`).
    pub boosting: BoostingParams,
    /// Bagging.
    pub bagging: BaggingParams,
    /// Multinomial logistic regression (`linear`).
    pub linear: LinearParams,
    /// Regularisation of the labels. Hackel 2018 has none; training chooses a method, which may be none.
    #[serde(deserialize_with = "automatic")]
    pub regularise: RegulariseParams,
}

impl Default for PyramidRecipe {
    fn default() -> Self {
        let pyramid = PyramidParams::default();
        Self {
            recipe: PyramidKind::default(),
            seed: 0,
            classifier: ClassifierKind::default(),
            features: FeatureSet { pyramid: PyramidParams { first_scale: None, ..pyramid }, ..FeatureSet::default() },
            training: TrainingParams::default(),
            forest: ForestParams::default(),
            boosting: BoostingParams::default(),
            bagging: BaggingParams::default(),
            linear: LinearParams::default(),
            regularise: RegulariseParams::automatic(),
        }
    }
}

offers_classifiers!(PyramidRecipe);

impl System for PyramidRecipe {
    const NAME: &'static str = "pyramid";
    const TRIES_DEPTHS: bool = true;
    type Learned = Nothing;
    type Report = PyramidReport;

    fn validate(&self) -> Result<()> {
        self.features.validate()?;
        self.training.validate()?;
        self.validate_classifiers()?;
        self.regularise.validate()
    }

    fn shared(&self) -> SharedSettings<'_> {
        SharedSettings {
            seed: self.seed,
            regularise: &self.regularise,
            metres_per_unit: self.features.metres_per_unit,
            densities: &self.training.densities,
        }
    }

    fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    fn columns(&self) -> Vec<String> {
        [self.features.columns(), self.training.columns()].concat()
    }

    /// Without regularisation, features and probabilities are discarded block by block.
    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 45 } else { 200 }
    }

    fn learn(
        &self,
        clouds: &[LabelledCloud],
        options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>> {
        train::train(self, clouds, options, monitor)
    }

    fn classify(fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
        classify::classify(&fitted.recipe, job, monitor)
    }
}
