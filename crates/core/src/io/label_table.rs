//! Tables of labels: positions with a class, or segments with a class.

use super::open;
use crate::error::{Error, Result};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// A table of labels: `x,y,z,class`, `cluster_id,class`, or both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelTable {
    /// The file, for messages.
    pub path: PathBuf,
    /// Labelled positions, in the coordinates of the cloud.
    pub positions: Vec<LabelRow<[f64; 3]>>,
    /// Labelled segments.
    pub segments: Vec<LabelRow<LabelledSegment>>,
}

/// A segment that has a label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelledSegment {
    /// Its `ClusterID`.
    pub id: u32,
    /// The position of one of its points, in the coordinates of the cloud, if the table tells it.
    pub at: Option<[f64; 3]>,
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
    Positions { at: [usize; 3], class: usize },
    Segments { id: usize, at: Option<[usize; 3]>, class: usize },
}

/// What the cells of a row mean.
struct Meaning<'a> {
    columns: Columns,
    /// The class code that a number stands for, if any.
    code: &'a dyn Fn(f64) -> Option<u8>,
}

impl LabelTable {
    /// Reads a table as [`LabelTable::read_mapped`], whose codes are 0 to 255.
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_mapped(path, &|value| {
            ((0.0..=255.0).contains(&value) && value.fract().abs() <= 0.0).then_some(value as u8)
        })
    }

    /// Reads a text table, with or without a header. Columns are separated by semicolons, else by commas, else by blanks, as in the
    /// first line. Between semicolons and blanks numbers may have decimal commas. Rows with an empty class are skipped, so that a
    /// partly filled-in list can be used; `#` starts a comment. `code` is the class code that a number stands for.
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read_mapped(path: &Path, code: &dyn Fn(f64) -> Option<u8>) -> Result<Self> {
        let text = open::text(path, open::MOST_TABLE)?;
        let mut table = Self { path: path.to_path_buf(), ..Self::default() };
        let mut meaning = None;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let rows = text.lines().map(str::trim).enumerate();
        let mut rows = rows.filter(|(_, row)| !row.is_empty() && !row.starts_with('#')).peekable();
        let separator = rows.peek().and_then(|(_, row)| [';', ','].into_iter().find(|&c| row.contains(c)));
        for (line, row) in rows {
            let cells = cells(row, separator);
            let cells: Vec<&str> = cells.iter().map(|cell| &**cell).collect();
            match &meaning {
                Some(meaning) => table.take(line + 1, &cells, meaning)?,
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
                    let found = Meaning { columns: found, code };
                    if numbers {
                        table.take(line + 1, &cells, &found)?;
                    }
                    meaning = Some(found);
                }
            }
        }
        match table.positions.is_empty() && table.segments.is_empty() {
            true => Err(Error::input(format!("{}: no row with a class", path.display()))),
            false => Ok(table),
        }
    }

    fn take(&mut self, line: usize, cells: &[&str], meaning: &Meaning<'_>) -> Result<()> {
        let (Columns::Positions { class, .. } | Columns::Segments { class, .. }) = meaning.columns;
        let empty = |column: usize| cells.get(column).is_none_or(|c| c.is_empty());
        if empty(class) {
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
        let place = |[x, y, z]: [usize; 3]| -> Result<[f64; 3]> {
            Ok([number(x, "a number")?, number(y, "a number")?, number(z, "a number")?])
        };
        let value = number(class, "a class code")?;
        let allowed = "a class code, 0 to 255; larger ones need a --map";
        let code = (meaning.code)(value).ok_or_else(|| self.wrong(line, value, allowed))?;
        match meaning.columns {
            Columns::Positions { at, .. } => {
                let of = place(at)?;
                self.positions.push(LabelRow { line, of, code });
            }
            Columns::Segments { id, at, .. } => {
                let id = whole(id, f64::from(u32::MAX), "a ClusterID")? as u32;
                let at = at.filter(|at| !at.iter().all(|&column| empty(column))).map(place).transpose()?;
                self.segments.push(LabelRow { line, of: LabelledSegment { id, at }, code });
            }
        }
        Ok(())
    }

    /// The error about a line.
    pub(crate) fn wrong(&self, line: usize, found: impl std::fmt::Display, allowed: &str) -> Error {
        Error::input(format!("{}:{line}: {found} (allowed: {allowed})", self.path.display()))
    }
}

