//! Sequential and random access to records, without the whole file in memory.

use super::Records;
use crate::error::{Error, Result};
use crate::io::las::chunks::unpack::Unpacker;
use crate::io::las::header::vlr::read_at;
use crate::parallel::Monitor;
use std::collections::VecDeque;
use std::path::Path;

/// The records of a file in order, from a position that can be moved.
pub(in crate::io) struct Stream {
    pub(in crate::io) records: Records,
    /// Index of the next point to return.
    next: u64,
    /// First point of each chunk, and the number of points at the end; empty if not compressed.
    starts: Vec<u64>,
    /// The chunks that were not decoded yet.
    unpacker: Unpacker,
    /// Decoded records that have not been returned; the first is that of point `ready_from`.
    ready: VecDeque<Vec<u8>>,
    ready_from: u64,
    /// Number of chunks decoded at once: one after a seek, more as sequential reading continues.
    ahead: usize,
}

impl std::fmt::Debug for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stream").field("path", &self.records.path).field("next", &self.next).finish()
    }
}

impl Stream {
    /// Opens a file, positioned at its first point.
    pub(in crate::io) fn open(path: &Path) -> Result<Self> {
        Ok(Self::of(Records::open(path)?))
    }

    /// From an open file, positioned at its first point.
    pub(in crate::io) fn of(records: Records) -> Self {
        let mut starts = Vec::new();
        if let Some(chunks) = &records.chunks {
            let mut first = 0;
            starts.push(0);
            for chunk in &chunks.list {
                first += chunk.points;
                starts.push(first);
            }
        }
        let ready = VecDeque::new();
        Self { records, next: 0, starts, unpacker: Unpacker::default(), ready, ready_from: 0, ahead: 1 }
    }

    /// Number of points.
    pub(in crate::io) fn len(&self) -> u64 {
        self.records.header.points
    }

    /// Bytes of a record.
    pub(in crate::io) fn record_length(&self) -> usize {
        usize::from(self.records.header.record_length)
    }

    /// Moves to a point. Costs the decoding of its chunk up to it, nothing if the file is not compressed.
    ///
    /// # Errors
    /// If the point does not exist.
    pub(in crate::io) fn seek(&mut self, point: u64, monitor: &Monitor) -> Result<()> {
        if point > self.len() {
            return Err(Error::input(format!("point {point} of {} points", self.len())));
        }
        self.next = point;
        let near = point >= self.ready_from && point < self.ready_end();
        if self.starts.is_empty() || near {
            return self.drop_delivered();
        }
        let chunk = self.starts.partition_point(|&s| s <= point).saturating_sub(1);
        (self.ready, self.unpacker, self.ahead) = (VecDeque::new(), Unpacker::from(chunk), 1);
        self.ready_from = self.starts[chunk];
        while self.ready_end() <= point && point < self.len() {
            self.decode(monitor)?;
            self.drop_delivered()?;
        }
        Ok(())
    }

    /// The next `most` records, fewer at the end, none after it.
    pub(in crate::io) fn next(&mut self, most: usize, monitor: &Monitor) -> Result<Vec<u8>> {
        monitor.check()?;
        let length = self.record_length();
        let count = (self.len() - self.next).min(most as u64) as usize;
        if self.starts.is_empty() {
            let at = self.records.header.points_at + self.next * length as u64;
            self.next += count as u64;
            return read_at(&self.records.path, &mut self.records.file, at, count * length);
        }
        let mut out = Vec::with_capacity(count * length);
        while out.len() < count * length {
            if self.ready.is_empty() {
                self.decode(monitor)?;
                self.ahead = (2 * self.ahead).min(rayon::current_num_threads().max(1));
            }
            let Some(front) = self.ready.front() else { break };
            let from = (self.next - self.ready_from) as usize * length;
            let to = front.len().min(from + count * length - out.len());
            out.extend_from_slice(&front[from..to]);
            self.next += ((to - from) / length) as u64;
            self.drop_delivered()?;
        }
        Ok(out)
    }

    /// The point after the decoded ones.
    fn ready_end(&self) -> u64 {
        let bytes: usize = self.ready.iter().map(Vec::len).sum();
        self.ready_from + (bytes / self.record_length()) as u64
    }

    /// Discards records before the next point.
    fn drop_delivered(&mut self) -> Result<()> {
        while let Some(front) = self.ready.front() {
            let points = (front.len() / self.record_length()) as u64;
            if self.ready_from + points > self.next {
                break;
            }
            self.ready_from += points;
            self.ready.pop_front();
        }
        Ok(())
    }

    /// Decodes more records: a piece of a large chunk, or a few small chunks in parallel.
    fn decode(&mut self, monitor: &Monitor) -> Result<()> {
        let decoded = self.records.unpack(&mut self.unpacker, self.ahead, monitor)?;
        self.ready.extend(decoded);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cloud;
    use crate::io::{self, WriteOptions};

    #[test]
    fn the_point_found_by_seeking_is_the_point_met_on_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let rows: Vec<[f64; 3]> =
            (0..320_000).map(|i| [f64::from(i % 997), f64::from(i / 997), f64::from(i % 13)]).collect();
        let monitor = Monitor::default();
        for name in ["a.las", "a.laz"] {
            let path = folder.path().join(name);
            io::write(&path, &Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
            let mut stream = Stream::open(&path).unwrap();
            let (mut all, length) = (Vec::new(), stream.record_length());
            loop {
                let block = stream.next(33_333, &monitor).unwrap();
                if block.is_empty() {
                    break;
                }
                all.extend(block);
            }
            assert_eq!(all.len(), rows.len() * length);
            for point in [319_999usize, 0, 49_999, 50_000, 50_001, 7, 299_999, 120_000] {
                stream.seek(point as u64, &monitor).unwrap();
                let found = stream.next(3, &monitor).unwrap();
                let expected = &all[point * length..((point + 3) * length).min(all.len())];
                assert!(found == expected, "{name} {point}");
            }
            assert!(stream.seek(320_001, &monitor).is_err());
        }
    }

    /// Block by block, a file whose chunks are decoded in pieces gives what it gives as a whole.
    #[test]
    fn chunks_too_large_to_be_decoded_at_once_are_read_to_their_end() {
        use crate::io::las::write::writer::{Front, Writer};
        let folder = tempfile::tempdir().unwrap();
        let (plain, path) = (folder.path().join("a.las"), folder.path().join("a.laz"));
        let rows: Vec<[f64; 3]> = (0..450_000).map(|i| [f64::from(i % 997), f64::from(i / 997), 0.5]).collect();
        io::write(&plain, &Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
        let monitor = Monitor::default();
        let mut records = Records::open(&plain).unwrap();
        let front = Front {
            header: records.header.raw.clone(),
            vlrs: records.vlrs.clone(),
            gap: Vec::new(),
            chunk: Some(300_000),
        };
        let mut writer = Writer::create(&path, front).unwrap();
        records.for_each(&monitor, |slab| writer.push(slab.bytes, &monitor)).unwrap();
        writer.finish(&monitor, |_| Ok(0), |_, _| {}).unwrap();
        let points: usize =
            io::blocks(&path, 70_000, &Default::default()).unwrap().map(|block| block.unwrap().len()).sum();
        assert_eq!(points, rows.len());
        assert!(io::read(&path).unwrap().coordinates() == io::read(&plain).unwrap().coordinates());
    }
}
