//! Binary records of fixed width, one after the other: binary PLY and binary PCD.

use super::Table;
use super::number::Slot;
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use crate::io::open;
use crate::parallel::Monitor;
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes decoded at once, few enough to stay in the cache while the columns are extracted one by one.
const SLAB: usize = 256 << 10;

/// The destination of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::io) enum Target {
    /// Axis 0, 1 or 2.
    Axis(usize),
    /// A column of the table.
    Column(usize),
}

/// The numbers to read from each record.
#[derive(Clone, Debug, Default)]
pub(in crate::io) struct Layout {
    pub(in crate::io) table: Table,
    pub(in crate::io) slots: Vec<(Target, Slot)>,
}

impl Layout {
    /// Extracts the numbers of some records.
    pub(in crate::io) fn append(&mut self, records: &[u8]) {
        for (target, slot) in &self.slots {
            match *target {
                Target::Axis(a) => slot.append_f64(records, &mut self.table.axes[a]),
                Target::Column(c) => slot.append(records, &mut self.table.columns[c].values),
            }
        }
    }
}

/// Where the records of a file lie; the caller has checked them against its size.
#[derive(Clone, Copy, Debug)]
pub(in crate::io) struct PackedRecords {
    /// Offset of the first record.
    pub(in crate::io) at: u64,
    /// Number of records.
    pub(in crate::io) count: u64,
    /// Bytes of a record.
    pub(in crate::io) width: usize,
}

/// The remaining records of a file.
#[derive(Debug)]
pub(in crate::io) struct Packed {
    path: PathBuf,
    file: File,
    width: usize,
    left: u64,
    layout: Layout,
    monitor: Monitor,
}

impl Packed {
    /// These records of a file, of which each has this layout.
    pub(in crate::io) fn open(path: &Path, records: PackedRecords, layout: Layout, monitor: &Monitor) -> Result<Self> {
        let PackedRecords { at, count, width } = records;
        let mut file = open::file(path)?;
        file.seek(SeekFrom::Start(at)).map_err(|e| Error::io(path, e))?;
        Ok(Self { path: path.to_path_buf(), file, width, left: count, layout, monitor: monitor.clone() })
    }

    /// The next points, at most this many; an empty cloud at the end.
    pub(in crate::io) fn take(&mut self, points: usize) -> Result<Cloud> {
        let mut wanted = points.min(usize::try_from(self.left).unwrap_or(usize::MAX));
        self.layout.table.reserve(wanted)?;
        let most = (SLAB / self.width).max(1);
        let mut slab = vec![0; most.min(wanted) * self.width];
        while wanted > 0 {
            self.monitor.check()?;
            let now = most.min(wanted);
            let bytes = &mut slab[..now * self.width];
            let at = self.file.stream_position().map_err(|e| Error::io(&self.path, e))?;
            open::fill(&self.path, &mut self.file, at, bytes)?;
            self.layout.append(bytes);
            self.left -= now as u64;
            wanted -= now;
            self.monitor.advance(now as u64);
        }
        self.layout.table.take(usize::MAX)
    }
}
