//! From a few labelled points to a labelled street.
//!
//! S. Guinard, L. Landrieu, *Weakly supervised segmentation-aided classification of urban scenes from 3d LiDAR point
//! clouds*, ISPRS Archives XLII-1/W1, 2017 (document 000). `docs/weak.md` has the equations and where we deviate.
//!
//! | section | here |
//! |---|---|
//! | 2.1 local descriptors | [`WeakRecipe::neighbourhood`] |
//! | 2.2 road, elevation, position | [`WeakRecipe::road`] |
//! | 3 segmentation | [`WeakRecipe::regularise`], `partition` |
//! | beyond the paper: features of many scales | [`WeakRecipe::descriptors`], [`WeakRecipe::features`] |
//! | 4.1 weakly supervised classifier | [`WeakRecipe::labels`], [`WeakRecipe::forest`] |
//! | beyond the paper: shares of the classes | [`WeakRecipe::shares`] |
//! | beyond the paper: labels hold | [`WeakLabels::hold`] |
//! | 4.2 probabilities of segments, field | [`WeakRecipe::regularise`] |

mod describe;
mod examples;
mod hold;
mod label_file;
mod learn;
mod road;
mod shares;

pub use examples::{Example, WeakLabels};
pub use label_file::LabelFile;
pub use learn::{StrengthScore, WeakReport, train_weak};
pub use road::{RoadParams, RoadSource};
pub use shares::ClassShares;

pub(super) use learn::classify_weak;

use super::regularise::{Regularise, RegulariseParams};
use crate::classification::ForestParams;
use crate::cloud::names;
use crate::error::Result;
use crate::features::FeatureSet;
use crate::neighbours::OptimalParams;
use crate::segmentation::PartitionParams;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WeakKind {
    /// Document 000.
    #[default]
    Weak,
}

/// What a point is described by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Descriptors {
    /// The six of the paper.
    Paper,
    /// These, and the features of many scales ([`WeakRecipe::features`]): far better where labels are few.
    #[default]
    MultiScale,
}

/// The settings of the weakly supervised recipe; every default is the paper's where it tells one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeakRecipe {
    /// Always `weak`.
    pub recipe: WeakKind,
    /// Seed of everything that is drawn by chance.
    pub seed: u64,
    /// What a point is described by.
    pub descriptors: Descriptors,
    /// Features of many scales (document 004, chapter 4.4). Training fills in the finest scale.
    pub features: FeatureSet,
    /// Optimal neighbourhoods of the local descriptors.
    pub neighbourhood: OptimalParams,
    /// The road, and the descriptors that need it.
    pub road: RoadParams,
    /// Which labels are learned from.
    pub labels: WeakLabels,
    /// The forest.
    pub forest: ForestParams,
    /// How probabilities follow the classes' shares of the cloud.
    pub shares: ClassShares,
    /// Segments, and how labels are made to agree.
    pub regularise: RegulariseParams,
}

impl Default for WeakRecipe {
    fn default() -> Self {
        Self {
            recipe: WeakKind::Weak,
            seed: 0,
            descriptors: Descriptors::default(),
            features: FeatureSet::default(),
            neighbourhood: OptimalParams::default(),
            road: RoadParams::default(),
            labels: WeakLabels::default(),
            forest: ForestParams::breiman(),
            shares: ClassShares::default(),
            regularise: RegulariseParams {
                method: Regularise::SegmentCrf,
                partition: PartitionParams::default(),
                ..RegulariseParams::default()
            },
        }
    }
}

impl WeakRecipe {
    /// Checks every part.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        self.features.validate()?;
        self.neighbourhood.validate()?;
        self.road.validate()?;
        self.labels.validate()?;
        self.forest.validate()?;
        self.shares.validate()?;
        self.regularise.validate()
    }

    /// Columns of a cloud that the recipe reads, beside labels.
    pub fn columns(&self) -> Vec<String> {
        let own = self.road.source == RoadSource::Classification;
        let scaled = match self.descriptors {
            Descriptors::Paper => Vec::new(),
            Descriptors::MultiScale => self.features.columns(),
        };
        own.then_some(names::CLASSIFICATION).into_iter().chain(scaled).map(str::to_string).collect()
    }
}
