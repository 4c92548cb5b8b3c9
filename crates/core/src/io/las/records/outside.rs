//! Points outside the bounds in the header: the sign of a damaged file that can still be decoded.

use crate::io::las::header::{Header, array};
use crate::parallel::Monitor;
use rayon::prelude::*;
use std::path::Path;

/// Number of records that one thread checks.
const PIECE: usize = 16_384;

/// Tolerance for the division of two rounded numbers, in ticks.
const SLACK: f64 = 1e-3;

/// Counts the points that lie more than one tick outside the bounds.
#[derive(Clone, Debug)]
pub(in crate::io) struct Outside {
    low: [i32; 3],
    high: [i32; 3],
    seen: u64,
    count: u64,
    first: Option<(u64, [i32; 3])>,
}

impl Outside {
    /// Starts at 0. If the bounds in the header are invalid, nothing is counted: `inspect` warns about that.
    pub(in crate::io) fn new(header: &Header) -> Self {
        let ordered = (0..3).all(|a| header.low[a] <= header.high[a]);
        let tick = |a: usize, v: f64| (v - header.offset[a]) / header.scale[a];
        let (mut low, mut high) = ([i32::MIN; 3], [i32::MAX; 3]);
        for a in (0..3).filter(|_| ordered) {
            // Casts of NaN and of values beyond 32 bits saturate.
            low[a] = (tick(a, header.low[a]) - 1.0 - SLACK).ceil() as i32;
            high[a] = (tick(a, header.high[a]) + 1.0 + SLACK).floor() as i32;
        }
        Self { low, high, seen: 0, count: 0, first: None }
    }

    /// Checks whole records.
    pub(in crate::io) fn add(&mut self, records: &[u8], length: usize) {
        let out = |record: &[u8]| {
            (0..3).fold(false, |out, a| {
                let tick = i32::from_le_bytes(array(record, 4 * a));
                out | (tick < self.low[a]) | (tick > self.high[a])
            })
        };
        let count_in = |piece: &[u8]| piece.chunks_exact(length).map(|record| u64::from(out(record))).sum::<u64>();
        let count: u64 = records.par_chunks(PIECE * length).map(count_in).sum();
        if let (true, None) = (count > 0, self.first) {
            let place = |record: &[u8]| [0, 4, 8].map(|at| i32::from_le_bytes(array(record, at)));
            let mut each = (self.seen..).zip(records.chunks_exact(length));
            self.first = each.find(|(_, record)| out(record)).map(|(i, record)| (i, place(record)));
        }
        self.seen += (records.len() / length) as u64;
        self.count += count;
    }

    /// Adds a warning if there were any.
    pub(in crate::io) fn report(&self, path: &Path, header: &Header, monitor: &Monitor) {
        if let Some(text) = self.sentence(header) {
            monitor.warn(format!("{}: {text}", path.display()));
        }
    }

    /// What to tell the user; `None` if there were none.
    pub(in crate::io) fn sentence(&self, header: &Header) -> Option<String> {
        let (first, ticks) = self.first?;
        let [x, y, z] = [0, 1, 2].map(|a| f64::from(ticks[a]).mul_add(header.scale[a], header.offset[a]));
        let (count, lie) = match self.count {
            1 => (format!("1 of {} points", self.seen), "lies"),
            n => (format!("{n} of {} points", self.seen), "lie"),
        };
        Some(format!(
            "{count} {lie} outside the box that the header tells: the file may be damaged (the first is number {first} at {x}, {y}, \
             {z})"
        ))
    }
}

#[cfg(test)]
mod tests {
    use crate::cloud::Cloud;
    use crate::io::{self, ConvertParams, ReadOptions, WriteOptions};
    use crate::parallel::Monitor;
    use std::path::Path;

    /// A file of 70,000 points, and a copy whose points 60,007 and 60,008 were moved out of the bounds in the header.
    fn files(folder: &Path, extension: &str) -> [std::path::PathBuf; 2] {
        let [sound, damaged] = ["a", "b"].map(|name| folder.join(format!("{name}.{extension}")));
        let mut rows: Vec<[f64; 3]> =
            (0..70_000).map(|i| [f64::from(i % 300) * 0.1, f64::from(i / 300) * 0.1, f64::from(i % 7)]).collect();
        io::write(&sound, &Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
        let header = std::fs::read(&sound).unwrap()[179..227].to_vec();
        (rows[60_007][0], rows[60_008][2]) = (31.5, -0.002);
        io::write(&damaged, &Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
        let mut bytes = std::fs::read(&damaged).unwrap();
        bytes[179..227].copy_from_slice(&header);
        std::fs::write(&damaged, bytes).unwrap();
        [sound, damaged]
    }

    #[test]
    fn every_way_of_reading_tells_of_points_outside_the_header() {
        let folder = tempfile::tempdir().unwrap();
        for extension in ["las", "laz"] {
            let [sound, damaged] = files(folder.path(), extension);
            let copy = folder.path().join(format!("c.{extension}"));
            std::fs::copy(&sound, &copy).unwrap();
            for (file, expected) in [(&sound, 0), (&damaged, 1)] {
                let told = |work: &dyn Fn(&Monitor)| {
                    let monitor = Monitor::default();
                    work(&monitor);
                    let warnings = monitor.take_warnings();
                    assert_eq!(warnings.len(), expected, "{warnings:?}");
                    assert!(warnings.iter().all(|w| w.contains("2 of 70000 points lie outside")), "{warnings:?}");
                    assert!(warnings.iter().all(|w| w.contains("number 60007 at 31.5")), "{warnings:?}");
                };
                let read = |m: &Monitor| ReadOptions { monitor: m.clone(), ..Default::default() };
                let write = |m: &Monitor| WriteOptions { monitor: m.clone(), ..Default::default() };
                let out = folder.path().join("out.laz");
                told(&|m| drop(io::read_with(file, &read(m)).unwrap()));
                told(&|m| assert_eq!(io::blocks(file, 9000, &read(m)).unwrap().count(), 8));
                told(&|m| drop(io::convert(file, &out, &ConvertParams::default(), &write(m)).unwrap()));
                told(&|m| drop(io::convert(file, &out.with_extension("ply"), &Default::default(), &write(m)).unwrap()));
                told(&|m| drop(io::rewrite(file, &out, &[], &write(m)).unwrap()));
                told(&|m| drop(io::merge(&[file.clone(), copy.clone()], &out, &write(m)).unwrap()));
                told(&|m| {
                    drop(io::diff(file, &sound, &ReadOptions { monitor: m.clone(), ..ReadOptions::default() }).unwrap())
                });
            }
        }
    }
}
