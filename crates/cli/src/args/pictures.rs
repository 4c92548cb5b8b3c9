//! Arguments of `render`.

use super::choices::class_code;
use super::{Unlabelled, examples};
use clap::{Args as ClapArgs, ValueEnum};
use scansion_core::filters::HeightRange;
use std::path::PathBuf;

/// scansion render IN -o OUT.png
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::RENDER)]
pub(crate) struct Render {
    /// Clouds to draw in one picture
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Picture to write (.png); a map gets a world file (.pgw) beside it
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Quantity shown by colour: class, height, rgb, or the name of a dimension [default: class if there is one]
    #[arg(long)]
    pub(crate) by: Option<String>,
    /// Show where the classes differ from those of this cloud, same points in the same order
    #[arg(long, value_name = "FILE", conflicts_with = "by")]
    pub(crate) truth: Option<PathBuf>,
    /// With --truth: a colour for each pair of a true class and another
    #[arg(long, requires = "truth")]
    pub(crate) changes: bool,
    /// With --truth: change codes of the truth before the comparison, e.g. 3-4=5; refused if the drawn cloud has one of
    /// them; may be repeated
    #[arg(long, value_name = "OLD=NEW,...", requires = "truth")]
    pub(crate) map: Vec<String>,
    /// With --truth: change codes of the truth only; may be repeated
    #[arg(long, value_name = "OLD=NEW,...", requires = "truth", conflicts_with = "map")]
    pub(crate) map_truth: Vec<String>,
    /// With --truth: change codes of the drawn cloud only; may be repeated
    #[arg(long, value_name = "OLD=NEW,...", requires = "truth", conflicts_with = "map")]
    pub(crate) map_predicted: Vec<String>,
    /// Compare only points whose true class is one of these
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code, requires = "truth")]
    pub(crate) classes: Vec<u8>,
    /// Codes of the truth that mean "unlabelled", or none: such points are not compared. auto: 0 and 1 in LAS and LAZ,
    /// 0 in Semantic3D, none in other formats
    #[arg(long, value_name = "auto|none|CODES", default_value = "auto", requires = "truth")]
    pub(crate) unlabelled: Unlabelled,
    /// From above, or from the side
    #[arg(long, value_enum, default_value_t = ViewArg::Map)]
    pub(crate) view: ViewArg,
    /// Viewing direction of an oblique view, degrees clockwise from north [default: 30]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    pub(crate) azimuth: Option<f64>,
    /// Elevation of the viewpoint of an oblique view above the horizon, degrees [default: 35]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    pub(crate) elevation: Option<f64>,
    /// Width in pixels
    #[arg(long, default_value_t = 1600)]
    pub(crate) width: u32,
    /// Height in pixels [default: from the shape of the cloud]
    #[arg(long)]
    pub(crate) height: Option<u32>,
    /// Range of the colours of heights and dimensions, low,high [default: from the data]
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) range: Option<String>,
    /// Draw only points of these heights (z, in the unit of the file), e.g. ..2.2 for a room without its ceiling
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) clip: Option<HeightRange>,
    /// Draw the lines of this file (.geojson or .obj, as contours writes them) over the cloud
    #[arg(long, value_name = "FILE")]
    pub(crate) contours: Option<PathBuf>,
    /// Title above the picture
    #[arg(long)]
    pub(crate) title: Option<String>,
    /// No hillshading
    #[arg(long)]
    pub(crate) no_shading: bool,
    /// No legend and scale bar
    #[arg(long)]
    pub(crate) no_legend: bool,
}

/// Kind of picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ViewArg {
    Map,
    Oblique,
}
