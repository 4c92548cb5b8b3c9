//! Arguments of the commands about terrain.

use super::choices::class_code;
use super::{ScaleArgs, UnitArgs, examples};
use clap::Args as ClapArgs;
use std::path::PathBuf;

/// How the ground is found.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct GroundArgs {
    /// Edge of a cell, metres [default: 1]
    #[arg(long, value_name = "METRES")]
    pub(crate) cell: Option<f64>,
    /// Classes of the ground [default: 2 if there are such points, else the ground filter]
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code, conflicts_with = "ground_filter")]
    pub(crate) ground_classes: Vec<u8>,
    /// Find the ground by the ground filter, whatever the classes are
    #[arg(long)]
    pub(crate) ground_filter: bool,
    /// Half the width, metres, up to which the ground filter finds buildings by their width; wider ones are found by their
    /// walls [default: 27]
    #[arg(long, value_name = "METRES")]
    pub(crate) window: Option<f64>,
    /// Slope, rise over run, above which the ground filter sees an object on level terrain [default: 0.12]
    #[arg(long, value_name = "SLOPE")]
    pub(crate) slope: Option<f64>,
    /// Least height of the walls around roofs wider than the window, metres; 0: these are not looked for [default: 2]
    #[arg(long, value_name = "METRES")]
    pub(crate) wall: Option<f64>,
    /// Classes that are left out, or none [default: 7 and 18, noise, in LAS and LAZ]
    #[arg(long, value_name = "CODES|none")]
    pub(crate) noise_classes: Option<String>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
}

/// scansion terrain IN... -o DTM
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::TERRAIN)]
pub(crate) struct Terrain {
    /// Cloud to map, or its tiles (`*`, `?` and `[...]` are expanded)
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Terrain model: heights of the ground, as GeoTIFF (.tif) or ESRI ASCII grid (.asc)
    #[arg(short, long, visible_alias = "dtm", value_name = "FILE", required_unless_present_any = ["dsm", "chm", "contours", "footprints"])]
    pub(crate) output: Option<PathBuf>,
    /// Surface model: the highest point of each cell
    #[arg(long, value_name = "FILE")]
    pub(crate) dsm: Option<PathBuf>,
    /// Heights of the surface above the terrain: buildings, trees
    #[arg(long, value_name = "FILE")]
    pub(crate) chm: Option<PathBuf>,
    /// Lines of equal height of the terrain model, as DXF, GeoPackage, GeoJSON, OBJ or PLY
    #[arg(long, value_name = "FILE")]
    pub(crate) contours: Option<PathBuf>,
    /// Difference of height from one line to the next, in the unit of the cloud
    #[arg(long, value_name = "HEIGHT", default_value_t = 1.0, requires = "contours")]
    pub(crate) interval: f64,
    /// Leave out shorter lines of equal height, metres
    #[arg(long, value_name = "METRES", default_value_t = 5.0, requires = "contours")]
    pub(crate) min_length: f64,
    /// Outlines of buildings with area, height and number of points, as GeoJSON (.geojson) or GeoPackage (.gpkg)
    #[arg(long, value_name = "FILE")]
    pub(crate) footprints: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
    /// Leave cells of the terrain model empty that are farther than this from all ground points, metres
    #[arg(long, value_name = "METRES", default_value_t = 100.0)]
    pub(crate) reach: f64,
    /// Classes of buildings
    #[arg(long, value_name = "CODES", value_delimiter = ',', value_parser = class_code, default_value = "6",
        requires = "footprints")]
    pub(crate) building_classes: Vec<u8>,
    /// Leave out buildings of a smaller area, and close smaller holes, m²
    #[arg(long, value_name = "AREA", default_value_t = 10.0, requires = "footprints")]
    pub(crate) min_area: f64,
    /// Simplify outlines by up to this distance, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.5, requires = "footprints")]
    pub(crate) tolerance: f64,
    /// Separate buildings by gaps wider than twice this, metres; larger than the distance between points [default: twice
    /// that distance, at least 1]
    #[arg(long, value_name = "METRES", requires = "footprints")]
    pub(crate) alpha: Option<f64>,
}

/// scansion height IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::HEIGHT)]
pub(crate) struct Height {
    /// Cloud whose heights are computed
    pub(crate) input: PathBuf,
    /// Output: the input with the dimension HeightAboveGround
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}
