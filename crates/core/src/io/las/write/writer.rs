//! Writes a LAS or LAZ file record by record, atomically.

use crate::error::{Error, Result};
use crate::io::atomic::AtomicFile;
use crate::io::las::chunks::{encode, encode_table};
use crate::io::las::header::vlr::{Vlr, size_of};
use crate::io::las::header::{RECORD_SIZES, put};
use crate::parallel::{Monitor, map_ordered};
use laz::{LazItemRecordBuilder, LazVlr, LazVlrBuilder};
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

/// Points of a chunk if the input does not define it.
pub(in crate::io::las) const CHUNK: u32 = 50_000;

/// Everything before the points.
pub(in crate::io::las) struct Front {
    /// The header; counts and offsets in it are set by the writer.
    pub(in crate::io::las) header: Vec<u8>,
    pub(in crate::io::las) vlrs: Vec<Vlr>,
    /// Bytes between the VLRs and the points.
    pub(in crate::io::las) gap: Vec<u8>,
    /// Points of a LAZ chunk; `None` writes LAS.
    pub(in crate::io::las) chunk: Option<u32>,
}

/// A file that is being written.
pub(in crate::io::las) struct Writer {
    file: AtomicFile,
    laz: Option<LazVlr>,
    record: usize,
    points_at: u64,
    header: Vec<u8>,
    pending: Vec<u8>,
    sizes: Vec<(u64, u64)>,
    points: u64,
    path: std::path::PathBuf,
}

impl Writer {
    /// Writes header and VLRs.
    pub(in crate::io::las) fn create(path: &Path, mut front: Front) -> Result<Self> {
        let format = front.header[104] & 0x3f;
        let record = usize::from(u16::from_le_bytes(crate::io::las::header::array(&front.header, 105)));
        let extra = (record - usize::from(RECORD_SIZES[usize::from(format)])) as u16;
        front.vlrs.retain(|v| !v.is("laszip encoded", 22204));
        let laz = match front.chunk {
            Some(chunk) => {
                let items = LazItemRecordBuilder::default_for_point_format_id(format, extra)
                    .map_err(|e| Error::Unsupported { path: path.to_path_buf(), reason: e.to_string() })?;
                let vlr = LazVlrBuilder::new(items).with_fixed_chunk_size(chunk).build();
                let mut data = Vec::new();
                vlr.write_to(&mut data).map_err(|e| Error::io(path, e))?;
                front.vlrs.push(Vlr::new("laszip encoded", 22204, "LASzip by https://laszip.org", data));
                Some(vlr)
            }
            None => None,
        };
        front.header[104] = format | if laz.is_some() { 0x80 } else { 0 };
        let points_at = (front.header.len() + size_of(&front.vlrs) + front.gap.len()) as u64;
        let at = u32::try_from(points_at)
            .map_err(|_| Error::input(format!("{points_at} bytes of VLRs; at most 4 GiB fit before the points")))?;
        put(&mut front.header, 96, &at.to_le_bytes());
        put(&mut front.header, 100, &(front.vlrs.len() as u32).to_le_bytes());
        let mut file = AtomicFile::create(path)?;
        file.write_all(&front.header)?;
        for vlr in &front.vlrs {
            file.write_all(&vlr.head)?;
            file.write_all(&vlr.data)?;
        }
        file.write_all(&front.gap)?;
        if laz.is_some() {
            file.write_all(&[0; 8])?;
        }
        let path = path.to_path_buf();
        Ok(Self {
            file,
            laz,
            record,
            points_at,
            header: front.header,
            pending: Vec::new(),
            sizes: Vec::new(),
            points: 0,
            path,
        })
    }

    /// Appends records. Chunks are encoded in parallel as soon as there is one for every thread.
    pub(in crate::io::las) fn push(&mut self, records: &[u8], monitor: &Monitor) -> Result<()> {
        monitor.check()?;
        self.points += (records.len() / self.record) as u64;
        match &self.laz {
            None => self.file.write_all(records),
            Some(vlr) => {
                let chunk = vlr.chunk_size() as usize * self.record;
                self.pending.extend_from_slice(records);
                let full = self.pending.len() / chunk;
                if full >= rayon::current_num_threads() { self.encode(full * chunk, monitor) } else { Ok(()) }
            }
        }
    }

    /// Encodes the first `bytes` pending bytes.
    fn encode(&mut self, bytes: usize, monitor: &Monitor) -> Result<()> {
        let Some(vlr) = &self.laz else { return Ok(()) };
        let chunk = vlr.chunk_size() as usize * self.record;
        let parts: Vec<&[u8]> = self.pending[..bytes].chunks(chunk).collect();
        let encoded = map_ordered(parts.len(), monitor, |i| encode(&self.path, vlr, parts[i]))?;
        for (part, bytes) in parts.iter().zip(&encoded) {
            self.file.write_all(bytes)?;
            self.sizes.push(((part.len() / self.record) as u64, bytes.len() as u64));
        }
        self.pending.drain(..bytes);
        Ok(())
    }

    /// Writes the remaining records, the chunk table, the data after the points, and the header again; verifies and
    /// renames.
    ///
    /// `tail` writes the data after the points and returns their length; `patch` receives their offset and may change
    /// the header.
    pub(in crate::io::las) fn finish(
        mut self,
        monitor: &Monitor,
        tail: impl FnOnce(&mut AtomicFile) -> Result<u64>,
        patch: impl FnOnce(&mut [u8], u64),
    ) -> Result<()> {
        self.encode(self.pending.len(), monitor)?;
        let mut end = self.points_at + self.points * self.record as u64;
        if let Some(vlr) = &self.laz {
            let table_at = self.points_at + 8 + self.sizes.iter().map(|s| s.1).sum::<u64>();
            let table = encode_table(&self.path, vlr, &self.sizes)?;
            end = table_at + table.len() as u64;
            self.file.write_all(&table)?;
            self.overwrite(self.points_at, &table_at.to_le_bytes())?;
        }
        patch(&mut self.header, end);
        let header = std::mem::take(&mut self.header);
        self.overwrite(0, &header)?;
        let length = tail(&mut self.file)?;
        self.file.flush()?;
        self.verify(&header, end + length)?;
        self.file.finish()
    }

    fn overwrite(&mut self, at: u64, bytes: &[u8]) -> Result<()> {
        let path = self.path.clone();
        let writer = self.file.writer()?;
        let back = writer
            .seek(SeekFrom::Start(at))
            .and_then(|_| writer.write_all(bytes))
            .and_then(|()| writer.seek(SeekFrom::End(0)));
        back.map(|_| ()).map_err(|e| Error::io(&path, e))
    }

    /// Opens the written file and compares header (with counts and bounds), chunk table and sizes.
    fn verify(&self, header: &[u8], size: u64) -> Result<()> {
        let written = crate::io::las::records::Records::open(self.file.partial())?;
        let same = written.header.points == self.points && written.header.raw == header;
        match same && written.size == size {
            true => Ok(()),
            false => Err(Error::input(format!(
                "{}: wrote {} points and {} bytes, expected {} points and {size} bytes",
                self.path.display(),
                written.header.points,
                written.size,
                self.points
            ))),
        }
    }
}
