//! Destinations of feature rows, which are computed in a different order from that of the file.

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::features::Rows;
use scansion_core::io::atomic::AtomicFile;
use scansion_core::parallel::Monitor;
use scansion_core::{Error, Result};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write as _};
use std::path::Path;

/// Bytes of text written at once.
const PIECE: usize = 1 << 20;

/// What the rows of features belong to, and what their columns are called.
#[derive(Clone, Copy)]
pub(crate) struct NamedRows<'a> {
    pub(crate) cloud: &'a Cloud,
    pub(crate) names: &'a [String],
}

/// A file of rows of `f32`, each written at its own offset.
pub(crate) struct RowFile {
    file: AtomicFile,
    /// Bytes before the first row.
    head: u64,
    /// Number of values in a row.
    width: usize,
    bytes: Vec<u8>,
}

impl RowFile {
    /// Creates a file that starts with `head`.
    pub(crate) fn create(path: &Path, head: &[u8], width: usize) -> Result<Self> {
        let mut file = AtomicFile::create(path)?;
        file.write_all(head)?;
        Ok(Self { file, head: head.len() as u64, width, bytes: Vec::new() })
    }

    /// Writes rows; those of consecutive points are written together.
    pub(crate) fn put(&mut self, rows: &Rows) -> Result<()> {
        let mut order: Vec<usize> = (0..rows.points.len()).collect();
        order.sort_unstable_by_key(|&row| rows.points[row]);
        for run in order.chunk_by(|&a, &b| rows.points[a].checked_add(1) == Some(rows.points[b])) {
            self.bytes.clear();
            for &row in run {
                let values = &rows.values[row * self.width..(row + 1) * self.width];
                self.bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
            }
            let at = self.head + u64::from(rows.points[run[0]]) * 4 * self.width as u64;
            let target = self.file.target().to_path_buf();
            let writer = self.file.writer()?;
            let written = writer.seek(SeekFrom::Start(at)).and_then(|_| writer.write_all(&self.bytes));
            written.map_err(|e| Error::io(&target, e))?;
        }
        Ok(())
    }

    /// Gives the file its final name.
    pub(crate) fn finish(self) -> Result<()> {
        self.file.finish()
    }

    /// Writes the rows as text, preceded by the coordinates; the binary file is removed.
    pub(crate) fn write_csv(mut self, path: &Path, named: NamedRows<'_>, monitor: &Monitor) -> Result<()> {
        let NamedRows { cloud, names } = named;
        self.file.flush()?;
        let mut file = AtomicFile::create(path)?;
        file.write_all(format!("x,y,z,{}\n", names.join(",")).as_bytes())?;
        let read = |e| Error::io(path, e);
        let mut rows = BufReader::with_capacity(PIECE, File::open(self.file.partial()).map_err(read)?);
        rows.seek(SeekFrom::Start(self.head)).map_err(read)?;
        let (mut row, mut text) = (vec![0; 4 * self.width], String::new());
        for point in 0..cloud.len() {
            rows.read_exact(&mut row).map_err(read)?;
            let [x, y, z] = cloud.xyz(point);
            let _ = write!(text, "{x},{y},{z}");
            for value in row.as_chunks::<4>().0 {
                let _ = write!(text, ",{}", f32::from_le_bytes(*value));
            }
            text.push('\n');
            if text.len() >= PIECE {
                monitor.check()?;
                file.write_all(text.as_bytes())?;
                text.clear();
            }
        }
        file.write_all(text.as_bytes())?;
        file.finish()
    }
}

/// Feature rows in memory, column by column.
pub(crate) struct RowColumns(Vec<Vec<f32>>);

impl RowColumns {
    /// Allocates this many points and columns.
    pub(crate) fn new(points: usize, columns: usize) -> Result<Self> {
        let column = |_| scansion_core::memory::filled(f32::NAN, points, "a column of features");
        (0..columns).map(column).collect::<Result<_>>().map(Self)
    }

    pub(crate) fn put(&mut self, rows: &Rows) {
        let width = self.0.len();
        for (&point, row) in rows.points.iter().zip(rows.values.chunks_exact(width.max(1))) {
            self.0.iter_mut().zip(row).for_each(|(column, &value)| column[point as usize] = value);
        }
    }

    /// The columns with their names.
    pub(crate) fn named(self, names: &[String]) -> impl Iterator<Item = Column> {
        names.iter().zip(self.0).map(|(name, values)| Column::new(name, Values::F32(values)))
    }
}
