//! Detection of the file format, by the first bytes and then by the name.

use crate::error::{Error, Result};
use crate::io::open;
use std::io::Read;
use std::path::Path;

/// The formats that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Las,
    Ply,
    Pcd,
    E57,
    Npz,
    Ptx,
    Kitti,
    Text,
}

/// List of these formats for messages.
const READABLE: &str = "LAS, LAZ, COPC, PLY, PCD, E57, npz, PTS, PTX, .bin of SemanticKITTI or text";

/// Extensions of the cloud formats that can be written.
const WRITTEN: [&str; 11] = ["las", "laz", "ply", "pcd", "npz", "txt", "xyz", "csv", "asc", "labels", "label"];

pub(super) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Whether the name has the extension of a cloud format that can be written.
pub fn is_cloud_name(path: &Path) -> bool {
    WRITTEN.contains(&extension(path).as_str())
}

/// Whether the name is that of a file of class codes alone.
pub(super) fn is_label_name(path: &Path) -> bool {
    ["labels", "label"].contains(&extension(path).as_str())
}

/// Whether the name has the extension of LAS or LAZ.
pub(super) fn is_las_name(path: &Path) -> bool {
    ["las", "laz"].contains(&extension(path).as_str())
}

/// Fails if the extension is not that of a cloud format that can be written.
pub(super) fn check_target(path: &Path) -> Result<()> {
    let refused = |reason: String| Err(Error::OutputName { path: path.to_path_buf(), reason });
    let name = path.file_name().map(|n| n.to_string_lossy()).unwrap_or_default();
    match extension(path).as_str() {
        "laz" if name.to_lowercase().ends_with(".copc.laz") => {
            let stem = name.get(..name.len() - ".copc.laz".len()).unwrap_or_default();
            refused(format!(
                "COPC is read, not written; name it {stem}.laz, and index that with a COPC writer (untwine, pdal)"
            ))
        }
        known if WRITTEN.contains(&known) => Ok(()),
        other => refused(format!(
            "cannot write {}; use .las, .laz, .ply, .pcd, .npz, .txt, .xyz, .csv, .labels or .label",
            if other.is_empty() { "a file without extension".into() } else { format!(".{other}") }
        )),
    }
}

/// The format by the first bytes; a file without a known magic number is text if its name or its content says so.
pub(super) fn format_of(path: &Path) -> Result<Format> {
    open::refuse_partial(path)?;
    let mut start = Vec::new();
    let file = open::file(path)?;
    file.take(4096).read_to_end(&mut start).map_err(|e| Error::io(path, e))?;
    let unsupported = |reason: String| Err(Error::Unsupported { path: path.to_path_buf(), reason });
    if start.is_empty() {
        return Err(Error::Malformed {
            path: path.to_path_buf(),
            format: "file",
            field: "content".into(),
            place: "byte 0".into(),
            found: "an empty file".into(),
            allowed: READABLE.into(),
        });
    }
    match &start[..] {
        s if s.starts_with(b"LASF") => Ok(Format::Las),
        s if s.starts_with(b"ply") && s.get(3).is_some_and(u8::is_ascii_whitespace) => Ok(Format::Ply),
        s if s.starts_with(b"ASTM-E57") => Ok(Format::E57),
        s if s.starts_with(b"PK") && extension(path) == "npz" => Ok(Format::Npz),
        s if pcd(s) || extension(path) == "pcd" => Ok(Format::Pcd),
        s if s.starts_with(b"OFF") && s.get(3).is_some_and(u8::is_ascii_whitespace) => {
            unsupported("OFF is a mesh, not a scan; convert its vertices to PLY".into())
        }
        _ if extension(path) == "bin" => Ok(Format::Kitti),
        s if s.contains(&0) => {
            unsupported(format!("neither {READABLE} (it begins with {:02x?})", &s[..s.len().min(8)]))
        }
        _ if extension(path) == "ptx" => Ok(Format::Ptx),
        _ => Ok(Format::Text),
    }
}

/// Whether the file starts with the usual PCD comment, or with PCD's first keyword after comments.
fn pcd(start: &[u8]) -> bool {
    let mut lines = start.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    start.starts_with(b"# .PCD")
        || lines
            .find(|l| !l.is_empty() && l[0] != b'#')
            .is_some_and(|l| [&b"VERSION "[..], b"FIELDS ", b"COLUMNS "].iter().any(|keyword| l.starts_with(keyword)))
}
