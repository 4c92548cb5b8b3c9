//! Arguments of the commands that compute features, train, classify and evaluate.

use super::choices::class_code;
use super::choices::{classifiers, orientation, regularisations};
use super::{LabelArgs, RecipeArgs, ScaleArgs, UnitArgs, examples};
use clap::{Args as ClapArgs, Subcommand};
use scansion_core::classification::ClassifierKind;
use scansion_core::graph::{NormalParams, Orientation};
use scansion_core::recipes::{ClassDimension, GridAxis, Regularise};
use std::path::PathBuf;

/// scansion features IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::FEATURES)]
pub(crate) struct Features {
    /// Cloud whose features are computed
    #[arg(required_unless_present = "list")]
    pub(crate) input: Option<PathBuf>,
    /// Output: .npy (matrix) or .csv, or .las, .laz, .ply with one dimension per feature
    #[arg(short, long, required_unless_present = "list")]
    pub(crate) output: Option<PathBuf>,
    /// List the features with formula and range, and exit
    #[arg(long)]
    pub(crate) list: bool,
    /// Only these features, by name (see --list), e.g. Planarity or Planarity_r0p4
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// Instead of the pyramid: linearity, planarity, scattering and verticality of each point's neighbourhood of lowest
    /// entropy (Weinmann et al. 2015), and its number of points
    #[arg(long, conflicts_with_all = ["list", "recipe", "set", "seed"])]
    pub(crate) optimal: bool,
    /// With --optimal: smallest and largest number of neighbours
    #[arg(long, value_name = "MIN,MAX", value_delimiter = ',', num_args = 1, requires = "optimal")]
    pub(crate) neighbours: Vec<usize>,
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}

/// scansion normals IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::NORMALS)]
pub(crate) struct Normals {
    /// Cloud whose normals are computed
    pub(crate) input: PathBuf,
    /// Output: the input with the dimensions NormalX, NormalY and NormalZ
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Number of neighbours of a point, not counting itself, 2 to 32
    #[arg(long, value_name = "K", default_value_t = NormalParams::default().neighbours)]
    pub(crate) neighbours: usize,
    /// Side to which the normals point: up; spanning-tree: consistently to one side of the surface, from the highest point on
    /// (Hoppe et al. 1992); or towards a sensor at X,Y,Z, in metres
    #[arg(long, value_name = "up|spanning-tree|X,Y,Z", value_parser = orientation, default_value = "up",
        allow_hyphen_values = true)]
    pub(crate) orientation: Orientation,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}

