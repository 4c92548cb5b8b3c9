//! Information about a file from its header.

use super::options::Bounds;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Information about a file from its header.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileInfo {
    /// The file.
    pub path: PathBuf,
    /// `LAS`, `LAZ`, `COPC`, `PLY`, `PCD`, `E57`, `npz`, `PTX` or `text`.
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
    /// Coordinate reference system: WKT or `EPSG:n`.
    pub crs: Option<String>,
    /// Metres per unit of the coordinates, if the file states it.
    pub metres_per_unit: Option<f64>,
    /// Names of the columns besides the coordinates.
    pub dimensions: Vec<String>,
    /// User and number of the variable length records.
    pub vlrs: Vec<String>,
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
            dimensions: Vec::new(),
            vlrs: Vec::new(),
            octree: None,
            warnings: Vec::new(),
        }
    }
}
