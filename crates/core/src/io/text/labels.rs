//! Labels of Semantic3D: NAME.labels beside NAME.txt, with one integer 0..=255 a line.

use super::{bad, holds};
use crate::error::{Mismatch, Result};
use crate::io::lines::{Lines, Pieces, lines};
use std::path::{Path, PathBuf};

/// The labels that belong to a file.
#[derive(Debug)]
pub(super) struct Labels {
    pub(super) path: PathBuf,
    pub(super) codes: Vec<u8>,
}

/// Reads the labels, if there are any.
pub(super) fn beside(path: &Path) -> Result<Option<Labels>> {
    let file = path.with_extension("labels");
    if file == path || !file.is_file() {
        return Ok(None);
    }
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
