//! The recipe `windows`: a network that looks at the occupied cells around a point at five scales.
//!
//! The three-dimensional convolutional network with which T. Hackel, *Large-scale machine learning for point cloud
//! processing*, ETH Zurich 2018, section 5.4.3, compares; `docs/windows.md` describes it. The network itself is
//! [`crate::nn::networks::WindowNet`].

mod classify;
mod occupancy;
mod settings;
#[cfg(test)]
mod tests;
mod train;

pub use settings::{Placement, WindowsKind, WindowsLearning};

use super::classify::{Classified, Job};
use super::labels::LabelledCloud;
use super::regularise::{Regularise, RegulariseParams};
use super::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use super::training::networks::NetworkReport;
use super::training::samples::TrainingParams;
use crate::error::{Error, Result};
use crate::nn::networks::WindowNetParams;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// The parameters of the recipe `windows`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowsRecipe {
    /// Always `windows`.
    pub recipe: WindowsKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// Edge of the finest cells, metres; `None` (`"none"` in a recipe): twice the point spacing of the first cloud.
    #[serde(with = "crate::settings::optional")]
    pub voxel: Option<f64>,
    /// How the windows lie around a point: `grid`, `centred` or `doubled`.
    pub placement: Placement,
    /// The network.
    pub network: WindowNetParams,
    /// How it is trained.
    pub learning: WindowsLearning,
    /// Classes that are learned, thinned copies, and the points that are learned from.
    pub training: TrainingParams,
    /// Regularisation of the labels.
    pub regularise: RegulariseParams,
}

impl System for WindowsRecipe {
    const NAME: &'static str = "windows";
    const KEEPS_CHECKPOINTS: bool = true;
    const TRAINING_ONLY: &'static [&'static str] = &["training", "learning", "network", "placement", "voxel"];
    type Learned = Nothing;
    type Report = NetworkReport;

    fn validate(&self) -> Result<()> {
        if let Some(voxel) = self.voxel.filter(|voxel| !(1e-3..=1e3).contains(voxel)) {
            return Err(Error::parameter("voxel", voxel, "0.001 to 1000 metres"));
        }
        self.network.validate()?;
        if self.placement == Placement::Doubled && !self.network.window.is_multiple_of(2) {
            return Err(Error::parameter(
                "network.window",
                self.network.window,
                "an even number for placement doubled",
            ));
        }
        self.learning.validate()?;
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
        self.training.columns()
    }

    fn bytes_a_point(&self, method: Regularise) -> u64 {
        if method == Regularise::None { 120 } else { 250 }
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
