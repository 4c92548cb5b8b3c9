//! What training learns besides the classifier.

use crate::error::{Error, Result};
use crate::terrain::RoadExample;
use serde::{Deserialize, Serialize};

/// What a weak model stores besides its classifier.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked", into = "Unchecked")]
pub struct WeakLearned {
    /// Share of each class in the labels, above 0, in the order of the classes.
    pub shares: Vec<f64>,
    /// Labelled points of road and of other classes: a model finds the road in other clouds by a forest trained on these.
    pub road: Vec<RoadExample>,
    /// Labelled positions of the training clouds, which keep their classes when the clouds are classified.
    pub labels: Vec<LabelledPosition>,
}

/// A labelled position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LabelledPosition {
    /// Coordinates in the units of the cloud.
    pub at: [f64; 3],
    /// Class code.
    pub code: u8,
}

/// As it is written in a model file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    shares: Vec<f64>,
    road: Vec<RoadExample>,
    labels: Vec<LabelledPosition>,
}

impl From<WeakLearned> for Unchecked {
    fn from(WeakLearned { shares, road, labels }: WeakLearned) -> Self {
        Self { shares, road, labels }
    }
}

impl TryFrom<Unchecked> for WeakLearned {
    type Error = Error;

    fn try_from(Unchecked { shares, road, labels }: Unchecked) -> Result<Self> {
        if let Some(share) = shares.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
            return Err(Error::parameter("shares", share, "shares, above 0, up to 1"));
        }
        if let Some(example) = road.iter().find(|example| example.descriptors.iter().any(|v| !v.is_finite())) {
            return Err(Error::parameter("road", format!("{:?}", example.descriptors), "finite numbers"));
        }
        if let Some(label) = labels.iter().find(|label| label.at.iter().any(|v| !v.is_finite())) {
            return Err(Error::parameter("labels", format!("{:?}", label.at), "finite coordinates"));
        }
        Ok(Self { shares, road, labels })
    }
}
