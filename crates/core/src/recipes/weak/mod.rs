//! Weakly supervised classification: from a few labelled points to a label for every point.
//!
//! S. Guinard, L. Landrieu, *Weakly supervised segmentation-aided classification of urban scenes from 3D LiDAR point
//! clouds*, ISPRS Archives XLII-1/W1, 2017, doi:10.5194/isprs-archives-XLII-1-W1-151-2017. `docs/weak.md` has the
//! equations and our deviations.
//!
//! | section | here |
//! |---|---|
//! | 2.1 local descriptors | [`WeakRecipe::neighbourhood`] |
//! | 2.2 road, elevation, position | [`WeakRecipe::road`] |
//! | 2.3, 3 adjacency, segmentation | [`WeakRecipe::regularise`], `neighbours`, `partition` |
//! | beyond the paper: multi-scale features | [`WeakRecipe::descriptors`], [`WeakRecipe::features`] |
//! | 4, 5.1 weakly supervised classifier, its labels | [`WeakRecipe::labels`], [`WeakRecipe::forest`] |
//! | beyond the paper: class shares | [`WeakRecipe::shares`] |
//! | beyond the paper: labels as constraints | [`WeakLabels::hold`] |
//! | 4 probabilities of segments, field | [`WeakRecipe::regularise`] |

mod classify;
mod describe;
mod examples;
mod hold;
mod learned;
mod report;
mod road;
mod shares;
mod train;

pub use crate::terrain::RoadExample;
pub use examples::{Example, WeakLabels};
pub use learned::{LabelledPosition, WeakLearned};
pub use report::{StrengthScore, WeakReport};
pub use road::{RoadParams, RoadSource};
pub use shares::ClassShares;

use super::classify::statistics::CloudStatistics;
use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::{Regularise, RegulariseParams};
use super::system::{Fitted, SharedSettings, System, TrainOptions, TrainingResult};
use crate::classification::ForestParams;
use crate::cloud::names;
use crate::error::Result;
use crate::features::{FeatureSet, PyramidParams};
use crate::neighbours::OptimalParams;
use crate::parallel::Monitor;
use crate::segmentation::PartitionParams;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WeakKind {
    /// Guinard & Landrieu 2017.
    #[default]
    Weak,
}

/// The features of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Descriptors {
    /// The six descriptors of the paper.
    Paper,
    /// The six descriptors and multi-scale features ([`WeakRecipe::features`]): much more accurate with few labels.
    #[default]
    MultiScale,
}

/// The parameters of the weakly supervised recipe: the paper's, and four additions that can be turned off
/// (`docs/weak.md`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeakRecipe {
    /// Always `weak`.
    pub recipe: WeakKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// The features of a point.
    pub descriptors: Descriptors,
    /// Multi-scale features (Hackel 2018, chapter 4.4); the finest scale is that of the first cloud's point spacing.
    pub features: FeatureSet,
    /// Optimal neighbourhoods of the local descriptors.
    pub neighbourhood: OptimalParams,
    /// The road, and the descriptors that depend on it.
    pub road: RoadParams,
    /// Selection and use of the labels.
    pub labels: WeakLabels,
    /// The forest.
    pub forest: ForestParams,
    /// Adaptation of the probabilities to the class shares of the cloud.
    pub shares: ClassShares,
    /// Segments, and regularisation of the labels.
    pub regularise: RegulariseParams,
}

impl Default for WeakRecipe {
    fn default() -> Self {
        // The scans of the paper differ in density, so that no finest scale suits all.
        let pyramid = PyramidParams { first_scale: None, levels: Some(9), ..PyramidParams::default() };
        Self {
            recipe: WeakKind::Weak,
            seed: 0,
            descriptors: Descriptors::default(),
            features: FeatureSet { pyramid, ..FeatureSet::default() },
            neighbourhood: OptimalParams::default(),
            road: RoadParams::default(),
            labels: WeakLabels::default(),
            forest: ForestParams::breiman(),
            shares: ClassShares::default(),
            regularise: RegulariseParams {
                method: Regularise::SegmentCrf,
                near: f64::INFINITY,
                partition: PartitionParams::default(),
                ..RegulariseParams::default()
            },
        }
    }
}

impl System for WeakRecipe {
    const NAME: &'static str = "weak";
    const TAKES_ELEVATION: bool = true;
    const TRIES_STRENGTHS: bool = true;
    /// The forest finds the road of every cloud.
    const TRAINING_ONLY: &'static [&'static str] = &[
        "labels.per_class",
        "labels.most",
        "labels.within",
        "labels.fit_partition",
        "labels.fit_accuracy",
        "labels.fit_trials",
        "labels.fit_step",
    ];
    type Learned = WeakLearned;
    type Report = WeakReport;

    fn validate(&self) -> Result<()> {
        self.features.validate()?;
        self.neighbourhood.validate()?;
        self.road.validate()?;
        self.labels.validate()?;
        self.forest.validate()?;
        self.shares.validate()?;
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
        let own = self.road.source == RoadSource::Classification;
        let scaled = match self.descriptors {
            Descriptors::Paper => Vec::new(),
            Descriptors::MultiScale => self.features.columns(),
        };
        own.then(|| names::CLASSIFICATION.to_string()).into_iter().chain(scaled).collect()
    }

    fn label_distance(&self) -> f64 {
        self.labels.within
    }

    fn learn(
        &self,
        clouds: &[LabelledCloud],
        options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>> {
        train::train(self, clouds, options, monitor)
    }

    fn statistics(fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<CloudStatistics> {
        classify::statistics(fitted, job, monitor)
    }

    fn classify(fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
        classify::classify(fitted, job, monitor)
    }
}