/// scansion train LABELLED... -o MODEL
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::TRAIN)]
pub(crate) struct Train {
    /// Labelled clouds
    #[arg(required_unless_present = "synthetic")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Model file to write
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    /// Classifier: random forest, gradient-boosted trees, bagging or logistic regression [default: the recipe's, rf]
    #[arg(long, value_parser = classifiers())]
    pub(crate) classifier: Option<ClassifierKind>,
    /// Train on a few labels per class: the same as --recipe weak
    #[arg(long, conflicts_with_all = ["recipe", "grid_depth"])]
    pub(crate) weak: bool,
    /// Labels picked by hand, for any recipe: a table x,y,z,class or cluster_id,class, polygons with a property class
    /// (GeoJSON), or a cloud whose classes are used; of any of the inputs, whose own labels are then ignored; may be repeated
    #[arg(long, value_name = "FILE")]
    pub(crate) weak_labels: Vec<PathBuf>,
    /// Spread the labels over the segments of this dimension, e.g. ClusterID: all points of a segment get the most frequent
    /// of its labels
    #[arg(long, value_name = "NAME")]
    pub(crate) spread_over: Option<String>,
    /// Use at most this many random labels of each class (weak recipe)
    #[arg(long, value_name = "N")]
    pub(crate) per_class: Option<u32>,
    /// Try these strengths of the random field on held-out labels, and keep the best (weak recipe)
    #[arg(long, value_name = "STRENGTHS", value_delimiter = ',')]
    pub(crate) grid_strength: Vec<f64>,
    /// Ground heights to use instead of those of the road: an ESRI ASCII grid in the unit of the cloud (weak recipe)
    #[arg(long, value_name = "FILE")]
    pub(crate) elevation_model: Option<PathBuf>,
    /// Lines along the edges of an input, as GeoJSON or OBJ: points near them are learned as contours, whatever their labels;
    /// once for each input, in their order (recipe contours)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["weak_labels", "spread_over", "map", "map_of",
        "classes", "unlabelled", "label_dimension"])]
    pub(crate) edges: Vec<PathBuf>,
    /// Also learn from this many synthetic scenes: streets and rooms (recipe contours)
    #[arg(long, value_name = "N")]
    pub(crate) synthetic: Option<usize>,
    /// Write this file from time to time, and go on from it if it exists, to the same model (recipes unet, windows)
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Instead of training a new model, teach this one (recipe airborne) to find cars, whose code in the labels is --cars;
    /// what it says about other points stays. `classify` leaves cars unclassified
    #[arg(long, value_name = "MODEL", requires = "cars", conflicts_with_all = ["recipe", "set", "seed", "weak", "weak_labels",
        "classifier", "per_class", "grid_strength", "elevation_model", "edges", "synthetic", "checkpoint", "cross_validate",
        "block", "grid", "grid_depth"])]
    pub(crate) add_cars_to: Option<PathBuf>,
    /// The code of cars in the labels; all other labelled points are other things
    #[arg(long, value_name = "CODE", value_parser = class_code, requires = "add_cars_to")]
    pub(crate) cars: Option<u8>,
    /// Also evaluate the recipe by k-fold cross-validation on squares of the clouds
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(2..=20))]
    pub(crate) cross_validate: Option<u8>,
    /// Edge of these squares, metres [default: 50, halved until there are two squares a fold]
    #[arg(long, value_name = "METRES")]
    pub(crate) block: Option<f64>,
    /// Try these values of a key of the recipe by cross-validation (5 folds without --cross-validate), and keep the best;
    /// may be repeated for all combinations, e.g. --grid forest.max_depth=18,30
    #[arg(long, value_name = "KEY=VALUE,...", conflicts_with_all = ["grid_depth", "grid_strength"])]
    pub(crate) grid: Vec<GridAxis>,
    /// Try these depths by cross-validation, and keep the best (Hackel 2018: 30,33,...,60)
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
    /// Output file, or a folder for several inputs
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Model to use [default: the built-in one for airborne scans, which can also be called built-in]
    #[arg(short, long)]
    pub(crate) model: Option<PathBuf>,
    /// Regularise the labels with this method [default: the model's own]
    #[arg(long, visible_alias = "regularise", value_parser = regularisations())]
    pub(crate) regularize: Option<Regularise>,
    /// Ground heights to use instead of those of the road: an ESRI ASCII grid in the unit of the cloud (weak recipe)
    #[arg(long, value_name = "FILE")]
    pub(crate) elevation_model: Option<PathBuf>,
    /// Change one setting of the model's recipe, e.g. regularise.strength=2; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Also write the probability of every class, as dimensions P_<class>
    #[arg(long)]
    pub(crate) probabilities: bool,
    /// Write only the classification: no Confidence and Entropy
    #[arg(long)]
    pub(crate) no_extra: bool,
    /// Leave points of less confidence unclassified, 0..1 [default: the model's own]
    #[arg(long, value_name = "CONFIDENCE")]
    pub(crate) abstain: Option<f64>,
    /// Only classify points that are unclassified (codes 0 and 1; Semantic3D: 0)
    #[arg(short = 'u', long)]
    pub(crate) only_unclassified: bool,
    /// Keep the class of points with these codes, e.g. 9,17 for water and bridges
    #[arg(long, visible_alias = "skip", value_name = "CODES", value_delimiter = ',', value_parser = class_code)]
    pub(crate) keep: Vec<u8>,
    /// Write the classes to this dimension, e.g. PredictedClassification, and leave Classification as it is
    #[arg(long, value_name = "NAME")]
    pub(crate) to: Option<String>,
    /// Change the model's codes in the output, e.g. 5=4; may be repeated
    #[arg(long, value_name = "OLD=NEW,...")]
    pub(crate) map: Vec<String>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
    /// Read the intact part of a damaged LAS or LAZ file, and report what is lost
    #[arg(long)]
    pub(crate) salvage: bool,
    /// Write the result of the built-in model although the cloud is not like an airborne scan
    #[arg(long)]
    pub(crate) force: bool,
    /// Leave outputs that exist as they are, and go on with the others, e.g. after a stop
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) skip_existing: bool,
}

