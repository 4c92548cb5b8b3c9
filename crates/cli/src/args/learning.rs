//! Arguments of the commands that describe, learn, name and compare.

use super::{LabelArgs, RecipeArgs, ScaleArgs, UnitArgs, examples};
use clap::{Args as ClapArgs, Subcommand, ValueEnum};
use scansion_core::classification::ClassifierKind;
use scansion_core::recipes::Regularise;
use std::path::PathBuf;

/// scansion features IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::FEATURES)]
pub(crate) struct Features {
    /// Cloud to describe
    #[arg(required_unless_present = "list")]
    pub(crate) input: Option<PathBuf>,
    /// Result: .npy (matrix) or .csv, or .las, .laz, .ply with one dimension a feature
    #[arg(short, long, required_unless_present = "list")]
    pub(crate) output: Option<PathBuf>,
    /// List the features with formula and range, and stop
    #[arg(long)]
    pub(crate) list: bool,
    /// Only these features, by name (see --list), e.g. Planarity or Planarity_r0p4
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
    /// Replace the input itself if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Kind of classifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClassifierName {
    /// Random forest
    Rf,
    /// Gradient-boosted trees
    Gbt,
    /// Bagging of unpruned trees
    Bagging,
}

impl ClassifierName {
    pub(crate) fn kind(self) -> ClassifierKind {
        match self {
            Self::Rf => ClassifierKind::Forest,
            Self::Gbt => ClassifierKind::Boosting,
            Self::Bagging => ClassifierKind::Bagging,
        }
    }
}

/// scansion train LABELLED... -o MODEL
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::TRAIN)]
pub(crate) struct Train {
    /// Labelled clouds
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Model to write
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    /// What is learned: random forest, gradient-boosted trees or bagging [default: the recipe's, rf]
    #[arg(long, value_enum)]
    pub(crate) classifier: Option<ClassifierName>,
    /// Learn from a few labels a class: the same as --recipe weak
    #[arg(long, conflicts_with_all = ["recipe", "cross_validate", "grid_depth"])]
    pub(crate) weak: bool,
    /// Labels picked by hand: a table x,y,z,class or cluster_id,class, or a cloud whose classes count; those of the input
    /// are then left aside
    #[arg(long, value_name = "FILE")]
    pub(crate) weak_labels: Option<PathBuf>,
    /// Learn from at most this many points of each class, drawn by the seed (weak recipe)
    #[arg(long, value_name = "N")]
    pub(crate) per_class: Option<u32>,
    /// Try these strengths of the field on labels that are held out, and keep the best (weak recipe)
    #[arg(long, value_name = "STRENGTHS", value_delimiter = ',')]
    pub(crate) grid_strength: Vec<f64>,
    /// Also score the recipe by k-fold cross-validation on spatial blocks
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(2..=20))]
    pub(crate) cross_validate: Option<u8>,
    /// Try these depths by cross-validation and keep the best (Hackel 2018: 30,33,...,60)
    #[arg(long, value_name = "DEPTHS", value_delimiter = ',')]
    pub(crate) grid_depth: Vec<usize>,
}

/// scansion classify IN... -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::CLASSIFY)]
pub(crate) struct Classify {
    /// Clouds to classify
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Result, or a folder for several inputs
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Model to use [default: the built-in one for airborne scans]
    #[arg(short, long)]
    pub(crate) model: Option<PathBuf>,
    /// Make neighbours agree [default: the model's own way]
    #[arg(long, visible_alias = "regularise", value_enum)]
    pub(crate) regularize: Option<RegularizeArg>,
    /// Change one setting of the model's recipe, e.g. regularise.strength=2; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Write the probability of every class too, as dimensions P_<class>
    #[arg(long)]
    pub(crate) probabilities: bool,
    /// Change nothing but the classification: no Confidence and Entropy
    #[arg(long)]
    pub(crate) no_extra: bool,
    /// Only name points that are unclassified (codes 0 and 1; Semantic3D: 0)
    #[arg(short = 'u', long)]
    pub(crate) only_unclassified: bool,
    /// Leave points with these codes as they are
    #[arg(long, value_name = "CODES", value_delimiter = ',')]
    pub(crate) skip: Vec<u8>,
    /// Change the model's codes in the output, e.g. 5=4
    #[arg(long, value_name = "OLD=NEW,...", default_value = "", hide_default_value = true)]
    pub(crate) map: String,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
    /// Take what can be read of a damaged LAS or LAZ file, and say what is lost
    #[arg(long)]
    pub(crate) salvage: bool,
    /// Replace the input itself if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// How neighbours are made to agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RegularizeArg {
    /// Every point for itself
    None,
    /// Mean of the neighbours' probabilities
    Local,
    /// Random field on the points
    PointCrf,
    /// One label a segment, by the mean of its probabilities
    Consensus,
    /// Random field on the segments (Guinard and Landrieu 2017)
    SegmentCrf,
}

impl From<RegularizeArg> for Regularise {
    fn from(arg: RegularizeArg) -> Self {
        match arg {
            RegularizeArg::None => Self::None,
            RegularizeArg::Local => Self::Local,
            RegularizeArg::PointCrf => Self::PointCrf,
            RegularizeArg::Consensus => Self::Consensus,
            RegularizeArg::SegmentCrf => Self::SegmentCrf,
        }
    }
}

/// scansion evaluate TRUTH [PREDICTION]
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::EVALUATE)]
pub(crate) struct Evaluate {
    /// Cloud with the true labels
    pub(crate) truth: PathBuf,
    /// Cloud with the predicted labels, point by point the same; absent: both stand in one file
    pub(crate) prediction: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    /// Change the codes of the truth before they are compared. --map does so too, but is refused where it would change codes
    /// of the prediction as well
    #[arg(long, value_name = "OLD=NEW,...", conflicts_with = "map")]
    pub(crate) map_truth: Option<String>,
    /// Change the codes of the prediction before they are compared
    #[arg(long, value_name = "OLD=NEW,...", conflicts_with = "map")]
    pub(crate) map_predicted: Option<String>,
    /// Dimension that holds the prediction [default: Classification of a second file, else PredictedClassification]
    #[arg(long, value_name = "NAME")]
    pub(crate) prediction_dimension: Option<String>,
    /// Classify the truth's cloud with this model and compare
    #[arg(short, long, conflicts_with = "prediction")]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    /// Also write the result: .json, .csv, or .png (confusion matrix); may be repeated
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,
}

/// scansion model ...
#[derive(Debug, Subcommand)]
pub(crate) enum Model {
    /// Show classes, features by importance, recipe and fingerprint
    Show {
        /// Model file [default: the built-in one]
        model: Option<PathBuf>,
        /// Show the whole recipe as TOML
        #[arg(long)]
        recipe: bool,
    },
}
