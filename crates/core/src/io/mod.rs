//! Reading and writing files: LAS, LAZ, PLY, PCD, E57, npz, text. The format is detected by content, then by name.

pub mod atomic;
mod blocks;
mod drawings;
mod e57;
mod format;
mod info;
mod kitti;
mod label_table;
mod las;
mod lines;
mod maps;
mod npz;
pub mod open;
mod operations;
mod options;
mod pcd;
mod ply;
mod ptx;
mod reader;
pub mod run;
mod table;
mod text;
mod verify;

pub use blocks::{Blocks, blocks};
pub use drawings::{Drawing, DrawnLine, check_drawing_output, read_lines, write_drawing};
pub use format::is_cloud_name;
pub use info::{FileInfo, Octree};
pub use label_table::{LabelRow, LabelTable, LabelledSegment};
pub use options::{Bounds, Columns, ReadOptions, Selection, WriteOptions};

pub use atomic::abandon_outputs;
pub use atomic::check_output;
pub use las::{LasFrame, PointReader, ProjectionRecord, las_frame, las_georeference, las_wkt};
pub use maps::{Georeference, Outline, Outlines, check_outline_output, check_raster_output};
pub use maps::{geojson, outlines_of, read_ascii_grid, write_outlines, write_raster};
pub use operations::convert::{ConvertParams, convert};
pub use operations::diff::{Changed, ClassChange, Difference, FieldDifference, diff};
pub use operations::merge::{merge, read_together};
pub use operations::select::{rewrite, select};
pub use operations::{salvage, statistics};
pub use table::known::name as column_name;

use crate::cloud::crs::{GEOCENTRIC, Unit, contradiction, is_geocentric, unit_of, unknown_vertical, vertical_of};
use crate::cloud::{Cloud, Column};
use crate::error::{Error, Result};
use format::{Format, check_target, extension, format_of, is_label_name, is_las_name};
use std::path::Path;
use table::limits::Names;

/// One change made by [`rewrite`] or [`select`]; values in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// New class codes.
    Classification(Vec<u8>),
    /// A dimension, added or replaced.
    Dimension(Column),
    /// New colours: red, green, blue. In LAS 257 times these values, in a point format that has colours.
    Colour(Vec<[u8; 3]>),
    /// Names of class codes, stored in the Classification Lookup record of LAS; existing names are kept.
    ClassNames(Vec<(u8, String)>),
    /// Names of class codes that replace existing ones.
    OtherClassNames(Vec<(u8, String)>),
    /// How the classes were made, as text, stored in a record of LAS, for other formats in the file `NAME.EXT.json` beside
    /// it.
    Provenance(String),
}

/// Report of [`rewrite`] and of what else writes files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RewriteReport {
    /// Points written.
    pub points: u64,
    /// Changes besides the edits, for the user.
    pub notes: Vec<String>,
}

/// Reads a cloud with all its columns.
///
/// # Errors
/// As [`read_with`].
pub fn read(path: &Path) -> Result<Cloud> {
    read_with(path, &ReadOptions::default())
}

/// Reads a cloud with the selected columns.
///
/// # Errors
/// If the file cannot be opened, is malformed (the message gives field, position, what was found and what is allowed),
/// or its kind is not supported.
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    options.validate()?;
    run::joined(&options.monitor, || {
        let cloud = read_any(path, options)?;
        run::unchanged(path).map(|()| cloud)
    })
}

fn read_any(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let format = format_of(path)?;
    check_resolution(format, options)?;
    let mut cloud = match format {
        Format::Las => las::read(path, options),
        Format::Text => text::read(path, options),
        Format::Ply => ply::read(path, options),
        Format::Pcd => pcd::read(path, options),
        Format::E57 => e57::read(path, options),
        Format::Npz => npz::read(path, options),
        Format::Ptx => ptx::read(path, options),
        Format::Kitti => kitti::read(path, options),
    }?;
    options.settle(&mut cloud, path)?;
    match &options.bounds {
        Some(bounds) if format != Format::Las => Ok(inside(&cloud, bounds)),
        _ => Ok(cloud),
    }
}

fn check_resolution(format: Format, options: &ReadOptions) -> Result<()> {
    match options.resolution {
        Some(resolution) if format != Format::Las => {
            Err(Error::parameter("resolution", resolution, "none: only COPC files have levels"))
        }
        _ => Ok(()),
    }
}

/// The points of a cloud inside a box.
fn inside(cloud: &Cloud, [low, high]: &Bounds) -> Cloud {
    let within = |i: &u32| {
        let p = cloud.xyz(*i as usize);
        (0..3).all(|a| low[a] <= p[a] && p[a] <= high[a])
    };
    cloud.select(&(0..cloud.len() as u32).filter(within).collect::<Vec<_>>())
}

/// Writes a cloud in the format of the path's extension: `.las`, `.laz`, `.ply`, `.pcd`, `.npz`, `.txt`, `.xyz`, `.csv`,
/// `.labels` (Semantic3D), `.label` (SemanticKITTI).
///
/// # Errors
/// If the extension is not that of a format that can be written, the format cannot store the cloud, or the file cannot
/// be written.
pub fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    check_target(path)?;
    match extension(path).as_str() {
        "las" | "laz" => las::write(path, cloud, options),
        "ply" => ply::write(path, cloud, options),
        "pcd" => pcd::write(path, cloud, options),
        "npz" => npz::write(path, cloud, options),
        "label" => kitti::write(path, cloud, options),
        _ => text::write(path, cloud, options),
    }
}

