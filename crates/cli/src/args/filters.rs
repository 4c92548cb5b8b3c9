//! Arguments of the command that filters points.

use super::choices::class_code;
use super::{GroundArgs, ScaleArgs, examples};
use clap::{Args as ClapArgs, ValueEnum};
use scansion_core::filters::{Area, HeightRange};
use std::path::{Path, PathBuf};

/// scansion filter IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::FILTER)]
pub(crate) struct Filter {
    /// Cloud to filter
    pub(crate) input: PathBuf,
    /// Output: the points that all filters keep
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Keep only points of these classes
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code)]
    pub(crate) classes: Vec<u8>,
    /// Remove points of these classes
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code)]
    pub(crate) drop_classes: Vec<u8>,
    #[command(flatten)]
    pub(crate) noise: NoiseArgs,
    /// Keep only points whose height above ground is in this range, metres: of the dimension HeightAboveGround if the
    /// file has it and no option says how to find the ground, else above the ground, found as in `scansion height`
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) height: Option<HeightRange>,
    /// Keep only points in this box, in the unit of the file: 4 numbers (x and y) or 6, lowest first
    #[arg(long, value_name = "X,Y[,Z],X,Y[,Z]", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) bounds: Vec<f64>,
    /// Keep only points inside these polygons, in the coordinates of the cloud: a GeoJSON file, a file with well-known
    /// text, or well-known text itself
    #[arg(long, value_name = "FILE|WKT")]
    pub(crate) polygon: Option<PathBuf>,
    /// Keep the points outside the polygons instead
    #[arg(long, requires = "polygon")]
    pub(crate) outside: bool,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}

/// Removal of noise.
#[derive(Debug, ClapArgs)]
pub(crate) struct NoiseArgs {
    /// Remove noise
    #[arg(long, value_name = "METHODS", value_enum, value_delimiter = ',')]
    pub(crate) outliers: Vec<OutlierMethod>,
    /// Neighbours to which the mean distance is taken, for statistical outliers [default: 8]
    #[arg(long, value_name = "N", requires = "outliers")]
    pub(crate) neighbours: Option<usize>,
    /// Standard deviations above the mean from which on a distance is that of noise, for statistical outliers
    /// [default: 2]
    #[arg(long, value_name = "X", requires = "outliers", allow_negative_numbers = true)]
    pub(crate) multiplier: Option<f64>,
    /// Distance within which neighbours count, metres, for radius outliers [default: 1]
    #[arg(long, value_name = "METRES", requires = "outliers")]
    pub(crate) radius: Option<f64>,
    /// Points with fewer neighbours are noise, for radius outliers [default: 2]
    #[arg(long, value_name = "N", requires = "outliers")]
    pub(crate) min_neighbours: Option<usize>,
    /// Keep noise, with class 7
    #[arg(long, requires = "outliers")]
    pub(crate) mark: bool,
}

/// A search for noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OutlierMethod {
    /// Points whose mean distance to their nearest neighbours is far above that of all points
    Statistical,
    /// Points with few neighbours within a radius
    Radius,
}

impl Filter {
    /// The file with the polygons, unless they are in the argument itself.
    pub(crate) fn polygon_file(&self) -> Option<&Path> {
        self.polygon.as_deref().filter(|path| !path.to_str().is_some_and(Area::is_wkt))
    }
}
