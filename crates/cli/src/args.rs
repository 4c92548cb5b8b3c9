//! What the user types.

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use scansion_core::classification::ClassifierKind;
use scansion_core::recipes::Regularise;
use std::path::PathBuf;

/// Divides a LiDAR scan into its parts and names every point.
#[derive(Debug, Parser)]
#[command(
    name = "scansion",
    version,
    max_term_width = 110,
    after_help = "\
Exit codes: 0 done, 1 failed, 2 usage, 3 some inputs failed, 4 bad input, 130 interrupted, 143 terminated.

First steps:
  scansion demo                                  the whole way on a small scan that is built in
  scansion classify my.laz -o named.laz          name every point with the built-in model
  scansion render named.laz -o named.png         look at it"
)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Flags of every command.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Common options")]
pub(crate) struct Global {
    /// Threads [default: RAYON_NUM_THREADS, SLURM_CPUS_PER_TASK, or all cores given to the process]
    #[arg(short = 'j', long, global = true, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub(crate) threads: Option<usize>,
    /// Form of the data on stdout
    #[arg(long, global = true, value_enum, default_value_t = Format::Table)]
    pub(crate) format: Format,
    /// Progress on stderr: a bar on a terminal, a line every 10 s elsewhere
    #[arg(long, global = true, value_enum, default_value_t = ProgressMode::Auto)]
    pub(crate) progress: ProgressMode,
    /// Say nothing but errors
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
}

/// Form of the data on stdout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    Table,
    Json,
    Csv,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressMode {
    Auto,
    Never,
    Json,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show the whole way on a small real scan that is built in
    Demo(Demo),
    /// Tell what a file holds
    Info(Info),
    /// Copy a file into another format; what the target cannot hold is said
    Convert(Convert),
    /// Join several files into one
    Merge(Merge),
    /// Compare two files field by field; exit code 0 if they are the same, 1 if not
    Diff(Diff),
    /// Compute multi-scale features, or list them
    Features(Features),
    /// Learn a model from labelled clouds
    Train(Train),
    /// Name every point
    #[command(visible_alias = "predict")]
    Classify(Classify),
    /// Part a cloud into segments
    Segment(Segment),
    /// Name the segments whose labels would help most
    Suggest(Suggest),
    /// Compare a classification with the truth
    #[command(visible_alias = "eval")]
    Evaluate(Evaluate),
    /// Draw a map or an oblique view
    Render(Render),
    /// Look into a model
    #[command(subcommand)]
    Model(Model),
}

/// Where labels come from and what they mean.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct LabelArgs {
    /// Change codes before use, e.g. 3=5,4=5 or 3-4=5
    #[arg(long, value_name = "OLD=NEW,...", default_value = "")]
    pub(crate) map: String,
    /// Change the codes of one input in another way than --map says, e.g. old_scan.laz:1=5; may be repeated
    #[arg(long, value_name = "FILE:OLD=NEW,...")]
    pub(crate) map_of: Vec<String>,
    /// Use only these codes (after --map)
    #[arg(long, value_name = "CODES", value_delimiter = ',')]
    pub(crate) classes: Vec<u8>,
    /// Codes (after --map) that mean "nobody has said"; they are skipped and counted
    #[arg(long, value_name = "CODES", value_delimiter = ',', default_values_t = [0, 1])]
    pub(crate) unlabelled: Vec<u8>,
    /// Dimension that holds the labels
    #[arg(long, value_name = "NAME", default_value = "Classification")]
    pub(crate) label_dimension: String,
}

/// The recipe and changes to it.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct RecipeArgs {
    /// Recipe to follow: pyramid (document 004), weak (document 000), or a TOML file [default: pyramid]
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) recipe: Option<PathBuf>,
    /// Change one setting of the recipe, e.g. forest.trees=100; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of everything that is drawn by chance
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
}

/// scansion demo
#[derive(Debug, ClapArgs)]
pub(crate) struct Demo {
    /// Folder for the results; made if absent
    #[arg(short, long, default_value = "scansion-demo")]
    pub(crate) output: PathBuf,
}