/// Fails if a cloud could not be written to this path later: [`check_output`], and the extension. To be called before
/// long work.
pub fn check_cloud_output(path: &Path) -> Result<()> {
    check_target(path)?;
    check_output(path)
}

/// Fails if [`rewrite`] could not add these dimensions later, judged by their names and types. To be called before long
/// work.
///
/// # Errors
/// If two of them have one name, the input has a dimension of the same name and another type, or records would become
/// too long.
pub fn check_dimensions(input: &Path, output: &Path, added: &[Column]) -> Result<()> {
    for (number, column) in added.iter().enumerate() {
        if added[..number].iter().any(|other| other.name == column.name) {
            let expected = "a name that no other dimension of the result has";
            return Err(Error::parameter("dimension", &column.name, expected));
        }
    }
    match is_las_name(output) && format_of(input)? == Format::Las {
        true => las::check_dimensions(input, output, added),
        false => Ok(()),
    }
}

/// Fails if a result may not be written to a dimension of this name: those of coordinates and of the fields of LAS are taken.
/// In other formats than LAS their usual spellings are too, which are read as these fields.
///
/// # Errors
/// If the name is taken.
pub fn check_dimension_name(output: &Path, name: &str) -> Result<()> {
    let field = if is_las_name(output) { name.to_string() } else { table::known::name(name) };
    match table::known::is_taken(name) || las::is_field(&field) {
        true => Err(Error::parameter("dimension", name, "a name that neither coordinates nor fields of LAS have")),
        false => Ok(()),
    }
}

/// Fails if a result could not be stored in a file of this name, because it holds nothing but classes; `what` names the
/// result.
///
/// # Errors
/// If the name is that of a file of labels.
pub fn check_holds(path: &Path, what: &str) -> Result<()> {
    match is_label_name(path) {
        true => Err(Error::OutputName {
            path: path.to_path_buf(),
            reason: format!("such a file holds classes only, not {what}; use another format"),
        }),
        false => Ok(()),
    }
}

/// Fails if a cloud that is to be written from `input` to `output` does not fit LAS: its coordinates must be finite and
/// a scale must fit them. To be called before long work.
///
/// # Errors
/// As [`write`](fn@write) of LAS and LAZ, and if a scale is requested from LAS to LAS.
pub fn check_coordinates(input: &Path, output: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    check_scale(input, output, cloud, options)?;
    match is_las_name(output) && !las::is_las(input)? {
        true => las::check_finite(cloud, &options.monitor),
        false => Ok(()),
    }
}

/// Fails if no LAS scale fits a cloud; its points that are not finite may be removed before it is written.
pub(crate) fn check_scale(input: &Path, output: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    match (is_las_name(output), las::is_las(input)?) {
        (true, true) => options.keeps_steps(),
        (true, false) => las_frame(cloud, options).map(|_| ()),
        (false, _) => Ok(()),
    }
}

/// How the classes of a file were made, from the file beside it; `None` if that is not there, or is another program's.
fn provenance_beside(path: &Path) -> Option<String> {
    let file = operations::select::beside(path);
    // It is no input: a run that writes the cloud again writes it too.
    let small = std::fs::metadata(&file).is_ok_and(|about| about.is_file() && about.len() <= open::MOST_SETTINGS);
    let text = small.then(|| std::fs::read_to_string(&file).ok()).flatten()?;
    let value: serde_json::Value = serde_json::from_str(&text).ok()?;
    value["program"].as_str()?.starts_with("scansion").then_some(text)
}

/// Information from the header of a file; for text also its number of lines.
///
/// # Errors
/// If the file cannot be opened, its header is malformed, or its kind is not supported.
pub fn inspect(path: &Path) -> Result<FileInfo> {
    inspect_with(path, &[])
}

/// As [`inspect()`], with names for the columns of text ([`ReadOptions::text_columns`]).
///
/// # Errors
/// As [`inspect()`].
pub fn inspect_with(path: &Path, text_columns: &[String]) -> Result<FileInfo> {
    let mut info = match format_of(path)? {
        Format::Las => las::inspect(path),
        Format::Pcd => pcd::inspect(path),
        Format::E57 => e57::inspect(path),
        Format::Npz => npz::inspect(path),
        Format::Ptx => ptx::inspect(path),
        Format::Kitti => kitti::inspect(path),
        Format::Text => text::inspect(path, text_columns),
        Format::Ply => ply::inspect(path),
    }?;
    // As the columns are named when they are read.
    let mut names = Names::default();
    info.dimensions.iter_mut().for_each(|name| *name = names.free(name));
    info.provenance = info.provenance.or_else(|| provenance_beside(path));
    if let (None, Some(Unit::Length(metres))) = (info.metres_per_unit, info.crs.as_deref().and_then(unit_of)) {
        info.metres_per_unit = Some(metres);
    }
    info.vertical = info.crs.as_deref().and_then(vertical_of);
    info.warnings.extend(info.crs.as_deref().and_then(unknown_vertical));
    info.warnings.extend(info.crs.as_deref().and_then(contradiction));
    if info.crs.as_deref().is_some_and(is_geocentric) {
        info.warnings.push(GEOCENTRIC.into());
    }
    Ok(info)
}
