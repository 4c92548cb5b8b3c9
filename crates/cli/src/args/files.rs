//! Arguments of the commands that read and write files.

use super::{ScaleArgs, examples};
use clap::Args as ClapArgs;
use std::path::{Path, PathBuf};

/// scansion info FILE...
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::INFO)]
pub(crate) struct Info {
    /// Files to inspect (`*`, `?` and `[...]` are expanded)
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Read the points too: classes, density, spacing, duplicates, points that are not finite or out of bounds
    #[arg(long)]
    pub(crate) stats: bool,
    /// Report how much of a damaged LAS or LAZ file can be read
    #[arg(long, conflicts_with = "stats")]
    pub(crate) salvage: bool,
    /// Same as --format json
    #[arg(long)]
    pub(crate) json: bool,
}

/// scansion convert IN OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::CONVERT)]
pub(crate) struct Convert {
    /// File to copy
    pub(crate) input: PathBuf,
    /// Output file; its extension determines the format
    #[arg(value_name = "OUTPUT", required_unless_present = "named_output")]
    pub(super) output: Option<PathBuf>,
    /// Output file, in place of the second name
    #[arg(short = 'o', long = "output", value_name = "OUTPUT", conflicts_with = "output")]
    pub(super) named_output: Option<PathBuf>,
    /// Point format of LAS and LAZ, 0 to 10; it must have all fields of the input's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=10))]
    pub(crate) point_format: Option<u8>,
    /// Only points in this box: 4 numbers (x and y) or 6, lowest first; of COPC files only the parts in the box are
    /// read
    #[arg(long, value_name = "X,Y[,Z],X,Y[,Z]", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) bounds: Vec<f64>,
    /// Thin to points about this far apart, by the levels of a COPC file
    #[arg(long, value_name = "DISTANCE")]
    pub(crate) resolution: Option<f64>,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
    /// Read the intact part of a damaged LAS or LAZ file, and report what is lost
    #[arg(long, conflicts_with_all = ["point_format", "bounds", "resolution", "scale"])]
    pub(crate) salvage: bool,
}

impl Convert {
    /// The output, however it was given.
    pub(crate) fn output(&self) -> &Path {
        self.output.as_ref().or(self.named_output.as_ref()).map_or(Path::new(""), |path| path)
    }
}

/// scansion completions SHELL
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::COMPLETIONS)]
pub(crate) struct Completions {
    /// The shell
    pub(crate) shell: clap_complete::Shell,
}

/// scansion man [FOLDER]
#[derive(Debug, ClapArgs)]
pub(crate) struct Man {
    /// Folder for the pages; created if absent
    #[arg(default_value = "man")]
    pub(crate) folder: PathBuf,
}

/// scansion merge IN... OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::MERGE)]
pub(crate) struct Merge {
    /// Files to merge, in this order (`*`, `?` and `[...]` are expanded); without -o the output last
    #[arg(required = true, num_args = 1.., value_names = ["IN...", "OUT"])]
    pub(crate) files: Vec<PathBuf>,
    /// Output, in place of the last name
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}

impl Merge {
    /// The inputs as they were typed, and the output.
    pub(crate) fn inputs_and_output(&self) -> (&[PathBuf], &Path) {
        match (&self.output, self.files.split_last()) {
            (Some(output), _) => (&self.files, output),
            (None, Some((output, inputs))) => (inputs, output),
            (None, None) => (&[], Path::new("")),
        }
    }
}

/// scansion diff A B
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::DIFF)]
pub(crate) struct Diff {
    /// First file
    pub(crate) a: PathBuf,
    /// Second file
    pub(crate) b: PathBuf,
}