/// scansion info FILE...
#[derive(Debug, ClapArgs)]
pub(crate) struct Info {
    /// Files to look at (`*`, `?` and `[...]` are understood)
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Read the points too: classes, density, spacing, duplicates, points that are not finite or out of bounds
    #[arg(long)]
    pub(crate) stats: bool,
    /// Tell how much of a damaged LAS or LAZ file can be read
    #[arg(long, conflicts_with = "stats")]
    pub(crate) salvage: bool,
    /// The same as --format json
    #[arg(long)]
    pub(crate) json: bool,
}

/// scansion convert IN OUT
#[derive(Debug, ClapArgs)]
pub(crate) struct Convert {
    /// File to copy
    pub(crate) input: PathBuf,
    /// Result; its extension tells the format
    pub(crate) output: PathBuf,
    /// Point format of LAS and LAZ, 0 to 10; it must have all fields of the input's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=10))]
    pub(crate) point_format: Option<u8>,
    /// Only points in this box: 4 numbers (x and y) or 6, lowest first; COPC files are read where the box is
    #[arg(long, value_name = "X,Y[,Z],X,Y[,Z]", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) bounds: Vec<f64>,
    /// A thinner cloud: points about so far apart, from the levels of a COPC file
    #[arg(long, value_name = "DISTANCE")]
    pub(crate) resolution: Option<f64>,
    /// Take what can be read of a damaged LAS or LAZ file, and say what is lost
    #[arg(long, conflicts_with_all = ["point_format", "bounds", "resolution"])]
    pub(crate) salvage: bool,
    /// Replace the input itself if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// scansion merge IN... OUT
#[derive(Debug, ClapArgs)]
pub(crate) struct Merge {
    /// Files to join, in this order (`*`, `?` and `[...]` are understood), and the result last
    #[arg(required = true, num_args = 2.., value_names = ["IN...", "OUT"])]
    pub(crate) files: Vec<PathBuf>,
    /// Replace an input if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// scansion diff A B
#[derive(Debug, ClapArgs)]
pub(crate) struct Diff {
    /// First file
    pub(crate) a: PathBuf,
    /// Second file
    pub(crate) b: PathBuf,
}

/// scansion features IN -o OUT
#[derive(Debug, ClapArgs)]
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
    /// What is learned: random forest, gradient-boosted trees or bagging [default: the recipe's, rf]
    #[arg(long, value_enum)]
    pub(crate) classifier: Option<ClassifierName>,
    /// Learn from a few labels (document 000): the same as --recipe weak
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
    /// Try these depths by cross-validation and keep the best (document 004: 30,33,...,60)
    #[arg(long, value_name = "DEPTHS", value_delimiter = ',')]
    pub(crate) grid_depth: Vec<usize>,
}

/// scansion classify IN... -o OUT
#[derive(Debug, ClapArgs)]
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
    /// Only name points that are unclassified (codes 0 and 1)
    #[arg(short = 'u', long)]
    pub(crate) only_unclassified: bool,
    /// Leave points with these codes as they are
    #[arg(long, value_name = "CODES", value_delimiter = ',')]
    pub(crate) skip: Vec<u8>,
    /// Change the model's codes in the output, e.g. 5=4
    #[arg(long, value_name = "OLD=NEW,...", default_value = "")]
    pub(crate) map: String,
    /// Metres in one unit of the coordinates [default: from the file, else 1]
    #[arg(long, value_name = "METRES")]
    pub(crate) unit: Option<f64>,
    /// Take what can be read of a damaged LAS or LAZ file, and say what is lost
    #[arg(long)]
    pub(crate) salvage: bool,
    /// Replace the input itself if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// How segments are found, and how large they are to be.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct SegmentArgs {
    /// How segments are found
    #[arg(long, value_enum, default_value_t = MethodArg::CutPursuit)]
    pub(crate) method: MethodArg,
    /// Cost of a boundary edge: larger gives fewer, larger segments [default: 0.03]
    #[arg(long, value_name = "RHO", group = "intent")]
    pub(crate) strength: Option<f64>,
    /// Aim at so many segments on a hectare of covered ground
    #[arg(long, value_name = "N", group = "intent")]
    pub(crate) segments_per_hectare: Option<f64>,
    /// Aim at the smallest object that is to be a segment of its own, metres
    #[arg(long, value_name = "METRES", group = "intent")]
    pub(crate) smallest_object: Option<f64>,
    /// Aim at the fewest segments that could be named with at most so much loss of accuracy on the cloud's labels, 0..1
    #[arg(long, value_name = "LOSS", group = "intent")]
    pub(crate) oracle_loss: Option<f64>,
    /// Segments of fewer points join their best neighbour
    #[arg(long, value_name = "POINTS", default_value_t = 0.0)]
    pub(crate) cutoff: f64,
    /// Smallest neighbourhood that describes a point (20 or more on scans that consist of lines)
    #[arg(long, value_name = "K", default_value_t = 10)]
    pub(crate) k_min: usize,
    /// Seed of everything that is drawn by chance
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// How segments are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// l0 cut pursuit: lower energy
    CutPursuit,
    /// Greedy merging: faster
    Merge,
}