/// The cells of a row, with decimal points.
fn cells(row: &str, separator: Option<char>) -> Vec<Cow<'_, str>> {
    match separator {
        Some(',') => row.split(',').map(|text| bare(text).into()).collect(),
        Some(separator) => row.split(separator).map(|text| pointed(bare(text))).collect(),
        None => row.split_whitespace().map(|text| pointed(bare(text))).collect(),
    }
}

/// A cell without blanks and quotes around it.
fn bare(cell: &str) -> &str {
    cell.trim().trim_matches('"')
}

/// A number with a decimal comma as one with a point; other texts as they are.
fn pointed(cell: &str) -> Cow<'_, str> {
    match cell.replacen(',', ".", 1) {
        number if cell.contains(',') && number.parse::<f64>().is_ok() => number.into(),
        _ => cell.into(),
    }
}

fn by_count(cells: usize) -> Option<Columns> {
    match cells {
        4 => Some(Columns::Positions { at: [0, 1, 2], class: 3 }),
        2 => Some(Columns::Segments { id: 0, at: None, class: 1 }),
        _ => None,
    }
}

fn by_name(cells: &[&str]) -> Option<Columns> {
    let at = |names: &[&str]| cells.iter().position(|c| names.contains(&c.to_lowercase().as_str()));
    let class = at(&["class", "label", "code", "classification"])?;
    let place = || Some([at(&["x"])?, at(&["y"])?, at(&["z"])?]);
    match at(&["cluster_id", "clusterid", "segment"]) {
        Some(id) => Some(Columns::Segments { id, at: place(), class }),
        None => place().map(|at| Columns::Positions { at, class }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_marks_and_decimal_commas_are_those_of_spreadsheets() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            LabelTable::read(&path)
        };
        let plain = read("x,y,z,class\n-54.83,-40.16,-4.28,2\n").unwrap();
        for text in [
            "\u{feff}x,y,z,class\r\n-54.83,-40.16,-4.28,2\r\n",
            "x;y;z;class\n-54,83;-40,16;-4,28;2\n",
            "x;y;z;class\n-54.83;-40.16;-4.28;2\n",
            "x y z class\n-54,83\t-40,16  -4,28 2\n",
            "# picked by hand\n\"x\",\"y\",\"z\",\"class\"\n-54.83,-40.16,-4.28,2\n",
        ] {
            assert_eq!(
                read(text).unwrap().positions.first().map(|row| (row.of, row.code)),
                Some(([-54.83, -40.16, -4.28], 2)),
                "{text}"
            );
        }
        assert_eq!(plain.positions.len(), 1);
        assert_eq!(read("\u{feff}cluster_id,class\n7,6\n").unwrap().segments.len(), 1);
        assert!(read("x;y;z;class\n1;2;3;2,5\n").unwrap_err().to_string().contains("0 to 255"));
        for wrong in ["1004", "-1", "car", "1e300"] {
            assert!(
                read(&format!("x,y,z,class\n1,2,3,{wrong}\n")).unwrap_err().to_string().contains(":2: "),
                "{wrong}"
            );
        }
        let map = |value: f64| Some(if value > 255.0 { 6 } else { value as u8 });
        std::fs::write(&path, "cluster_id,class\n7,1004\n8,6\n9,5\n").unwrap();
        let codes: Vec<u8> =
            LabelTable::read_mapped(&path, &map).unwrap().segments.iter().map(|row| row.code).collect();
        assert_eq!(codes, [6, 6, 5]);
    }
}
