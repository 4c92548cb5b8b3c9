//! The recipe `unet`: a sparse convolutional network that learns its own features of cells and their surroundings.
//!
//! A U-Net of sub-manifold sparse convolutions ([`crate::nn`]); `docs/unet.md` describes it. Sparse convolutional networks
//! for point clouds: chapter 6 of T. Hackel, *Large-scale machine learning for point cloud processing*, ETH Zurich 2018,
//! and Graham et al. 2018, doi:10.1109/CVPR.2018.00961.

mod cells;
mod classify;
mod crop;
mod inputs;
mod scenes;
mod train;

pub use crop::Augmentation;
pub use inputs::UNetInputs;

use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::{Regularise, RegulariseParams};
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::networks::NetworkReport;
use super::training::samples::TrainingParams;
use crate::error::{Error, Result};
use crate::nn::networks::UNetParams;
use crate::nn::training::{Optimiser, Schedule};
use crate::parallel::Monitor;
use crate::terrain::HeightParams;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UNetKind {
    /// The only one.
    #[default]
    #[serde(rename = "unet")]
    UNet,
}

/// Parts, or views of parts, that a step can take.
const MOST_SAMPLES: usize = 4096;

/// How the network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearningParams {
    /// Number of steps, 1 or more.
    pub steps: usize,
    /// Parts of clouds in a step, 1 to 4096; with two views of each at most 2048.
    pub parts: usize,
    /// Radius of a part, in cells, 8 to 1024: a vertical cylinder around a labelled point.
    pub radius: f64,
    /// Highest learning rate, above 0.
    pub rate: f64,
    /// How the rate changes: `cosine`, `linear` or `constant`.
    pub schedule: Schedule,
    /// Weight of a class: its share of the samples to the power of minus this; 0: all the same, 1: rare classes count as
    /// much as frequent ones.
    pub balance: f64,
    /// Weight of the loss that asks two views of a part, changed differently, for the same probabilities, 0 or more: points
    /// without a label are learned from too. It rises over the first third of the steps. 0: one view of each part. `None`
    /// (`"none"` in a recipe): training chooses, 10 if fewer than one point in a hundred has a label, otherwise 0.
    #[serde(with = "crate::settings::optional")]
    pub consistency: Option<f64>,
    /// The optimiser.
    pub optimiser: Optimiser,
}

impl Default for LearningParams {
    fn default() -> Self {
        Self {
            steps: 600,
            parts: 4,
            radius: 64.0,
            rate: 0.01,
            schedule: Schedule::default(),
            balance: 0.5,
            consistency: None,
            optimiser: Optimiser::default(),
        }
    }
}

impl LearningParams {
    fn validate(&self) -> Result<()> {
        let check = |name: &'static str, value: f64, fine: bool, expected: &str| match fine {
            true => Ok(()),
            false => Err(Error::parameter(name, value, expected)),
        };
        check("learning.steps", self.steps as f64, self.steps > 0, "1 or more")?;
        check("learning.parts", self.parts as f64, (1..=MOST_SAMPLES).contains(&self.parts), "1 to 4096")?;
        check("learning.radius", self.radius, (8.0..=1024.0).contains(&self.radius), "8 to 1024 cells")?;
        check("learning.rate", self.rate, self.rate > 0.0 && self.rate.is_finite(), "above 0")?;
        check("learning.balance", self.balance, (0.0..=1.0).contains(&self.balance), "0 to 1")?;
        let consistency = self.consistency.unwrap_or(0.0);
        check("learning.consistency", consistency, (0.0..=1e6).contains(&consistency), "0 to 1,000,000")?;
        let fits = consistency == 0.0 || self.parts <= MOST_SAMPLES / 2;
        check("learning.parts", self.parts as f64, fits, "at most 2048 with two views of each part")?;
        self.optimiser.validate()
    }
}

/// The parameters of the recipe `unet`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UNetRecipe {
    /// Always `unet`.
    pub recipe: UNetKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// Edge of a cell, metres; `None` (`"none"` in a recipe): twice the point spacing of the first cloud.
    #[serde(with = "crate::settings::optional")]
    pub voxel: Option<f64>,
    /// The network.
    pub network: UNetParams,
    /// Its input channels besides the places of points.
    pub inputs: UNetInputs,
    /// The ground, for heights above it.
    pub ground: HeightParams,
    /// Points less than this above it, metres, are no building (6), but ground (2), unless a wall stands on them: no building
    /// is as low. 0: not so. Only for models with these ASPRS classes and the input `height`.
    pub lowest_building: f64,
    /// How it is trained.
    pub learning: LearningParams,
    /// How parts are changed before they are learned from.
    pub augment: Augmentation,
    /// Classes that are learned, thinned copies, and the points around which parts lie.
    pub training: TrainingParams,
    /// Regularisation of the labels.
    pub regularise: RegulariseParams,
}

impl Default for UNetRecipe {
    fn default() -> Self {
        Self {
            recipe: UNetKind::default(),
            seed: 0,
            voxel: None,
            network: UNetParams::default(),
            inputs: UNetInputs::default(),
            ground: HeightParams::default(),
            lowest_building: 0.3,
            learning: LearningParams::default(),
            augment: Augmentation::default(),
            training: TrainingParams::default(),
            regularise: RegulariseParams::default(),
        }
    }
}

impl System for UNetRecipe {
    const NAME: &'static str = "unet";
    const KEEPS_CHECKPOINTS: bool = true;
    const TRAINING_ONLY: &'static [&'static str] = &["training", "learning", "augment", "network", "inputs", "voxel"];
    type Learned = Nothing;
    type Report = NetworkReport;

    fn validate(&self) -> Result<()> {
        if let Some(voxel) = self.voxel.filter(|voxel| !(1e-3..=1e3).contains(voxel)) {
            return Err(Error::parameter("voxel", voxel, "0.001 to 1000 metres"));
        }
        if !(self.lowest_building >= 0.0 && self.lowest_building.is_finite()) {
            return Err(Error::parameter("lowest_building", self.lowest_building, "metres, 0 or more"));
        }
        self.network.validate()?;
        self.ground.validate()?;
        self.learning.validate()?;
        self.augment.validate()?;
        self.training.validate()?;
        self.regularise.not_automatic(Self::NAME)?;
        self.regularise.validate()
    }

    fn shared(&self) -> SharedSettings<'_> {
        SharedSettings {
            seed: self.seed,
            regularise: &self.regularise,
            metres_per_unit: None,
            densities: &self.training.densities,
        }
    }

    fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    fn columns(&self) -> Vec<String> {
        [self.inputs.columns(), self.training.columns()].concat()
    }

    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 100 } else { 250 }
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
