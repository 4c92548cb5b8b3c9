//! Reading text, piece by piece.

use super::bad;
use super::labels::{self, Labels};
use super::layout::{self, Layout};
use super::rows::{self, Fault};
use crate::cloud::{Cloud, CodeScheme, Column, Coordinates, Values, names};
use crate::error::{Mismatch, Result};
use crate::io::lines::{Pieces, count, cut};
use crate::io::reader::BlockReader;
use crate::io::{FileInfo, ReadOptions};
use crate::memory;
use crate::parallel::{Monitor, map_ordered};
use std::path::{Path, PathBuf};

/// Number of parts of a piece of 4 MiB, each read by one thread.
const PARTS: usize = 16;

/// Reads a file block by block.
#[derive(Debug)]
pub(in crate::io) struct Reader {
    path: PathBuf,
    monitor: Monitor,
    pieces: Pieces,
    /// The piece in which the layout was found, from its first data row on.
    first: Option<Vec<u8>>,
    /// Number of lines before the next piece.
    lines: usize,
    layout: Layout,
    /// Index in `columns` for each number of a row.
    targets: Vec<Option<usize>>,
    /// Buffered rows: x, y, z, then those of `kept`.
    columns: Vec<Vec<f64>>,
    kept: Vec<String>,
    labels: Option<Labels>,
    /// Number of points returned so far.
    given: usize,
}

impl Reader {
    pub(in crate::io) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let mut pieces = Pieces::open(path, "text", 0)?;
        let (layout, first, lines) = layout::find(path, &mut pieces, &options.text_columns)?;
        let labels = match layout.names.iter().any(|name| name == names::CLASSIFICATION) {
            true => {
                labels::tell_unread(path, &options.monitor);
                None
            }
            false => labels::beside(path)?,
        };
        if let Some(labels) = &labels {
            labels.check_lines(path)?;
        }
        if let Some(line) = layout.guessed.as_ref().filter(|_| labels.is_none()) {
            options.monitor.warn(format!(
                "{}: no names of columns: the first line, {line:?}, is taken as {} (--columns names them)",
                path.display(),
                layout.names.join(", ")
            ));
        }
        let (mut targets, mut kept) = (Vec::new(), Vec::new());
        for (c, name) in layout.names.iter().enumerate() {
            targets.push(layout.axes.iter().position(|&a| a == c).or_else(|| {
                options.wants(name).then(|| {
                    kept.push(name.clone());
                    2 + kept.len()
                })
            }));
        }
        let length = std::fs::metadata(path).map_or(0, |m| m.len());
        options.monitor.stage("read", length);
        let columns = vec![Vec::new(); 3 + kept.len()];
        let (path, monitor) = (path.to_path_buf(), options.monitor.clone());
        Ok(Self { path, monitor, pieces, first, lines, layout, targets, columns, kept, labels, given: 0 })
    }

    fn rows(&self) -> usize {
        self.columns[0].len()
    }

    /// Reads another piece; false at the end.
    fn more(&mut self) -> Result<bool> {
        let mut piece = match self.first.take() {
            Some(piece) => piece,
            None => match self.pieces.next()? {
                Some(piece) => piece,
                None => return Ok(false),
            },
        };
        if self.layout.decimal_commas {
            piece.iter_mut().filter(|byte| **byte == b',').for_each(|byte| *byte = b'.');
        }
        let parts = cut(&piece, PARTS);
        let width = self.columns.len();
        let read = map_ordered(parts.len(), &self.monitor, |i| {
            let room = rows::room(parts[i], self.targets.len(), width)?;
            Ok(rows::read(parts[i], &self.targets, room))
        })?;
        for (part, rows) in parts.iter().zip(read) {
            let rows = rows.map_err(|fault| self.fault(fault))?;
            append(&mut self.columns, rows)?;
            self.lines += count(part);
        }
        self.monitor.advance(piece.len() as u64);
        Ok(true)
    }

    fn fault(&self, fault: Fault) -> crate::error::Error {
        bad(&self.path, fault.field, [self.lines + fault.line, fault.column], Mismatch::new(fault.found, fault.allowed))
    }

    /// Checks that all declared points exist, and no labels are left over.
    fn check_end(&self) -> Result<()> {
        let found = self.given + self.rows();
        if let Some(labels) = self.labels.as_ref().filter(|l| l.codes.len() != found) {
            return Err(labels.wrong(&self.path, found));
        }
        match self.layout.declared.filter(|&n| n != found as u64) {
            None => Ok(()),
            Some(n) => {
                let allowed = format!("{found} as there are lines; renamed to .xyz the file is read as it is");
                Err(bad(&self.path, "number of points", [1, 1], Mismatch::new(n, allowed)))
            }
        }
    }
}

