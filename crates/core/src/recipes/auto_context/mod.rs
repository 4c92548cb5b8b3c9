//! The recipe of the built-in model: a forest on features of all kinds, then boosted trees that also see what the forest
//! says about the surroundings of a point (auto-context).
//!
//! Z. Tu, X. Bai, *Auto-context and its application to high-level vision tasks and 3D brain image segmentation*, IEEE
//! TPAMI 32(10), 2010, doi:10.1109/TPAMI.2009.186. `docs/airborne.md` says what is taken from where, and what each step
//! gains.

mod cars;
mod classify;
mod folds;
mod report;
mod train;

pub(in crate::recipes) use cars::CarLessons;
pub use cars::{CarReport, CarTraining};
pub use report::AutoContextReport;

use super::classify::rules::{CarParams, ClassRules, DeckParams, LevelParams, WaterParams, WireParams};
use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::{Regularise, RegulariseParams, automatic};
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::samples::TrainingParams;
use crate::classification::{BoostingParams, ForestParams};
use crate::error::{Error, Result};
use crate::features::{ContextParams, FeatureSet, ProfileParams, PyramidParams};
use crate::parallel::Monitor;
use crate::terrain::HeightParams;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML: the kind of scans that its defaults are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AutoContextKind {
    /// Scans from aircraft and UAV.
    #[default]
    Airborne,
    /// Scans of streets from vehicles, and terrestrial scans.
    Mobile,
    /// Scans of rooms.
    Indoor,
}

impl AutoContextKind {
    const ALL: [Self; 3] = [Self::Airborne, Self::Mobile, Self::Indoor];

    const fn name(self) -> &'static str {
        match self {
            Self::Airborne => "airborne",
            Self::Mobile => "mobile",
            Self::Indoor => "indoor",
        }
    }
}

/// The division of the training data that gives the second stage honest probabilities of the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FoldParams {
    /// Edge of the squares of a checkerboard, metres: the forest of one colour rates the squares of the other.
    pub square: f64,
    /// Share of the squares whose points are described without colour, intensity and returns, so that the model also
    /// suits clouds that do not have them; 0..=1.
    pub missing: f64,
}

impl Default for FoldParams {
    fn default() -> Self {
        Self { square: 30.0, missing: 0.25 }
    }
}

/// The parameters of the recipes `airborne` (the default), `mobile` and `indoor`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AutoContextRecipe {
    /// `airborne`, `mobile` or `indoor`: whose defaults these are.
    pub recipe: AutoContextKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// Whether the second stage uses the features of the pyramid too; without them it is faster.
    pub pyramid_twice: bool,
    /// Edge, metres, of the voxels in each of which the first stage rates one point, that in the middle; the others get
    /// its probabilities. The nearest level of the pyramid is taken. 0: every point is rated.
    #[serde(default = "every_point")]
    pub rated_voxel: f64,
    /// Features and their scales.
    pub features: FeatureSet,
    /// The ground, for heights above it.
    pub ground: HeightParams,
    /// Selection of the training points.
    pub training: TrainingParams,
    /// Folds of the first stage.
    pub folds: FoldParams,
    /// First stage: the forest; each half of the checkerboard trains half of its trees.
    pub forest: ForestParams,
    /// Surroundings whose classes the second stage sees.
    pub context: ContextParams,
    /// Second stage: gradient-boosted trees.
    pub boosting: BoostingParams,
    /// What the classes become in the end.
    pub classes: ClassRules,
    /// Regularisation of the labels; training chooses a method, which may be none.
    #[serde(deserialize_with = "automatic")]
    pub regularise: RegulariseParams,
}

/// The value of `rated_voxel` in models of programs that did not have it.
fn every_point() -> f64 {
    0.0
}

