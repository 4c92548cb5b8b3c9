//! Files for geographic information systems: rasters of heights (GeoTIFF, ESRI ASCII grid) and outlines (GeoJSON,
//! GeoPackage).

mod ascii_grid;
mod geojson;
mod geopackage;
mod geotiff;
mod outlines;
mod sqlite;

pub use ascii_grid::read_ascii_grid;
pub use geojson::{Outlines, geojson, outlines_of};
pub(in crate::io) use geojson::{collection, feature, places};
pub(in crate::io) use geopackage::{Feature, Layer, bounds, rounded, written};
pub use outlines::{check_outline_output, write_outlines};

use super::check_output;
use super::format::extension;
use crate::cloud::crs::{
    Unit, Vertical, contradiction, is_place, other_unit, same_length, unit_of, vertical_of, vertical_unit_of,
};
use crate::cloud::{Cloud, Raster};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde_json::{Map, Value};
use std::path::Path;

/// The number that stands for a hole.
const NODATA: f32 = -9999.0;

/// Where coordinates lie on earth, as a cloud's file states it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Georeference {
    /// Reference system: WKT, `EPSG:n`, or `EPSG:n+m` with a vertical system m.
    pub crs: Option<String>,
    /// Metres per unit of x and y, and of heights unless the system tells another unit for them.
    pub metres_per_unit: Option<f64>,
}

impl Georeference {
    /// That of a cloud whose unit is a length; a system in degrees is then not that of its coordinates.
    pub fn of(cloud: &Cloud) -> Self {
        let crs = cloud.crs.clone().filter(|crs| !matches!(unit_of(crs), Some(Unit::Angle(_))));
        Self { crs, metres_per_unit: cloud.metres_per_unit }
    }

    /// Metres per unit of heights: as the vertical part of the system says, unless the unit of x and y is not that of the
    /// system (`--unit`); then that of x and y.
    pub fn metres_per_height(&self) -> Option<f64> {
        let crs = self.crs.as_deref().unwrap_or_default();
        let overridden = match (unit_of(crs), self.metres_per_unit) {
            (Some(Unit::Length(own)), Some(given)) => !same_length(own, given),
            _ => false,
        };
        vertical_unit_of(crs).filter(|_| !overridden).or(self.metres_per_unit)
    }

    /// Fails if the unit is not a length, or the system contradicts itself.
    pub(in crate::io) fn check(&self) -> Result<()> {
        if let Some(problem) = self.crs.as_deref().and_then(contradiction) {
            return Err(Error::input(problem));
        }
        match self.metres_per_unit {
            Some(metres) if !(metres.is_finite() && metres > 0.0) => {
                Err(Error::parameter("metres_per_unit", metres, "a number above 0, finite"))
            }
            _ => Ok(()),
        }
    }

    /// Whether the system tells more than a unit.
    pub fn is_known(&self) -> bool {
        self.crs.as_deref().is_some_and(is_place)
    }

    /// Warns of the system and unit of heights, of which a file that tells the system of x and y has only the numbers.
    pub(in crate::io) fn warn_of_heights(&self, path: &Path, monitor: &Monitor) {
        let Some(Vertical { code, .. }) = self.crs.as_deref().and_then(vertical_of) else { return };
        let system = code.map(|code| format!("EPSG:{code}"));
        let unit = self.metres_per_height().map(|metres| format!("unit {metres} m"));
        let told = [system, unit].into_iter().flatten().collect::<Vec<_>>().join(", ");
        monitor.warn(format!("{}: not kept: the system of heights ({told})", path.display()));
    }

    /// Warns if a file of this name could tell the reference system, but not this one, or has no room for the unit.
    pub(in crate::io) fn warn_of_loss(&self, path: &Path, monitor: &Monitor) {
        let kind = extension(path);
        if ["geojson", "json", "gpkg"].contains(&kind.as_str()) {
            let unit = other_unit(self.metres_per_unit, self.crs.as_deref());
            unit.iter().for_each(|text| monitor.warn(format!("{}: {text}", path.display())));
        }
        let (lost, what) = match kind.as_str() {
            "tif" | "tiff" => {
                (geotiff::loses(self), "has neither an EPSG code nor a projected system in short plain WKT 1")
            }
            "geojson" | "json" => (geojson::loses(self), "has no EPSG code"),
            _ => return,
        };
        if lost && self.is_known() {
            monitor.warn(format!("{}: not kept: the coordinate reference system, which {what}", path.display()));
        }
    }
}

/// A polygon with properties.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Corners of the outer ring (counter-clockwise), then of each hole (clockwise), not repeated at the end.
    pub rings: Vec<Vec<[f64; 2]>>,
    /// Names and values.
    pub properties: Map<String, Value>,
}

/// Fails if a raster could not be written to this path later: its extension, or [`check_output`]. To be called before
/// long work.
///
/// # Errors
/// If the extension is neither `.tif`, `.tiff` nor `.asc`, or the file could not be written.
pub fn check_raster_output(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "tif" | "tiff" | "asc" => check_output(path),
        _ => refused(path, "a raster is written as GeoTIFF (.tif, .tiff) or as ESRI ASCII grid (.asc)"),
    }
}

/// Writes a raster whose coordinates and heights are in the unit of the reference system, the northernmost row first.
///
/// `.tif` and `.tiff` are GeoTIFF (32-bit floats, deflate), with the EPSG codes of the system and the units of x, y and
/// heights; `.asc` is an ESRI ASCII grid, which has no place for them. Holes are -9999 in both. Heights are rounded to
/// `f32`. O(cells).
///
/// # Errors
/// As [`check_raster_output`], if a height is -9999 or beyond the range of `f32`, the unit is not above 0, the system
/// contradicts itself (`EPSG:7405+5703`), or the work was cancelled.
pub fn write_raster(path: &Path, raster: &Raster, place: &Georeference, monitor: &Monitor) -> Result<()> {
    place.check()?;
    check_heights(raster, monitor)?;
    place.warn_of_loss(path, monitor);
    match extension(path).as_str() {
        "tif" | "tiff" => geotiff::write(path, raster, place, monitor),
        "asc" => ascii_grid::write(path, raster, monitor),
        _ => check_raster_output(path),
    }
}

/// Fails if a height would be read as a hole, or as infinite.
fn check_heights(raster: &Raster, monitor: &Monitor) -> Result<()> {
    let (values, columns) = (raster.values(), raster.columns());
    let wrong = |v: f64| !v.is_nan() && ((v as f32).is_infinite() || (v as f32).to_bits() == NODATA.to_bits());
    for (row, heights) in values.chunks(columns).enumerate() {
        monitor.check()?;
        if let Some(column) = heights.iter().position(|&v| wrong(v)) {
            let (height, north) = (heights[column], raster.rows() - 1 - row);
            return Err(Error::input(format!(
                "height {height} in row {north} from the north, column {column}: the file's 32-bit numbers cannot hold it, \
                 or it stands for a hole there (allowed: up to 3.4e38, not {NODATA}; NaN for a hole)"
            )));
        }
    }
    Ok(())
}

/// The heights of one row; the first row is the northernmost.
fn row_from_north(raster: &Raster, row: usize) -> impl Iterator<Item = f32> {
    let start = (raster.rows() - 1 - row) * raster.columns();
    raster.values()[start..start + raster.columns()].iter().map(|&v| if v.is_nan() { NODATA } else { v as f32 })
}

fn refused(path: &Path, reason: &str) -> Result<()> {
    Err(Error::OutputName { path: path.to_path_buf(), reason: reason.into() })
}
