//! The command line arguments.

mod choices;
mod contours;
mod examples;
mod files;
mod filters;
mod learning;
mod lengths;
mod pictures;
mod segments;
mod streams;
mod terrain;

pub(crate) use contours::Contours;
pub(crate) use files::{Completions, Convert, Diff, Info, Man, Merge};
pub(crate) use filters::{Filter, NoiseArgs, OutlierMethod};
pub(crate) use learning::{Classify, Evaluate, Features, Model, Normals, Regularize, Train};
pub(crate) use lengths::{ScaleArgs, UnitArgs};
pub(crate) use pictures::{Render, ViewArg};
pub(crate) use segments::{Segment, SegmentArgs, Suggest};
pub(crate) use terrain::{GroundArgs, Height, Terrain};

use choices::class_code;
use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use scansion_core::classes::ClassTable;
use scansion_core::io::run::Replace;
use scansion_core::recipes::{AnyRecipe, SegmentParams};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Classifies LiDAR point clouds: divides a scan into segments and assigns a class to every point.
#[derive(Debug, Parser)]
#[command(
    name = "scansion",
    version,
    max_term_width = 110,
    after_help = "\
Exit codes: 0 done, 1 failed, 2 usage, 3 some inputs failed, 4 bad input,
  129 terminal closed, 130 interrupted, 143 terminated.

- in the place of a name is stdin or stdout:
  cat my.las | scansion classify - -o - --stdout-format laz > classified.laz

First steps:
  scansion demo                                  all steps on a small scan that is built in
  scansion classify my.laz -o classified.laz     classify every point with the built-in model
  scansion render classified.laz -o map.png      look at it"
)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Common options")]
pub(crate) struct Global {
    /// Number of threads [default: RAYON_NUM_THREADS, SLURM_CPUS_PER_TASK, or all cores given to the process]
    #[arg(short = 'j', long, global = true, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub(crate) threads: Option<usize>,
    /// Format of the data on stdout
    #[arg(long, global = true, value_enum, default_value_t = Format::Table)]
    pub(crate) format: Format,
    /// Names of the columns of text files, e.g. x,y,z,intensity,class or easting,northing,height; they replace a header row
    #[arg(long, global = true, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// The list of the class codes, which gives them names and colours and tells which mean "unlabelled": asprs, semantic3d,
    /// s3dis, semantickitti, toronto-3d, paris-lille-3d or own; or a TOML file with classes = [{ code = 64, name = "tram",
    /// colour = [255, 0, 0] }, ...] [default: asprs for LAS, that of the format, else own]
    #[arg(long, global = true, value_name = "NAME|FILE.toml")]
    pub(crate) scheme: Option<String>,
    /// Names of class codes, e.g. 15=pole,64=vehicle; they come before those in the files, of the model and of the list
    #[arg(long, global = true, value_name = "CODE=NAME,...")]
    pub(crate) names: Option<ClassTable>,
    /// Progress on stderr: a bar on a terminal, a line every 10 s elsewhere
    #[arg(long, global = true, value_enum, default_value_t = ProgressMode::Auto)]
    pub(crate) progress: ProgressMode,
    /// Format of what goes to stdout with -o -: las, laz, ply, csv, npy, ... [default: las; features: csv; terrain: tif;
    /// render: png]
    #[arg(long, global = true, value_name = "EXTENSION")]
    pub(crate) stdout_format: Option<String>,
    /// Replace outputs that exist; commands that write a changed copy may then replace their input too
    #[arg(long, global = true)]
    pub(crate) overwrite: bool,
    /// No notes, warnings and progress on stderr; errors and results remain
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
}

/// Format of the data on stdout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    Table,
    Json,
    Csv,
}

