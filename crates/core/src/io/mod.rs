//! Reading and writing files: LAS, LAZ, PLY, text. What a file is is told by its content, then by its name.

pub mod atomic;
mod convert;
mod diff;
mod las;
mod merge;
mod ply;
pub mod salvage;
pub mod statistics;
mod text;

pub use convert::{ConvertParams, convert};
pub use diff::{Changed, ClassChange, Difference, FieldDifference, diff};
pub use las::PointReader;
pub use merge::merge;

use crate::cloud::{Cloud, Column};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde::Serialize;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Which columns are read besides the coordinates.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Columns {
    /// All.
    #[default]
    All,
    /// Those of these names, where the file has them.
    Only(Vec<String>),
}

/// Settings of [`read_with`].
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Which columns are read besides the coordinates.
    pub columns: Columns,
    /// Progress and cancellation.
    pub monitor: Monitor,
}

impl ReadOptions {
    fn wants(&self, name: &str) -> bool {
        match &self.columns {
            Columns::All => true,
            Columns::Only(names) => names.iter().any(|n| n == name),
        }
    }
}

/// Settings of [`write`](fn@write) and [`rewrite`].
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Progress and cancellation.
    pub monitor: Monitor,
}

/// One change that [`rewrite`] makes; values in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// New class codes.
    Classification(Vec<u8>),
    /// A dimension, added or replaced.
    Dimension(Column),
    /// Names of class codes, kept in the Classification Lookup record of LAS; names that a file has already stay.
    ClassNames(Vec<(u8, String)>),
}

/// What [`rewrite`] did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RewriteReport {
    /// Points written.
    pub points: u64,
    /// What changed besides the edits, for the user.
    pub notes: Vec<String>,
}

/// What a file says of itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileInfo {
    /// The file.
    pub path: PathBuf,
    /// `LAS`, `LAZ`, `PLY` or `text`.
    pub format: String,
    /// Version of the format.
    pub version: Option<String>,
    /// Point format of LAS.
    pub point_format: Option<u8>,
    /// Number of points.
    pub points: u64,
    /// Smallest and largest coordinates.
    pub bounds: Option<([f64; 3], [f64; 3])>,
    /// Size of a tick of the stored integers.
    pub scale: Option<[f64; 3]>,
    /// Offset of the stored integers.
    pub offset: Option<[f64; 3]>,
    /// WKT or `EPSG:n`.
    pub crs: Option<String>,
    /// Metres in one unit of the coordinates, if the file says so.
    pub metres_per_unit: Option<f64>,
    /// Names of the columns besides the coordinates.
    pub dimensions: Vec<String>,
    /// User and number of the variable length records.
    pub vlrs: Vec<String>,
    /// What is odd about the file.
    pub warnings: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Las,
    Ply,
    Text,
}

/// Reads a cloud with all its columns.
pub fn read(path: &Path) -> Result<Cloud> {
    read_with(path, &ReadOptions::default())
}

/// Reads a cloud with the wanted columns.
///
/// # Errors
/// The file cannot be opened, is malformed (the message names field, place, what was found and what is allowed), or is of
/// a kind that is not supported.
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    match format_of(path)? {
        Format::Las => las::read(path, options),
        Format::Ply => ply::read(path, options),
        Format::Text => text::read(path, options),
    }
}

/// Writes a cloud in the format of the path's extension: `.las`, `.laz`, `.ply`, `.txt`, `.xyz`, `.csv`, `.labels`.
pub fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    match extension(path).as_str() {
        "las" | "laz" => las::write(path, cloud, options),
        "ply" => ply::write(path, cloud),
        "txt" | "xyz" | "csv" | "asc" | "labels" => text::write(path, cloud),
        other => Err(Error::Unsupported {
            path: path.to_path_buf(),
            reason: format!("cannot write .{other}; use .las, .laz, .ply, .txt, .xyz, .csv or .labels"),
        }),
    }
}

/// Copies a file with the edits applied; everything else of a LAS or LAZ file stays as it is, byte for byte.
///
/// From other formats, or into them, the cloud is read and written. `output` may be `input`.
pub fn rewrite(input: &Path, output: &Path, edits: &[Edit], options: &WriteOptions) -> Result<RewriteReport> {
    let las = ["las", "laz"].contains(&extension(output).as_str());
    if format_of(input)? == Format::Las && las {
        return las::rewrite(input, output, edits, options);
    }
    let mut cloud = read_with(input, &ReadOptions { monitor: options.monitor.clone(), ..ReadOptions::default() })?;
    apply(&mut cloud, edits)?;
    write(output, &cloud, options)?;
    Ok(RewriteReport { points: cloud.len() as u64, notes: Vec::new() })
}

/// Puts the edits into a cloud.
fn apply(cloud: &mut Cloud, edits: &[Edit]) -> Result<()> {
    for edit in edits {
        cloud.set_column(match edit {
            Edit::Classification(codes) => {
                Column::new(crate::cloud::names::CLASSIFICATION, crate::cloud::Values::U8(codes.clone()))
            }
            Edit::Dimension(column) => column.clone(),
            Edit::ClassNames(_) => continue,
        })?;
    }
    Ok(())
}

/// What a file says of itself. For LAS and LAZ only the header is read; other formats are read whole.
pub fn inspect(path: &Path) -> Result<FileInfo> {
    let format = format_of(path)?;
    if format == Format::Las {
        return las::inspect(path);
    }
    let cloud = read(path)?;
    Ok(FileInfo {
        path: path.to_path_buf(),
        format: if format == Format::Ply { "PLY" } else { "text" }.into(),
        version: None,
        point_format: None,
        points: cloud.len() as u64,
        bounds: cloud.bounds(),
        scale: None,
        offset: None,
        crs: None,
        metres_per_unit: None,
        dimensions: cloud.columns().iter().map(|c| c.name.clone()).collect(),
        vlrs: Vec::new(),
        warnings: Vec::new(),
    })
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// By the first bytes; what begins with no known magic is text if its name or its bytes say so.
fn format_of(path: &Path) -> Result<Format> {
    let mut start = Vec::new();
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    file.take(4096).read_to_end(&mut start).map_err(|e| Error::io(path, e))?;
    let unsupported = |reason: String| Err(Error::Unsupported { path: path.to_path_buf(), reason });
    if start.is_empty() {
        return Err(Error::Malformed {
            path: path.to_path_buf(),
            format: "file",
            field: "content".into(),
            place: "byte 0".into(),
            found: "an empty file".into(),
            allowed: "LAS, LAZ, PLY or text".into(),
        });
    }
    match &start[..] {
        s if s.starts_with(b"LASF") => Ok(Format::Las),
        s if s.starts_with(b"ply") && s.get(3).is_some_and(u8::is_ascii_whitespace) => Ok(Format::Ply),
        s if s.starts_with(b"ASTM-E57") => {
            unsupported("E57 is not supported yet; convert it to LAS, LAZ or PLY".into())
        }
        s if s.contains(&0) => {
            unsupported(format!("neither LAS, LAZ, PLY nor text (it begins with {:02x?})", &s[..s.len().min(8)]))
        }
        _ => Ok(Format::Text),
    }
}
