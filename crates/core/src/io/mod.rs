//! Reading and writing files: LAS, LAZ, PLY, PCD, E57, npz, text. What a file is is told by its content, then by its name.

pub mod atomic;
mod blocks;
mod convert;
mod decimal;
mod diff;
mod e57;
mod format;
mod info;
mod known;
mod las;
mod limits;
mod lines;
mod merge;
mod npz;
mod number;
pub mod open;
mod options;
mod packed;
mod pcd;
mod ply;
mod print;
mod ptx;
pub mod salvage;
pub mod statistics;
mod table;
mod text;
mod verify;
mod words;

pub use blocks::{Blocks, blocks};
pub use info::{FileInfo, Octree};
pub use options::{Bounds, Columns, ReadOptions, WriteOptions};

pub use convert::{ConvertParams, convert};
pub use diff::{Changed, ClassChange, Difference, FieldDifference, diff};
pub use las::PointReader;
pub use merge::merge;

use crate::cloud::{Cloud, Column};
use crate::error::{Error, Result};
use format::{Format, extension, format_of};
use std::path::Path;

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
    options.validate()?;
    let format = format_of(path)?;
    check_resolution(format, options)?;
    let cloud = match format {
        Format::Las => las::read(path, options),
        Format::Text => text::read(path, options),
        Format::Ply => ply::read(path, options),
        Format::Pcd => pcd::read(path, options),
        Format::E57 => e57::read(path, options),
        Format::Npz => npz::read(path, options),
        Format::Ptx => ptx::read(path, options),
    }?;
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

/// The points of a cloud in a box.
fn inside(cloud: &Cloud, (low, high): &Bounds) -> Cloud {
    let within = |i: &u32| {
        let p = cloud.xyz(*i as usize);
        (0..3).all(|a| low[a] <= p[a] && p[a] <= high[a])
    };
    cloud.select(&(0..cloud.len() as u32).filter(within).collect::<Vec<_>>())
}

/// Writes a cloud in the format of the path's extension: `.las`, `.laz`, `.ply`, `.pcd`, `.npz`, `.txt`, `.xyz`, `.csv`,
/// `.labels`.
pub fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    match extension(path).as_str() {
        "las" | "laz" => las::write(path, cloud, options),
        "ply" => ply::write(path, cloud, options),
        "pcd" => pcd::write(path, cloud, options),
        "npz" => npz::write(path, cloud, options),
        "txt" | "xyz" | "csv" | "asc" | "labels" => text::write(path, cloud, options),
        other => Err(Error::Unsupported {
            path: path.to_path_buf(),
            reason: format!("cannot write .{other}; use .las, .laz, .ply, .pcd, .npz, .txt, .xyz, .csv or .labels"),
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

/// What a file says of itself: its header, and for text the number of its lines.
pub fn inspect(path: &Path) -> Result<FileInfo> {
    match format_of(path)? {
        Format::Las => las::inspect(path),
        Format::Pcd => pcd::inspect(path),
        Format::E57 => e57::inspect(path),
        Format::Npz => npz::inspect(path),
        Format::Ptx => ptx::inspect(path),
        Format::Text => text::inspect(path),
        Format::Ply => ply::inspect(path),
    }
}