/// Display of progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressMode {
    Auto,
    Never,
    Json,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run all steps on a small real scan that is built in
    Demo(Demo),
    /// Show what a file contains
    Info(Info),
    /// Convert a file to another format, and report what the target cannot store
    Convert(Convert),
    /// Merge several files into one
    Merge(Merge),
    /// Compare two files field by field; exit code 0 if they are equal, 1 if not
    Diff(Diff),
    /// Compute multi-scale features, or list them
    Features(Features),
    /// Write the normal of every point
    Normals(Normals),
    /// Train a model on labelled clouds
    Train(Train),
    /// Classify every point
    #[command(visible_alias = "predict")]
    Classify(Classify),
    /// Make the classes of neighbours agree, from the probabilities in a file
    #[command(visible_alias = "regularise")]
    Regularize(Regularize),
    /// Divide a cloud into segments
    Segment(Segment),
    /// Suggest the segments whose labels would help most
    Suggest(Suggest),
    /// Make terrain and surface models, height contours, and outlines of buildings
    Terrain(Terrain),
    /// Draw lines along the edges of objects
    Contours(Contours),
    /// Write the height of every point above the ground
    Height(Height),
    /// Remove noise, and points by class, height above ground and place
    Filter(Filter),
    /// Compare a classification with the truth
    #[command(visible_alias = "eval")]
    Evaluate(Evaluate),
    /// Draw a map or an oblique view
    Render(Render),
    /// Inspect a model
    #[command(subcommand, after_help = examples::MODEL)]
    Model(Model),
    /// Print the completions of a shell
    Completions(Completions),
    /// Write manual pages, one a verb
    Man(Man),
}

impl Command {
    /// Whether an output may replace an input, if the user allows files to be replaced.
    pub(crate) fn replace(&self, overwrite: bool) -> Replace {
        let able = matches!(
            self,
            Self::Convert(_)
                | Self::Merge(_)
                | Self::Features(_)
                | Self::Normals(_)
                | Self::Classify(_)
                | Self::Regularize(_)
                | Self::Segment(_)
                | Self::Height(_)
                | Self::Filter(_)
        );
        match (able, overwrite) {
            (true, true) => Replace::Allowed,
            (true, false) => Replace::Refused("use --overwrite to replace it"),
            (false, _) => Replace::Refused("give the output another name"),
        }
    }

    /// Whether an output may replace another file. What `demo` and `man` write is always the same.
    pub(crate) fn existing(&self, overwrite: bool) -> Replace {
        match overwrite || matches!(self, Self::Demo(_) | Self::Man(_)) {
            true => Replace::Allowed,
            false => Replace::Refused("use --overwrite to replace it"),
        }
    }

    /// The files that will be read, as far as the arguments name them.
    pub(crate) fn inputs(&self) -> Vec<&Path> {
        let (many, others): (&[PathBuf], Vec<&Option<PathBuf>>) = match self {
            Self::Demo(_) | Self::Completions(_) | Self::Man(_) => (&[], vec![]),
            Self::Info(args) => (&args.inputs, vec![]),
            Self::Convert(args) => (std::slice::from_ref(&args.input), vec![]),
            Self::Merge(args) => (args.inputs_and_output().0, vec![]),
            Self::Diff(args) => return vec![&args.a, &args.b],
            Self::Features(args) => (&[], vec![&args.input, &args.recipe.recipe]),
            Self::Normals(args) => (std::slice::from_ref(&args.input), vec![]),
            Self::Train(args) => {
                let files = args.inputs.iter().chain(&args.weak_labels).chain(&args.edges).map(PathBuf::as_path);
                return files.chain(args.recipe.recipe.as_deref().filter(|path| !is_name(path))).collect();
            }
            Self::Classify(args) => (&args.inputs, vec![&args.model]),
            Self::Regularize(args) => (std::slice::from_ref(&args.input), vec![]),
            Self::Segment(args) => (std::slice::from_ref(&args.input), vec![&args.segments.recipe]),
            Self::Suggest(args) => {
                let files = std::iter::once(&args.input).chain(&args.weak_labels).chain(&args.model);
                let recipe = args.segments.recipe.as_deref().filter(|path| !is_name(path));
                return files.map(PathBuf::as_path).chain(recipe).collect();
            }
            Self::Terrain(args) => (&args.inputs, vec![]),
            Self::Contours(args) => (std::slice::from_ref(&args.input), vec![&args.model]),
            Self::Height(args) => (std::slice::from_ref(&args.input), vec![]),
            Self::Filter(args) => return std::iter::once(&*args.input).chain(args.polygon_file()).collect(),
            Self::Evaluate(args) => (std::slice::from_ref(&args.truth), vec![&args.prediction, &args.model]),
            Self::Render(args) => (&args.inputs, vec![&args.truth, &args.contours]),
            Self::Model(Model::Show { model, .. }) => (&[], vec![model]),
        };
        let named = |path: &&Path| !is_name(path);
        many.iter()
            .map(PathBuf::as_path)
            .chain(others.into_iter().flatten().map(PathBuf::as_path).filter(named))
            .collect()
    }
}