/// scansion segment IN -o OUT
#[derive(Debug, ClapArgs)]
pub(crate) struct Segment {
    /// Cloud to part
    pub(crate) input: PathBuf,
    /// Result: the input with the dimension ClusterID (from 1; 0 = none)
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) segments: SegmentArgs,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    /// Replace the input itself if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// scansion suggest IN -o OUT
#[derive(Debug, ClapArgs)]
pub(crate) struct Suggest {
    /// Cloud to look at
    pub(crate) input: PathBuf,
    /// Where the answer goes: .csv to be filled in, .las, .laz or .ply with ClusterID, .html with two pictures of each
    /// segment; may be repeated
    #[arg(short, long, required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Segments to name
    #[arg(short = 'n', long, value_name = "N", default_value_t = 50)]
    pub(crate) count: usize,
    /// Model that is to get better: its uncertainty counts
    #[arg(short, long)]
    pub(crate) model: Option<PathBuf>,
    /// Leave out segments that hold a label
    #[arg(long)]
    pub(crate) labelled: bool,
    #[command(flatten)]
    pub(crate) segments: SegmentArgs,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
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
    /// Random field on the segments (document 000)
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
pub(crate) struct Evaluate {
    /// Cloud with the true labels
    pub(crate) truth: PathBuf,
    /// Cloud with the predicted labels, point by point the same; absent: both stand in one file
    pub(crate) prediction: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    /// Dimension that holds the prediction [default: Classification of a second file, else PredictedClassification]
    #[arg(long, value_name = "NAME")]
    pub(crate) prediction_dimension: Option<String>,
    /// Classify the truth's cloud with this model and compare
    #[arg(short, long, conflicts_with = "prediction")]
    pub(crate) model: Option<PathBuf>,
    /// Also write the result: .json, .csv, or .png (confusion matrix); may be repeated
    #[arg(short, long)]
    pub(crate) output: Vec<PathBuf>,
}

/// scansion render IN -o OUT.png
#[derive(Debug, ClapArgs)]
pub(crate) struct Render {
    /// Cloud to draw
    pub(crate) input: PathBuf,
    /// Picture to write (.png); a map gets a world file (.pgw) beside it
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// What the colours show: class, height, rgb, or the name of a dimension [default: class if there is one]
    #[arg(long)]
    pub(crate) by: Option<String>,
    /// Show where the classes differ from those of this cloud, point by point the same (codes 0 and 1 of it count too)
    #[arg(long, value_name = "FILE", conflicts_with = "by")]
    pub(crate) truth: Option<PathBuf>,
    /// From above, or from the side
    #[arg(long, value_enum, default_value_t = ViewArg::Map)]
    pub(crate) view: ViewArg,
    /// Direction the viewer looks to, degrees from north over east
    #[arg(long, default_value_t = 30.0)]
    pub(crate) azimuth: f64,
    /// Height of the viewer above the horizon, degrees
    #[arg(long, default_value_t = 35.0)]
    pub(crate) elevation: f64,
    /// Width in pixels
    #[arg(long, default_value_t = 1600)]
    pub(crate) width: u32,
    /// Height in pixels [default: from the cloud's shape]
    #[arg(long)]
    pub(crate) height: Option<u32>,
    /// Range of the colours, low,high [default: from the data]
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) range: Option<String>,
    /// Line above the picture
    #[arg(long)]
    pub(crate) title: Option<String>,
    /// No shading of the relief
    #[arg(long)]
    pub(crate) no_shading: bool,
    /// No legend, scale bar and title
    #[arg(long)]
    pub(crate) no_legend: bool,
}

/// Kind of picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ViewArg {
    Map,
    Oblique,
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
