//! Arguments of `contours`.

use super::choices::class_code;
use super::{UnitArgs, examples};
use clap::Args as ClapArgs;
use std::path::PathBuf;

/// scansion contours IN -o OUT.dxf
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::CONTOURS)]
pub(crate) struct Contours {
    /// Cloud whose edges are drawn
    pub(crate) input: PathBuf,
    /// Drawing: .dxf, .gpkg, .geojson, .obj or .ply
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Model of the recipe contours [default: the built-in one]
    #[arg(short, long)]
    pub(crate) model: Option<PathBuf>,
    /// Edge of the voxels that hold one seed of a line each, metres; smaller: finer edges [default: 2 times the spacing of
    /// the points, by area]
    #[arg(long, value_name = "METRES")]
    pub(crate) voxel: Option<f64>,
    /// Leave out the points of these classes, e.g. 3,4,5 for vegetation; what remains may still border on them
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code)]
    pub(crate) without: Vec<u8>,
    /// Leave out lines of a lower confidence, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    pub(crate) min_confidence: f32,
    /// Change one setting of the model's recipe, e.g. trace.tidy.least_length=0.5; may be repeated. Lengths are those for voxels
    /// of 0.1 m and change with the voxel
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
}