/// Whether a recipe is given by name.
fn is_name(recipe: &Path) -> bool {
    recipe.to_str().is_some_and(|n| AnyRecipe::is_name(n) || SegmentParams::named(n).is_some())
}

/// Source and meaning of the labels.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct LabelArgs {
    /// Change codes before use, e.g. 3=5,4=5 or 3-4=5; may be repeated
    #[arg(long, value_name = "OLD=NEW,...")]
    pub(crate) map: Vec<String>,
    /// Change the codes of one input differently from --map, e.g. old_scan.laz:1=5; may be repeated, once per input
    #[arg(long, value_name = "FILE:OLD=NEW,...")]
    pub(crate) map_of: Vec<String>,
    /// Use only these codes (after --map), including 0 and 1 if listed
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code)]
    pub(crate) classes: Vec<u8>,
    /// Codes (after --map) that mean "unlabelled", or none; these points are skipped and counted. auto: 0 and 1 in the
    /// Classification of LAS and LAZ, 0 in the .labels of Semantic3D, none in other formats and dimensions. Negative
    /// values and NaN are always unlabelled
    #[arg(long, value_name = "auto|none|CODES", default_value = "auto")]
    pub(crate) unlabelled: Unlabelled,
    /// Dimension with the labels
    #[arg(long, value_name = "NAME", default_value = "Classification")]
    pub(crate) label_dimension: String,
}

/// The codes that mean "unlabelled".
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Unlabelled {
    /// Those of the format.
    Auto,
    /// These.
    Codes(Vec<u8>),
}

impl FromStr for Unlabelled {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "auto" => Ok(Self::Auto),
            "none" | "" => Ok(Self::Codes(Vec::new())),
            codes => {
                let code =
                    |part: &str| part.trim().parse().map_err(|_| format!("{part:?} is no code 0..255, auto or none"));
                codes.split(',').map(code).collect::<Result<_, _>>().map(Self::Codes)
            }
        }
    }
}

impl Unlabelled {
    /// In the form that the core expects.
    pub(crate) fn codes(&self) -> Option<Vec<u8>> {
        match self {
            Self::Auto => None,
            Self::Codes(codes) => Some(codes.clone()),
        }
    }
}

/// The recipe, and changes to it.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct RecipeArgs {
    /// Recipe: pyramid (Hackel 2018), weak (Guinard and Landrieu 2017), objects (Hasanpour Zaryabi et al. 2022), clusters
    /// (Grilli et al. 2021), spheres (Thomas et al. 2018), airborne, mobile or indoor (two stages with context), the networks unet
    /// and windows, or contours; some with -paper behind the name, without our additions; or a TOML file [default: pyramid]
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) recipe: Option<PathBuf>,
    /// Change one setting of the recipe, e.g. forest.trees=100; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of all random draws
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
}

/// scansion demo
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::DEMO)]
pub(crate) struct Demo {
    /// Folder for the results; created if absent
    #[arg(short, long, default_value = "scansion-demo")]
    pub(crate) output: PathBuf,
}
