//! Object-based classification: segments first, then a class for each segment.
//!
//! E. Hasanpour Zaryabi, M. Saadatseresht, E. Ghanbari Parmehr, *An object-based classification framework for ALS point
//! cloud in urban areas*, ISPRS Annals X-4/W1, 2022. `docs/objects.md` has the equations and our deviations.
//!
//! | section | here |
//! |---|---|
//! | 3.1 to 3.5 supervoxels, local graphs, segments | [`ObjectsRecipe::segments`] |
//! | Table 3 features of segments | [`ObjectsRecipe::heights`] |
//! | 3.6 random forest, boosted trees, bagging | [`ObjectsRecipe::classifier`] |
//! | 4 share of the segments used for training | [`ObjectsRecipe::training`] |

mod classify;
mod describe;
mod report;
mod segments;
mod split;
mod train;

pub use report::ObjectsReport;
pub use segments::{ObjectSegments, SupervoxelMode};
pub use split::ObjectTraining;

use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::RegulariseParams;
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::classifiers::offers_classifiers;
use crate::classification::{BaggingParams, BoostingParams, ClassifierKind, ForestParams, LinearParams};
use crate::cloud::names;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::terrain::{ElevationParams, GroundParams};
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectsKind {
    /// Hasanpour Zaryabi et al. 2022.
    #[default]
    Objects,
}

/// The reference of the heights of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Heights {
    /// The ground: mean and largest height above it, instead of the paper's mean z.
    #[default]
    AboveGround,
    /// The datum of the coordinates, as in the paper: a model then only fits scenes at the same elevation.
    Datum,
}

/// The parameters of the object-based recipe; `docs/objects.md` says which defaults are the paper's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsRecipe {
    /// Always `objects`.
    pub recipe: ObjectsKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// Metres per unit of the coordinates; `None` (`"none"` in a recipe): what the cloud says, else 1.
    #[serde(with = "crate::settings::optional")]
    pub metres_per_unit: Option<f64>,
    /// The classifier: `rf`, `gbt` or `bagging`; each has its own section of parameters.
    pub classifier: ClassifierKind,
    /// The reference of the heights of a segment.
    pub heights: Heights,
    /// Supervoxels and segments.
    pub segments: ObjectSegments,
    /// The ground filter, for heights above ground.
    pub ground: GroundParams,
    /// The elevation model made from the ground points.
    pub elevation: ElevationParams,
    /// The segments used for training.
    pub training: ObjectTraining,
    /// The forest (`rf`).
    pub forest: ForestParams,
    /// Gradient-boosted trees (`gbt`).
    pub boosting: BoostingParams,
    /// Bagging.
    pub bagging: BaggingParams,
    /// Multinomial logistic regression (`linear`).
    pub linear: LinearParams,
    /// Regularisation of the labels afterwards; the paper has none.
    pub regularise: RegulariseParams,
}

impl Default for ObjectsRecipe {
    fn default() -> Self {
        Self {
            recipe: ObjectsKind::Objects,
            seed: 0,
            metres_per_unit: None,
            classifier: ClassifierKind::Forest,
            heights: Heights::default(),
            segments: ObjectSegments::default(),
            ground: GroundParams::default(),
            elevation: ElevationParams::default(),
            training: ObjectTraining::default(),
            forest: ForestParams::breiman(),
            boosting: BoostingParams::default(),
            bagging: BaggingParams::default(),
            linear: LinearParams::default(),
            regularise: RegulariseParams::default(),
        }
    }
}

offers_classifiers!(ObjectsRecipe);

impl System for ObjectsRecipe {
    const NAME: &'static str = "objects";
    type Learned = Nothing;
    type Report = ObjectsReport;

    fn validate(&self) -> Result<()> {
        if let Some(m) = self.metres_per_unit.filter(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(Error::parameter("metres_per_unit", m, "metres, above 0"));
        }
        self.segments.validate()?;
        self.ground.validate()?;
        self.elevation.validate()?;
        self.training.validate()?;
        self.validate_classifiers()?;
        self.regularise.not_automatic(Self::NAME)?;
        self.regularise.validate()
    }

    fn shared(&self) -> SharedSettings<'_> {
        SharedSettings {
            seed: self.seed,
            regularise: &self.regularise,
            metres_per_unit: self.metres_per_unit,
            densities: &[],
        }
    }

    fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    fn columns(&self) -> Vec<String> {
        match self.segments.colour {
            Some(false) => Vec::new(),
            _ => names::COLOUR.iter().map(ToString::to_string).collect(),
        }
    }

    fn learn(
        &self,
        clouds: &[LabelledCloud],
        _options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>> {
        train::train(self, clouds, monitor)
    }

    fn classify(fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
        classify::classify(&fitted.recipe, job, monitor)
    }
}