impl Default for AutoContextRecipe {
    fn default() -> Self {
        let pyramid = PyramidParams { first_scale: Some(0.25), levels: Some(8), ..PyramidParams::default() };
        let profile = ProfileParams { cells: vec![0.5, 1.0, 2.0, 4.0], ..ProfileParams::default() };
        let features =
            FeatureSet { returns: true, optional: true, height: true, pyramid, profile, ..FeatureSet::default() };
        Self {
            recipe: AutoContextKind::Airborne,
            seed: 0,
            pyramid_twice: false,
            rated_voxel: 0.5,
            features,
            ground: HeightParams::default(),
            training: TrainingParams {
                voxel: 0.25,
                per_copy: 4000,
                densities: vec![10.0, 4.0, 1.0],
                ..TrainingParams::default()
            },
            folds: FoldParams::default(),
            forest: ForestParams { max_depth: Some(18), min_samples_leaf: 8, ..ForestParams::default() },
            context: ContextParams::default(),
            boosting: BoostingParams::default(),
            classes: ClassRules {
                vegetation: vec![0.5, 1.5],
                lowest_building: 0.3,
                level: LevelParams::default(),
                decks: DeckParams::default(),
                water: WaterParams::default(),
                wires: WireParams::default(),
                cars: CarParams::default(),
                isolated: 5,
                ..ClassRules::default()
            },
            regularise: RegulariseParams::automatic(),
        }
    }
}

impl AutoContextRecipe {
    /// The defaults for streets: finer scales, and no profiles, which learn the few objects of a street by heart.
    pub fn mobile() -> Self {
        let pyramid = PyramidParams { first_scale: Some(0.1), levels: Some(8), ..PyramidParams::default() };
        Self {
            recipe: AutoContextKind::Mobile,
            pyramid_twice: true,
            rated_voxel: 0.2,
            features: FeatureSet { optional: true, height: true, pyramid, ..FeatureSet::default() },
            training: TrainingParams { voxel: 0.1, per_copy: 4000, ..TrainingParams::default() },
            folds: FoldParams { square: 15.0, ..FoldParams::default() },
            context: ContextParams {
                voxels: vec![0.25, 0.5, 1.0, 2.0],
                cells: vec![0.5, 1.0, 2.0, 4.0],
                stacks: vec![0.5, 1.0],
                bands: Vec::new(),
            },
            classes: ClassRules::default(),
            ..Self::default()
        }
    }

    /// The defaults for rooms.
    pub fn indoor() -> Self {
        let mobile = Self::mobile();
        let pyramid = PyramidParams { first_scale: Some(0.025), levels: Some(8), ..PyramidParams::default() };
        Self {
            recipe: AutoContextKind::Indoor,
            rated_voxel: 0.1,
            features: FeatureSet { pyramid, ..mobile.features },
            training: TrainingParams { voxel: 0.02, ..mobile.training },
            folds: FoldParams { square: 2.0, ..FoldParams::default() },
            ..mobile
        }
    }
}

impl System for AutoContextRecipe {
    const NAME: &'static str = AutoContextKind::Airborne.name();
    const PRESETS: &'static [&'static str] = &[AutoContextKind::Mobile.name(), AutoContextKind::Indoor.name()];
    type Learned = Nothing;
    type Report = AutoContextReport;

    fn named(name: &str) -> Option<Self> {
        AutoContextKind::ALL.into_iter().find(|kind| kind.name() == name).map(|kind| match kind {
            AutoContextKind::Airborne => Self::default(),
            AutoContextKind::Mobile => Self::mobile(),
            AutoContextKind::Indoor => Self::indoor(),
        })
    }

    fn name(&self) -> &'static str {
        self.recipe.name()
    }

    fn validate(&self) -> Result<()> {
        self.features.validate()?;
        self.ground.validate()?;
        self.training.validate()?;
        self.forest.validate()?;
        self.context.validate()?;
        self.boosting.validate()?;
        self.classes.validate()?;
        self.regularise.validate()?;
        let FoldParams { square, missing } = self.folds;
        if !(square > 0.0 && square.is_finite()) {
            return Err(Error::parameter("folds.square", square, "metres, above 0"));
        }
        if !(0.0..=1.0).contains(&missing) {
            return Err(Error::parameter("folds.missing", missing, "a share, 0 to 1"));
        }
        if !(self.rated_voxel >= 0.0 && self.rated_voxel.is_finite()) {
            return Err(Error::parameter("rated_voxel", self.rated_voxel, "metres, 0 or more"));
        }
        match self.forest.trees {
            1 => {
                Err(Error::parameter("forest.trees", 1, "2 or more: each half of the checkerboard trains half of them"))
            }
            _ => Ok(()),
        }
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

    fn rules(&self) -> ClassRules {
        self.classes.clone()
    }

    fn columns(&self) -> Vec<String> {
        [self.features.columns(), self.training.columns()].concat()
    }

    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 74 } else { 228 }
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
