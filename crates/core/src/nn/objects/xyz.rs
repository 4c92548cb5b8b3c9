//! Folders of objects as text: a file `.xyz` each, with a row `x y z` for each point.

use super::Sample;
use crate::error::{Error, Result};
use crate::io::open;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Bytes of a file that is read, at most.
const MOST: u64 = 4 << 30;

/// An object of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct XyzObject {
    /// The name of its file without `.xyz`.
    pub name: String,
    /// The points.
    pub points: Vec<[f64; 3]>,
}

impl XyzObject {
    /// The points around their mean, in single precision: coordinates of maps have more digits, but only the shape counts.
    /// [`super::Objects::batch`] makes occupied cells of them.
    pub fn sample(&self) -> Sample {
        let count = self.points.len().max(1) as f64;
        let mean: [f64; 3] = std::array::from_fn(|a| self.points.iter().map(|point| point[a]).sum::<f64>() / count);
        let local = |point: &[f64; 3]| std::array::from_fn(|a| (point[a] - mean[a]) as f32);
        Sample::Points(self.points.iter().map(local).collect())
    }
}

/// Reads all files `.xyz` of a folder in the order of their names; what stands after z in a row is ignored.
///
/// # Errors
/// If there is none, the folder cannot be read, or as [`read_xyz`].
pub fn read_xyz_folder(folder: &Path) -> Result<Vec<XyzObject>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()).map_err(|e| Error::io(folder, e)));
    let mut paths = paths.collect::<Result<Vec<PathBuf>>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xyz")));
    paths.sort();
    if paths.is_empty() {
        let reason = "a folder without objects (allowed: one or more files .xyz)".into();
        return Err(Error::Unsupported { path: folder.to_path_buf(), reason });
    }
    let object = |path: &PathBuf| {
        let name = path.file_stem().map(OsStr::to_string_lossy).unwrap_or_default().into_owned();
        Ok(XyzObject { name, points: read_xyz(path)? })
    };
    paths.iter().map(object).collect()
}

/// Reads the points of a file: rows of x, y, z and any further columns, divided by spaces, tabs, commas or semicolons. Empty
/// lines, and what stands after `#`, are left out.
///
/// # Errors
/// [`Error::Malformed`] with the line, also if there is no point.
pub fn read_xyz(path: &Path) -> Result<Vec<[f64; 3]>> {
    let text = open::text(path, MOST)?;
    let mut points = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        let row = line.split('#').next().unwrap_or_default();
        let mut words = row.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()).peekable();
        if words.peek().is_none() {
            continue;
        }
        let mut point = [f64::NAN; 3];
        point.iter_mut().zip(words).for_each(|(slot, word)| *slot = word.parse().unwrap_or(f64::NAN));
        match point.iter().all(|c| c.is_finite()) {
            true => points.push(point),
            false => return Err(malformed(path, number, line, "three finite numbers, then anything")),
        }
    }
    match points.is_empty() {
        true => Err(malformed(path, 1, "no point", "one or more")),
        false => Ok(points),
    }
}

fn malformed(path: &Path, line: usize, found: &str, allowed: &str) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "xyz",
        field: "a point".into(),
        place: format!("line {line}"),
        found: found.chars().take(80).collect(),
        allowed: allowed.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::objects::{ObjectAugmentation, ObjectShape, Objects};
    use crate::random::stream;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
        folder
    }

    #[test]
    fn objects_of_a_folder_become_occupied_cells() {
        let files = [
            ("010.xyz", "700000.25 1 0\n700000.25 1 1\n\n700000.25 1 2.0 77 tree\n"),
            ("002.XYZ", "# x y z\n0,0,0\n3;0\t0 # the other end\n"),
            ("notes.txt", "no object"),
        ];
        let found = read_xyz_folder(folder(&files).path()).unwrap();
        assert_eq!(found.iter().map(|object| &object.name[..]).collect::<Vec<_>>(), ["002", "010"]);
        assert_eq!(found[0].points, [[0.0; 3], [3.0, 0.0, 0.0]]);
        let samples: Vec<Sample> = found.iter().map(XyzObject::sample).collect();
        assert_eq!(samples[1], Sample::Points(vec![[0.0, 0.0, -1.0], [0.0; 3], [0.0, 0.0, 1.0]]));
        let objects = Objects { shape: ObjectShape { channels: 1, extent: vec![4; 3] }, samples, labels: Vec::new() };
        objects.validate().unwrap();
        // The ends of a rod along x, then three cells of one along z.
        let batch = objects.batch(&[0, 1], &ObjectAugmentation::NONE, &mut stream(0, 0)).unwrap();
        assert_eq!(batch.keys(), [10, 58, 64 + 40, 64 + 42, 64 + 43]);
    }

    #[test]
    fn damaged_files_are_refused_with_the_line() {
        let message = |text: &str| read_xyz_folder(folder(&[("a.xyz", text)]).path()).unwrap_err().to_string();
        assert!(message("1 2 3\n4 5\n").contains("line 2"));
        assert!(message("1 2 x\n").contains("three finite numbers"));
        assert!(message("1 2 inf\n").contains("three finite numbers"));
        assert!(message("# nothing\n").contains("no point"));
        assert!(read_xyz_folder(folder(&[]).path()).unwrap_err().to_string().contains("files .xyz"));
        assert!(matches!(read_xyz_folder(Path::new("/no/such/folder")), Err(Error::Io { .. })));
    }
}
