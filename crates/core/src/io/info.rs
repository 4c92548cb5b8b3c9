//! What is known of a file: information from its header, its reference system, the losses of a damaged one.

use super::options::Bounds;
use crate::cloud::crs::{Vertical, same};
use crate::error::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Information about a file from its header.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileInfo {
    /// The file.
    pub path: PathBuf,
    /// `LAS`, `LAZ`, `COPC`, `PLY`, `PCD`, `E57`, `npz`, `PTX`, `SemanticKITTI` or `text`.
    pub format: String,
    /// Version of the format.
    pub version: Option<String>,
    /// Point format of LAS, 0..=10.
    pub point_format: Option<u8>,
    /// Number of points.
    pub points: u64,
    /// Smallest and largest coordinates, if the header has them.
    pub bounds: Option<Bounds>,
    /// Scale of the stored integers.
    pub scale: Option<[f64; 3]>,
    /// Offset of the stored integers.
    pub offset: Option<[f64; 3]>,
    /// Coordinate reference system: WKT, `EPSG:n`, or `EPSG:n+m` with a vertical system m.
    pub crs: Option<String>,
    /// Metres per unit of the coordinates, if the file states it.
    pub metres_per_unit: Option<f64>,
    /// Vertical system and unit of heights, if the reference system tells one of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertical: Option<Vertical>,
    /// Names of the columns besides the coordinates.
    pub dimensions: Vec<String>,
    /// User and number of the variable length records.
    pub vlrs: Vec<String>,
    /// How the classes were made, if this program made them: JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub provenance: Option<String>,
    /// The levels of a COPC file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub octree: Option<Octree>,
    /// Warnings about the file.
    pub warnings: Vec<String>,
}

/// The levels of a COPC file; all levels together are the cloud.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Octree {
    /// Point spacing of level 0, in the unit of the file; each level halves it.
    pub spacing: f64,
    /// Number of nodes with points.
    pub nodes: u64,
    /// Number of points on level 0, 1, ...
    pub points_per_level: Vec<u64>,
}

impl FileInfo {
    /// For a file of which only the format and the number of points are known.
    pub(super) fn new(path: &Path, format: &str, points: u64) -> Self {
        Self {
            path: path.to_path_buf(),
            format: format.into(),
            version: None,
            point_format: None,
            points,
            bounds: None,
            scale: None,
            offset: None,
            crs: None,
            metres_per_unit: None,
            vertical: None,
            dimensions: Vec::new(),
            vlrs: Vec::new(),
            provenance: None,
            octree: None,
            warnings: Vec::new(),
        }
    }
}

/// Losses of a damaged file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// Number of points declared in the header.
    pub declared: u64,
    /// Number of points that can be read.
    pub read: u64,
    /// The defects, one sentence each; empty for an intact file.
    pub notes: Vec<String>,
}

impl Losses {
    /// Number of lost points.
    pub fn lost(&self) -> u64 {
        self.declared.saturating_sub(self.read)
    }

    /// Fails if the file has points but none can be read.
    ///
    /// # Errors
    /// Names the file.
    pub fn check_some(&self, path: &Path) -> Result<()> {
        match self.read == 0 && self.declared > 0 {
            true => {
                let (file, declared) = (path.display(), self.declared);
                Err(Error::input(format!("{file}: none of its {declared} points can be read")))
            }
            false => Ok(()),
        }
    }

    /// A sentence for the user.
    pub fn summary(&self) -> String {
        match (self.notes.is_empty(), self.lost()) {
            (true, _) => format!("nothing is lost: {} points", self.read),
            (false, lost) => format!("{lost} of {} points are lost, {} are read", self.declared, self.read),
        }
    }
}

/// The reference system of an input, if it tells one.
#[derive(Clone, Copy)]
pub(in crate::io) struct NamedCrs<'a> {
    path: &'a Path,
    crs: Option<&'a str>,
}

impl<'a> NamedCrs<'a> {
    pub(in crate::io) fn new(path: &'a Path, crs: Option<&'a str>) -> Self {
        Self { path, crs }
    }
}

/// Fails if two files state different reference systems; adds a note if only one states any.
pub(in crate::io) fn check_crs(one: NamedCrs<'_>, other: NamedCrs<'_>, notes: &mut Vec<String>) -> Result<()> {
    let (NamedCrs { path: first, crs: a }, NamedCrs { path, crs: b }) = (one, other);
    match (a, b) {
        (Some(a), Some(b)) if !same(a, b) => {
            let text = format!("{} lies in another reference system than {}", path.display(), first.display());
            Err(Error::input(format!("{text} ({} / {})", shortened(b), shortened(a))))
        }
        (Some(_), None) | (None, Some(_)) => {
            let silent = if b.is_none() { path } else { first };
            notes.push(format!("{} does not tell its reference system; taken as that of the others", silent.display()));
            Ok(())
        }
        _ => Ok(()),
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}