/// scansion regularize IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::REGULARIZE)]
pub(crate) struct Regularize {
    /// Cloud with the probability of every class
    pub(crate) input: PathBuf,
    /// Output: the input with other classes
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Method [default: segment-crf]
    #[arg(long, value_parser = regularisations())]
    pub(crate) method: Option<Regularise>,
    /// Cost of an edge between different classes: larger gives fewer changes of class between neighbours [default: 1]
    #[arg(long, value_name = "STRENGTH")]
    pub(crate) strength: Option<f64>,
    /// The dimensions with the probabilities, and the codes of their classes, e.g. P_roof=6,P_road=2; percentages and
    /// counts of votes will do [default: all P_..., by the name or code of a class]
    #[arg(long, value_name = "NAME=CODE,...", value_delimiter = ',')]
    pub(crate) probabilities: Vec<ClassDimension>,
    /// Change one setting, e.g. regularise.neighbours=15; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Keep the class of points with these codes, e.g. 1 for points that classify left unclassified
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code)]
    pub(crate) keep: Vec<u8>,
    /// Write the classes to this dimension, and leave Classification as it is
    #[arg(long, value_name = "NAME")]
    pub(crate) to: Option<String>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}

/// scansion evaluate TRUTH [PREDICTION]
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::EVALUATE)]
pub(crate) struct Evaluate {
    /// Cloud with the true labels
    pub(crate) truth: PathBuf,
    /// Cloud with the predicted labels, same points in the same order; without it, both are in the first file
    pub(crate) prediction: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    /// Change the codes of the truth before the comparison. --map does so too, but is refused if it would also change
    /// codes of the prediction; may be repeated
    #[arg(long, value_name = "OLD=NEW,...", conflicts_with = "map")]
    pub(crate) map_truth: Vec<String>,
    /// Change the codes of the prediction before the comparison; may be repeated
    #[arg(long, value_name = "OLD=NEW,...", conflicts_with = "map")]
    pub(crate) map_predicted: Vec<String>,
    /// Dimension with the prediction [default: Classification of a second file, else PredictedClassification]
    #[arg(long, value_name = "NAME", conflicts_with = "model")]
    pub(crate) prediction_dimension: Option<String>,
    /// Classify the first cloud with this model and compare
    #[arg(short, long, conflicts_with = "prediction")]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    /// Compare segments instead of classes: the share of the class boundaries, in plan, that the segments miss, on cells
    /// of this edge, metres (about the point spacing)
    #[arg(long, value_name = "CELL", conflicts_with_all = ["model", "prediction_dimension", "map_predicted"])]
    pub(crate) segmentation_error: Option<f64>,
    /// Dimension with the segments, of the second file if there is one
    #[arg(long, value_name = "NAME", default_value = "ClusterID", requires = "segmentation_error")]
    pub(crate) segment_dimension: String,
    /// Also write the result: .json, .csv, or .png (confusion matrix); may be repeated
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,
}

/// scansion model ...
#[derive(Debug, Subcommand)]
pub(crate) enum Model {
    /// Show classes, features by importance, recipe and a summary of the training data
    Show {
        /// Model file [default: the built-in one]
        model: Option<PathBuf>,
        /// Show the whole recipe as TOML
        #[arg(long)]
        recipe: bool,
    },
}
