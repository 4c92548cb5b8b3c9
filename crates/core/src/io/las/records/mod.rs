//! The raw records of a LAS or LAZ file, slab by slab, in the order of the file.

pub(super) mod outside;
pub(super) mod stream;
pub(super) mod tally;

use super::chunks::unpack::{Compressed, Unpacker, slab};
use super::chunks::{self, Chunks, LasHead};
use super::fields::extra::{self, Extra};
use super::header::vlr::{Vlr, read_evlrs, read_vlrs};
use super::header::{Header, bad};
use crate::error::{Error, Mismatch, Result};
use crate::io::open;
use crate::parallel::Monitor;
use laz::DecompressionSelection;
use rayon::prelude::*;
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// An open LAS or LAZ file with checked header, records and chunk table.
#[derive(Debug)]
pub(in crate::io) struct Records {
    pub(in crate::io) path: PathBuf,
    pub(in crate::io) file: File,
    pub(in crate::io) size: u64,
    pub(in crate::io) header: Header,
    pub(in crate::io) vlrs: Vec<Vlr>,
    /// Bytes between the last VLR and the points.
    pub(in crate::io) gap: Vec<u8>,
    pub(in crate::io) evlrs: Vec<Vlr>,
    pub(in crate::io) chunks: Option<Chunks>,
    /// Fields that are decoded, if the compression allows a selection (point formats from 6 on).
    pub(super) selection: DecompressionSelection,
}

/// Consecutive records: those of the points `points`.
pub(in crate::io) struct Slab<'a> {
    pub(in crate::io) points: Range<usize>,
    pub(in crate::io) bytes: &'a mut [u8],
}

impl Records {
    /// Opens a file and checks everything except the points.
    pub(in crate::io) fn open(path: &Path) -> Result<Self> {
        let mut file = open::file(path)?;
        let size = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let header = Header::read(path, &mut file, size)?;
        let (vlrs, gap) = read_vlrs(path, &mut file, &header)?;
        let evlrs = read_evlrs(path, &mut file, &header, size)?;
        let chunks = match header.compressed {
            true => Some(chunks::read_table(path, &mut file, LasHead { header: &header, vlrs: &vlrs }, size)?),
            false => None,
        };
        let selection = DecompressionSelection::all();
        Ok(Self { path: path.to_path_buf(), file, size, header, vlrs, gap, evlrs, chunks, selection })
    }

    /// Number of points.
    ///
    /// # Errors
    /// If there are 2^32 - 1 or more: such files must be read in parts.
    pub(in crate::io) fn len(&self) -> Result<usize> {
        match u32::try_from(self.header.points) {
            Ok(n) if n < u32::MAX => Ok(n as usize),
            _ => Err(bad(
                &self.path,
                "number of points",
                247,
                Mismatch::new(self.header.points, format!("fewer than {} for one cloud", u32::MAX)),
            )),
        }
    }

    /// The extra dimensions described in a VLR or EVLR, and the bytes without a descriptor.
    pub(in crate::io) fn extras(&self) -> (Vec<Extra>, usize) {
        extra::described(&self.header, self.vlrs.iter().chain(&self.evlrs))
    }

    /// All records in order. Chunks are decoded in parallel; memory for a few chunks a thread.
    pub(in crate::io) fn for_each(
        &mut self,
        monitor: &Monitor,
        mut work: impl FnMut(Slab<'_>) -> Result<()>,
    ) -> Result<()> {
        let total = self.len()?;
        let length = usize::from(self.header.record_length);
        if self.chunks.is_some() {
            return self.for_each_chunk(monitor, work);
        }
        let step = slab(length);
        let mut slab = vec![0; step.min(total) * length];
        self.file.seek(SeekFrom::Start(self.header.points_at)).map_err(|e| Error::io(&self.path, e))?;
        for first in (0..total).step_by(step) {
            monitor.check()?;
            let points = first..(first + step).min(total);
            let bytes = &mut slab[..points.len() * length];
            let at = self.header.points_at + (points.start * length) as u64;
            open::fill(&self.path, &mut self.file, at, bytes)?;
            work(Slab { points, bytes })?;
        }
        Ok(())
    }

    fn for_each_chunk(&mut self, monitor: &Monitor, mut work: impl FnMut(Slab<'_>) -> Result<()>) -> Result<()> {
        let length = usize::from(self.header.record_length);
        let (mut first, mut unpacker) = (0, Unpacker::default());
        loop {
            let decoded = self.unpack(&mut unpacker, rayon::current_num_threads(), monitor)?;
            if decoded.is_empty() {
                return Ok(());
            }
            for mut bytes in decoded {
                let points = first..first + bytes.len() / length;
                first = points.end;
                work(Slab { points, bytes: &mut bytes })?;
            }
        }
    }

    /// The records of the next chunks, at most `most` of them; none after the last chunk or without compression.
    fn unpack(&mut self, unpacker: &mut Unpacker, most: usize, monitor: &Monitor) -> Result<Vec<Vec<u8>>> {
        let Some(chunks) = &self.chunks else { return Ok(Vec::new()) };
        let (path, file, selection) = (&*self.path, &mut self.file, self.selection);
        let length = usize::from(self.header.record_length);
        unpacker.next(Compressed { path, file, chunks, selection, length }, most, monitor)
    }
}

/// Records from point `first` on, each with its index in the cloud, in parallel if that is faster.
pub(in crate::io) fn par_records(
    bytes: &mut [u8],
    first: usize,
    length: usize,
) -> impl IndexedParallelIterator<Item = (usize, &mut [u8])> {
    bytes.par_chunks_exact_mut(length).with_min_len(8192).enumerate().map(move |(i, record)| (first + i, record))
}
