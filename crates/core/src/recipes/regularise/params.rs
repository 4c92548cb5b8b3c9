//! Parameters of regularisation.

use super::choice::ChoiceParams;
use crate::error::{Error, Result};
use crate::graph::KnnGraphParams;
use crate::neighbours::OptimalParams;
use crate::segmentation::{Intent, PartitionParams};
use crate::settings::changes::read;
use serde::{Deserialize, Deserializer, Serialize};

/// The method of regularisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Regularise {
    /// None: each point has its most probable class.
    #[default]
    None,
    /// Local smoothing: the mean of the neighbours' probabilities.
    Local,
    /// A conditional random field on the points: each edge between different labels costs `strength`.
    PointCrf,
    /// Each segment takes the most probable class of its mean probabilities.
    Consensus,
    /// A conditional random field on the segments: the paper's method.
    SegmentCrf,
    /// Training chooses one of the others (recipes `pyramid` and `airborne`); nowhere else than in a recipe.
    Auto,
}

impl Regularise {
    /// All methods; `auto` is none.
    pub const ALL: [Self; 5] = [Self::None, Self::Local, Self::PointCrf, Self::Consensus, Self::SegmentCrf];

    /// The name as in TOML and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Local => "local",
            Self::PointCrf => "point-crf",
            Self::Consensus => "consensus",
            Self::SegmentCrf => "segment-crf",
            Self::Auto => "auto",
        }
    }

    /// Whether its result depends on `strength`.
    pub fn has_strength(self) -> bool {
        matches!(self, Self::PointCrf | Self::SegmentCrf)
    }

    /// Whether it gives one label to each segment.
    pub(in crate::recipes) fn has_segments(self) -> bool {
        matches!(self, Self::Consensus | Self::SegmentCrf)
    }

    /// One line about it.
    pub fn title(self) -> &'static str {
        match self {
            Self::None => "No regularisation",
            Self::Local => "Mean of the neighbours' probabilities",
            Self::PointCrf => "Conditional random field on the points",
            Self::Consensus => "The most probable class of each segment, by its mean probabilities",
            Self::SegmentCrf => "Conditional random field on the segments (Guinard and Landrieu 2017)",
            Self::Auto => "Chosen in training",
        }
    }
}

/// How the probabilities of a segment's points are combined into one cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Posterior {
    /// The logarithm of the mean, as in the paper: a single confident point cannot outvote the others.
    #[default]
    LogOfMean,
    /// The mean of the logarithms: the energy of the point field, restricted to labellings that are constant on
    /// segments.
    MeanOfLogs,
}

/// Parameters of [`regularise`](super::regularise()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegulariseParams {
    /// The method of regularisation.
    pub method: Regularise,
    /// α: p = (1 − α) p + α / classes keeps every class possible. 0 < α ≤ 1.
    pub smoothing: f64,
    /// σ: cost of an edge of weight 1 between different labels, ≥ 0; if infinite, each connected component gets one label.
    pub strength: f64,
    /// Number of initial labellings of α-expansion, 1 or 2. 1: the most probable class of each node, as in the paper. 2:
    /// also the first class everywhere; the two results are fused. Takes up to twice as long.
    pub starts: usize,
    /// How the probabilities of a segment's points are combined.
    pub posterior: Posterior,
    /// Number of nearest neighbours that each point is connected to, at least 1.
    pub neighbours: usize,
    /// Weights of these edges.
    pub adjacency: KnnGraphParams,
    /// Edges longer than this, metres, lose weight with the square of their length: they count (near/d)² times. Without
    /// that, points that are far from each other in a thin cloud persuade each other as if they were neighbours. If
    /// infinite, no edge loses weight: the paper's field, and the default of the recipe `weak`.
    #[serde(default = "infinite")]
    pub near: f64,
    /// Neighbourhoods for the descriptors on which the segments are based. The weak recipe has descriptors of its own and
    /// does not use these.
    pub neighbourhood: OptimalParams,
    /// The segments. The strength is 0.03, which suits streets and airborne scans; the weak recipe starts with 0.1.
    pub partition: PartitionParams,
    /// How training chooses if the method is `auto`.
    pub choice: ChoiceParams,
}

/// The value of `near` in models of programs that did not have it.
fn infinite() -> f64 {
    f64::INFINITY
}

impl Default for RegulariseParams {
    fn default() -> Self {
        Self {
            method: Regularise::None,
            smoothing: 0.01,
            strength: 1.0,
            starts: 2,
            posterior: Posterior::LogOfMean,
            neighbours: 10,
            adjacency: KnnGraphParams::default(),
            near: 0.5,
            neighbourhood: OptimalParams::default(),
            partition: PartitionParams { intent: Intent::Strength(0.03), ..PartitionParams::default() },
            choice: ChoiceParams::default(),
        }
    }
}

impl RegulariseParams {
    /// The defaults of recipes whose training chooses the method.
    pub(in crate::recipes) fn automatic() -> Self {
        Self { method: Regularise::Auto, ..Self::default() }
    }

    /// Fails if the method is to be chosen in the training of a recipe that cannot do that.
    pub(in crate::recipes) fn not_automatic(&self, recipe: &str) -> Result<()> {
        match self.method {
            Regularise::Auto => {
                let methods = Regularise::ALL.map(Regularise::name).join(", ");
                let allowed = format!("{methods}: training of the recipe {recipe} does not choose");
                Err(Error::parameter("regularise.method", "auto", allowed))
            }
            _ => Ok(()),
        }
    }

    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if !(self.smoothing > 0.0 && self.smoothing <= 1.0) {
            return Err(Error::parameter("regularise.smoothing", self.smoothing, "above 0, at most 1"));
        }
        if self.strength.is_nan() || self.strength < 0.0 {
            return Err(Error::parameter("regularise.strength", self.strength, "0 or more; may be infinite"));
        }
        if !(1..=2).contains(&self.starts) {
            return Err(Error::parameter("regularise.starts", self.starts, "1 or 2"));
        }
        if self.neighbours == 0 {
            return Err(Error::parameter("regularise.neighbours", 0, "1 or more"));
        }
        if self.near.is_nan() || self.near <= 0.0 {
            return Err(Error::parameter("regularise.near", self.near, "metres, above 0; may be infinite"));
        }
        self.adjacency.validate()?;
        self.neighbourhood.validate()?;
        self.choice.validate()?;
        self.partition.validate()
    }
}

/// Reads the section of a recipe whose training chooses the method if the section does not name one.
pub(in crate::recipes) fn automatic<'de, D: Deserializer<'de>>(
    from: D,
) -> std::result::Result<RegulariseParams, D::Error> {
    let mut section = toml::Table::deserialize(from)?;
    section.entry("method").or_insert_with(|| Regularise::Auto.name().into());
    read(&section).map_err(|e| serde::de::Error::custom(e.message()))
}
