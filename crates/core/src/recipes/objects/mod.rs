//! Objects first, names second.
//!
//! M. Hasanpour Zaryabi, M. Saadatseresht, E. Ghanbari Parmehr, *An object-based classification framework for ALS point cloud
//! in urban areas*, ISPRS Annals X-4/W1, 2022 (document 002). `docs/objects.md` has the equations and where we deviate.
//!
//! | section | here |
//! |---|---|
//! | 3.1 to 3.3 supervoxels, local graphs, segments | [`ObjectsRecipe::segments`] |
//! | 3.4 features of segments | [`ObjectsRecipe::heights`] |
//! | 3.5 random forest, boosted trees, bagging | [`ObjectsRecipe::classifier`] |
//! | 4 share of the segments that is learned from | [`ObjectsRecipe::training`] |

mod describe;
mod learn;
mod name;
mod segments;
mod split;

pub use learn::{ObjectsReport, train_objects};
pub use segments::{ObjectSegments, SupervoxelMode};
pub use split::ObjectTraining;

pub(super) use name::classify_objects;

use super::regularise::RegulariseParams;
use crate::classification::{BaggingParams, BoostingParams, ClassifierKind, ClassifierParams, ForestParams};
use crate::cloud::names;
use crate::error::{Error, Result};
use crate::terrain::{ElevationParams, GroundParams};
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectsKind {
    /// Document 002.
    #[default]
    Objects,
}

/// What the height of a segment is measured from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Heights {
    /// The ground: mean and largest height above it stand for the document's mean z.
    #[default]
    AboveGround,
    /// The datum of the coordinates, as in the document: a model then only fits scenes at the same height.
    Datum,
}

/// The settings of the object-based recipe; every default is the paper's where it tells one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsRecipe {
    /// Always `objects`.
    pub recipe: ObjectsKind,
    /// Seed of everything that is drawn by chance.
    pub seed: u64,
    /// Metres in one unit of the coordinates; if absent what the cloud says, else 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
    /// What is learned: `rf`, `gbt` or `bagging`; each has its own section of settings.
    pub classifier: ClassifierKind,
    /// What the height of a segment is measured from.
    pub heights: Heights,
    /// Supervoxels and segments.
    pub segments: ObjectSegments,
    /// The ground's points, for heights above it.
    pub ground: GroundParams,
    /// The ground's height, from its points.
    pub elevation: ElevationParams,
    /// Which segments are learned from.
    pub training: ObjectTraining,
    /// The forest (`rf`).
    pub forest: ForestParams,
    /// Gradient-boosted trees (`gbt`).
    pub boosting: BoostingParams,
    /// Bagging.
    pub bagging: BaggingParams,
    /// How labels are made to agree afterwards; the paper leaves them as they are.
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
            regularise: RegulariseParams::default(),
        }
    }
}

impl ObjectsRecipe {
    /// Checks every part.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if let Some(m) = self.metres_per_unit.filter(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(Error::parameter("metres_per_unit", m, "metres, above 0"));
        }
        self.segments.validate()?;
        self.ground.validate()?;
        self.elevation.validate()?;
        self.training.validate()?;
        self.forest.validate()?;
        self.boosting.validate()?;
        self.bagging.validate()?;
        self.regularise.validate()
    }

    /// Columns of a cloud that the recipe reads, beside labels.
    pub fn columns(&self) -> Vec<String> {
        match self.segments.colour {
            Some(false) => Vec::new(),
            _ => names::COLOUR.iter().map(ToString::to_string).collect(),
        }
    }

    /// Settings of the classifier chosen.
    pub fn classifier(&self) -> ClassifierParams {
        self.classifier.choose(&self.forest, &self.boosting, &self.bagging).with_seed(self.seed)
    }
}