impl BlockReader for Reader {
    fn take(&mut self, points: usize) -> Result<Cloud> {
        while self.rows() < points {
            if !self.more()? {
                self.check_end()?;
                break;
            }
        }
        let n = points.min(self.rows());
        let mut columns = self.columns.iter_mut().map(|column| {
            let rest = column.split_off(n);
            std::mem::replace(column, rest)
        });
        let mut next = || columns.next().unwrap_or_default();
        let mut cloud = Cloud::new(Coordinates::Float([next(), next(), next()]))?;
        for name in &self.kept {
            cloud.set_column(Column::new(name, Values::F64(next())))?;
        }
        if let Some(labels) = &self.labels {
            let codes = labels.codes.get(self.given..self.given + n);
            let codes = codes.ok_or_else(|| labels.wrong(&self.path, self.given + n))?;
            cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(codes.to_vec())))?;
            cloud.scheme = CodeScheme::Semantic3d;
        }
        self.given += n;
        Ok(cloud)
    }
}

/// Appends rows, column by column.
fn append(columns: &mut [Vec<f64>], rows: Vec<Vec<f64>>) -> Result<()> {
    for (column, rows) in columns.iter_mut().zip(rows) {
        // The capacity is doubled as in any vector, so that values are copied once on average.
        if column.try_reserve(rows.len()).is_err() {
            memory::reserve(column, rows.len(), "the numbers of a text file")?;
        }
        column.extend_from_slice(&rows);
    }
    Ok(())
}

/// Reads all points; codes and colours become integers if they are whole numbers.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let mut reader = Reader::open(path, options)?;
    let mut cloud = reader.take(usize::MAX)?;
    for name in &reader.kept {
        if let Some(Column { values: Values::F64(numbers), .. }) = cloud.column(name)
            && let Some(values) = typed(name, numbers)
        {
            cloud.set_column(Column::new(name, values))?;
        }
    }
    Ok(cloud)
}

/// Codes and colours as integers if they are whole numbers; `None` if they stay as they were read.
fn typed(name: &str, numbers: &[f64]) -> Option<Values> {
    let whole = |most: f64| numbers.iter().all(|v| (0.0..=most).contains(v) && v.fract().to_bits() << 1 == 0);
    let colour = names::COLOUR.contains(&name);
    match name {
        n if (n == names::CLASSIFICATION || colour) && whole(255.0) => {
            Some(Values::U8(numbers.iter().map(|&v| v as u8).collect()))
        }
        _ if colour && whole(65_535.0) => Some(Values::U16(numbers.iter().map(|&v| v as u16).collect())),
        _ => None,
    }
}

/// Names from the first lines, number of points from the number of lines; no number is parsed.
pub(in crate::io) fn inspect(path: &Path, text_columns: &[String]) -> Result<FileInfo> {
    let reader = Reader::open(path, &ReadOptions { text_columns: text_columns.to_vec(), ..ReadOptions::default() })?;
    let mut pieces = reader.pieces;
    let holding = |piece: &[u8]| crate::io::lines::lines(piece).filter(|line| super::holds(line)).count() as u64;
    let mut points = reader.first.as_deref().map_or(0, holding);
    while let Some(piece) = pieces.next()? {
        points += holding(&piece);
    }
    let mut info = FileInfo::new(path, "text", points);
    info.dimensions = reader.kept;
    if reader.labels.is_some() {
        info.dimensions.push(names::CLASSIFICATION.into());
    }
    Ok(info)
}
