//! The recipe `contours`: points that are likely to lie on an edge of an object, linked to lines.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, doctoral thesis, ETH Zurich 2018,
//! doi:10.3929/ethz-b-000264691, section 4.5; T. Hackel, J. D. Wegner, K. Schindler, *Contour detection in unstructured 3D
//! point clouds*, CVPR 2016. `docs/contours.md` has the equations and our deviations.
//!
//! All lengths of the thesis belong to voxels of 0.1 m. A cloud is scaled such that its own voxel has this edge, so that
//! one model serves scans of any spacing.

mod baseline;
mod classes;
mod drawing;
mod extract;
mod likely;
mod points;
mod report;
mod scaled;
mod stages;
mod synthetic;
mod train;

pub use baseline::{Baseline, BaselineParams, baseline_contours};
pub use extract::{ContourLine, Contours};
pub use report::ContoursReport;
pub(in crate::recipes) use stages::{ContourModel, stages_of};
pub use stages::{ContourParams, ContourStages};
pub use synthetic::{SceneScores, edge_labels, labelled_scene, labelled_scenes, measure_scene};

use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::{Regularise, RegulariseParams};
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::samples::TrainingParams;
use crate::classification::{BoostingParams, ForestParams};
use crate::contours::{CandidateParams, MatchParams, TangentParams, TraceParams};
use crate::error::{Error, Result};
use crate::features::{ContextParams, FeatureSet, PyramidParams};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContoursKind {
    /// Hackel 2018, section 4.5.
    #[default]
    Contours,
}

/// Which candidates the classifier of candidates learns from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CandidateTraining {
    /// Least share of the length of a path along a contour (without lines, of its points on one) that makes it an example of
    /// one, 0 to 1.
    pub on: f64,
    /// Share below which it is an example of none, 0 to `on`; candidates between are not learned from.
    pub off: f64,
    /// Largest share along unsure lines (without lines, of points without a label) of an example of none, 0 to 1.
    pub unsure: f64,
    /// Examples in all, at most; drawn at random, both kinds in the proportion in which they occur.
    pub most: usize,
    /// When a path runs along a line.
    pub along: MatchParams,
}

impl Default for CandidateTraining {
    fn default() -> Self {
        Self { on: 0.9, off: 0.6, unsure: 0.2, most: 60_000, along: MatchParams::default() }
    }
}

impl CandidateTraining {
    fn validate(&self) -> Result<()> {
        let Self { on, off, unsure, most, .. } = *self;
        if !(0.0..=1.0).contains(&on) || !(0.0..=on).contains(&off) {
            return Err(Error::parameter("examples", format!("on {on}, off {off}"), "0 <= off <= on <= 1"));
        }
        if !(0.0..=1.0).contains(&unsure) {
            return Err(Error::parameter("examples.unsure", unsure, "0 to 1"));
        }
        if most < 2 {
            return Err(Error::parameter("examples.most", most, "2 or more"));
        }
        self.along.validate()
    }
}

/// The parameters of the recipe. Lengths other than `voxel` are those for voxels of 0.1 m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContoursRecipe {
    /// Always `contours`.
    pub recipe: ContoursKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// Edge of the voxels that hold one seed each, metres; `None` (`"none"` in a recipe): `spacings` times the spacing of
    /// the points of each cloud, 0.02 to 5.
    #[serde(with = "crate::settings::optional")]
    pub voxel: Option<f64>,
    /// Spacings of the points that make the edge of a voxel, above 0.
    pub spacings: f64,
    /// The spacing is that which the points do not exceed on this share of the scanned area, 0 to 1. Higher: voxels that
    /// suit the sparser parts of a cloud.
    pub area: f64,
    /// Distance from a line that is learned from up to which a point lies on it, in voxels, above 0.
    pub near: f64,
    /// Distance beyond which a point lies on none, in voxels, `near` or more; points between are not learned from.
    pub far: f64,
    /// Code of points on contours in labels to learn from; all other labelled points lie on none.
    pub code: u8,
    /// Features and their scales.
    pub features: FeatureSet,
    /// Selection of the training points.
    pub training: TrainingParams,
    /// The forest that rates points first; each half of the clouds teaches half of its trees.
    pub forest: ForestParams,
    /// The surroundings of which the second classifier of points sees how likely the forest finds them.
    pub context: ContextParams,
    /// Points that the forest finds less likely than this keep its likelihood, 0..1; the others are rated again.
    pub least_rated: f64,
    /// The boosted trees that rate points again, with the surroundings.
    pub boosting: BoostingParams,
    /// Directions of contours at rated points, if these are not moved to the edge (`candidates.ridge.passes = 0`).
    pub tangents: TangentParams,
    /// From rated points to candidates.
    pub candidates: CandidateParams,
    /// Selection of the training candidates.
    pub examples: CandidateTraining,
    /// The forest that rates candidates.
    pub candidate_forest: ForestParams,
    /// From rated candidates to lines.
    pub trace: TraceParams,
    /// Regularisation of the labels of points; lines do not depend on it.
    pub regularise: RegulariseParams,
}

