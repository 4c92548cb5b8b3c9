//! Labels of Semantic3D: NAME.labels beside NAME.txt, with one integer 0..=255 a line.

use super::{bad, holds};
use crate::error::{Mismatch, Result};
use crate::io::lines::{Lines, Pieces, lines};
use crate::parallel::Monitor;
use std::path::{Path, PathBuf};

/// The labels that belong to a file.
#[derive(Debug)]
pub(super) struct Labels {
    pub(super) path: PathBuf,
    pub(super) codes: Vec<u8>,
}

/// The file of labels that belongs to a file of points, if there is one.
fn file_beside(path: &Path) -> Option<PathBuf> {
    let file = path.with_extension("labels");
    (file != path && file.is_file()).then_some(file)
}

/// Warns that a file of points with classes of its own has labels beside it, perhaps of an earlier file of that name.
pub(super) fn tell_unread(path: &Path, monitor: &Monitor) {
    if let Some(file) = file_beside(path) {
        let (points, labels) = (path.display(), file.display());
        monitor.warn(format!("{labels} is not read: {points} has classes of its own"));
    }
}

/// Warns that a file of points without classes, which was written, will get those of the labels beside it when it is read.
pub(super) fn tell_read(path: &Path, monitor: &Monitor) {
    if let Some(file) = file_beside(path) {
        let (points, labels) = (path.display(), file.display());
        monitor.warn(format!(
            "{points} has no classes: readers take those of {labels}; remove it if it belongs to other points"
        ));
    }
}

/// Reads the labels, if there are any.
pub(super) fn beside(path: &Path) -> Result<Option<Labels>> {
    let Some(file) = file_beside(path) else { return Ok(None) };
    let mut reader = Lines::open(&file, "text", 0, 0)?;
    let mut codes = Vec::new();
    while let Some((number, line)) = reader.next()? {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
        if !holds(line) {
            continue;
        }
        let word = std::str::from_utf8(line).unwrap_or("\u{fffd}");
        codes.push(
            word.parse().map_err(|_| bad(&file, "label", [number, 1], Mismatch::new(word, "a whole number 0..255")))?,
        );
    }
    Ok(Some(Labels { path: file, codes }))
}

impl Labels {
    /// Fails if the number of labels is not that of the points; the lines may include a header row.
    pub(super) fn check_lines(&self, points: &Path) -> Result<()> {
        let mut pieces = Pieces::open(points, "text", 0)?;
        let mut found = 0;
        while let Some(piece) = pieces.next()? {
            found += lines(&piece).filter(|line| holds(line)).count();
        }
        match (found..=found + 1).contains(&self.codes.len()) || self.codes.len() + 1 == found {
            true => Ok(()),
            false => Err(self.wrong(points, found)),
        }
    }

    /// The error about a wrong number of labels.
    pub(super) fn wrong(&self, points: &Path, found: usize) -> crate::error::Error {
        let allowed = format!("{found} as {} has points", points.display());
        bad(&self.path, "number of labels", [0, 0], Mismatch::new(self.codes.len(), allowed))
    }
}
