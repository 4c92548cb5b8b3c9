//! Tables of labels: positions with a class, or segments with a class.

use super::open;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// A table of labels: `x,y,z,class` or `cluster_id,class`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelTable {
    /// The file, for messages.
    pub path: PathBuf,
    /// Labelled positions, in the coordinates of the cloud.
    pub positions: Vec<LabelRow<[f64; 3]>>,
    /// Labelled segments (`ClusterID`).
    pub segments: Vec<LabelRow<u32>>,
}

/// A row of a table of labels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelRow<T> {
    /// Line of the file, from 1.
    pub line: usize,
    /// What has the class.
    pub of: T,
    /// The class code.
    pub code: u8,
}

/// Indices of the columns of a table.
enum Columns {
    Positions([usize; 4]),
    Segments([usize; 2]),
}

impl LabelTable {
    /// Reads a text table separated by commas, semicolons or blanks, with or without a header line. Rows with an empty
    /// class are skipped, so that a partly filled-in list can be used; `#` starts a comment.
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read(path: &Path) -> Result<Self> {
        let text = open::text(path, open::MOST_TABLE)?;
        let mut table = Self { path: path.to_path_buf(), ..Self::default() };
        let mut columns = None;
        for (line, row) in text.lines().map(str::trim).enumerate() {
            if row.is_empty() || row.starts_with('#') {
                continue;
            }
            let cells = cells(row);
            match &columns {
                Some(columns) => table.take(line + 1, &cells, columns)?,
                None => {
                    let numbers = cells.iter().all(|c| c.parse::<f64>().is_ok());
                    let found = if numbers { by_count(cells.len()) } else { by_name(&cells) };
                    let found = found.ok_or_else(|| {
                        table.wrong(
                            line + 1,
                            format!("columns {}", cells.join(", ")),
                            "x,y,z,class or cluster_id,class",
                        )
                    })?;
                    if numbers {
                        table.take(line + 1, &cells, &found)?;
                    }
                    columns = Some(found);
                }
            }
        }
        match table.positions.is_empty() && table.segments.is_empty() {
            true => Err(Error::input(format!("{}: no row with a class", path.display()))),
            false => Ok(table),
        }
    }

    fn take(&mut self, line: usize, cells: &[&str], columns: &Columns) -> Result<()> {
        let class = match columns {
            Columns::Positions([.., class]) | Columns::Segments([_, class]) => *class,
        };
        if cells.get(class).is_none_or(|c| c.is_empty()) {
            return Ok(());
        }
        let number = |column: usize, allowed: &str| {
            let cell = cells.get(column).copied().unwrap_or_default();
            let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| self.wrong(line, format!("{cell:?} in column {}", column + 1), allowed))
        };
        let whole = |column: usize, most: f64, allowed: &str| {
            let value = number(column, allowed)?;
            match (0.0..=most).contains(&value) && value.fract().abs() <= 0.0 {
                true => Ok(value),
                false => Err(self.wrong(line, value, allowed)),
            }
        };
        let code = whole(class, 255.0, "a class code, 0 to 255")? as u8;
        match columns {
            Columns::Positions([x, y, z, _]) => {
                let at = [number(*x, "a number")?, number(*y, "a number")?, number(*z, "a number")?];
                self.positions.push(LabelRow { line, of: at, code });
            }
            Columns::Segments([segment, _]) => {
                let segment = whole(*segment, f64::from(u32::MAX), "a ClusterID")? as u32;
                self.segments.push(LabelRow { line, of: segment, code });
            }
        }
        Ok(())
    }

    /// The error about a line.
    pub(crate) fn wrong(&self, line: usize, found: impl std::fmt::Display, allowed: &str) -> Error {
        Error::input(format!("{}:{line}: {found} (allowed: {allowed})", self.path.display()))
    }
}

fn cells(row: &str) -> Vec<&str> {
    match row.contains([',', ';']) {
        true => row.split([',', ';']).map(|c| c.trim().trim_matches('"')).collect(),
        false => row.split_whitespace().collect(),
    }
}

fn by_count(cells: usize) -> Option<Columns> {
    match cells {
        4 => Some(Columns::Positions([0, 1, 2, 3])),
        2 => Some(Columns::Segments([0, 1])),
        _ => None,
    }
}

fn by_name(cells: &[&str]) -> Option<Columns> {
    let at = |names: &[&str]| cells.iter().position(|c| names.contains(&c.to_lowercase().as_str()));
    let class = at(&["class", "label", "code", "classification"])?;
    if let Some(segment) = at(&["cluster_id", "clusterid", "segment"]) {
        return Some(Columns::Segments([segment, class]));
    }
    Some(Columns::Positions([at(&["x"])?, at(&["y"])?, at(&["z"])?, class]))
}