impl Default for ContoursRecipe {
    fn default() -> Self {
        let pyramid = PyramidParams { first_scale: Some(0.05), ..PyramidParams::default() };
        Self {
            recipe: ContoursKind::default(),
            seed: 0,
            voxel: None,
            spacings: 2.0,
            area: 0.4,
            near: 0.5,
            far: 0.6,
            code: 1,
            features: FeatureSet { pyramid, ..FeatureSet::default() },
            training: TrainingParams { max_samples: 200_000, ..TrainingParams::default() },
            forest: ForestParams { trees: 50, ..ForestParams::default() },
            context: ContextParams {
                voxels: vec![0.04, 0.08, 0.16, 0.32],
                cells: Vec::new(),
                stacks: Vec::new(),
                bands: vec![0.04, 0.08, 0.16, 0.32],
            },
            least_rated: 0.02,
            boosting: BoostingParams::default(),
            tangents: TangentParams::default(),
            candidates: CandidateParams::default(),
            examples: CandidateTraining::default(),
            candidate_forest: ForestParams { trees: 50, max_depth: Some(12), ..ForestParams::default() },
            trace: TraceParams::default(),
            regularise: RegulariseParams::default(),
        }
    }
}

impl ContoursRecipe {
    /// Checks the settings of the voxels.
    fn check_voxel(&self) -> Result<()> {
        if let Some(voxel) = self.voxel.filter(|voxel| !(1e-3..=1e3).contains(voxel)) {
            return Err(Error::parameter("voxel", voxel, "0.001 to 1000 metres"));
        }
        if !(self.spacings.is_finite() && self.spacings > 0.0) {
            return Err(Error::parameter("spacings", self.spacings, "a finite number above 0"));
        }
        if !(0.0..=1.0).contains(&self.area) {
            return Err(Error::parameter("area", self.area, "0 to 1"));
        }
        if !(self.near.is_finite() && self.near > 0.0) {
            return Err(Error::parameter("near", self.near, "a finite number of voxels above 0"));
        }
        match self.far.is_finite() && self.far >= self.near {
            true => Ok(()),
            false => Err(Error::parameter("far", self.far, "a finite number of voxels, near or more")),
        }
    }
}

impl System for ContoursRecipe {
    const NAME: &'static str = "contours";
    const TRAINING_ONLY: &'static [&'static str] = &[
        "training",
        "forest",
        "context",
        "boosting",
        "examples",
        "candidate_forest",
        "features",
        "code",
        "near",
        "far",
    ];
    type Learned = Nothing;
    type Report = ContoursReport;

    fn validate(&self) -> Result<()> {
        self.check_voxel()?;
        self.examples.validate()?;
        self.features.validate()?;
        self.training.validate()?;
        self.forest.validate()?;
        self.context.validate()?;
        if !(0.0..1.0).contains(&self.least_rated) {
            return Err(Error::parameter("least_rated", self.least_rated, "0 to below 1"));
        }
        self.boosting.validate()?;
        self.tangents.validate()?;
        self.candidates.validate()?;
        self.candidate_forest.validate()?;
        self.trace.validate()?;
        self.regularise.not_automatic(Self::NAME)?;
        self.regularise.validate()
    }

    fn shared(&self) -> SharedSettings<'_> {
        SharedSettings {
            seed: self.seed,
            regularise: &self.regularise,
            metres_per_unit: self.features.metres_per_unit,
            densities: &[],
        }
    }

    fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    fn columns(&self) -> Vec<String> {
        [self.features.columns(), self.training.columns()].concat()
    }

    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 80 } else { 200 }
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
        likely::classify(&fitted.recipe, job, monitor)
    }
}
