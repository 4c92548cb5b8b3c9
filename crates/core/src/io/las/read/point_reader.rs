//! Random access to points, in files of any size.

use crate::cloud::{Cloud, CodeScheme, Coordinates, Values};
use crate::error::{Error, Result};
use crate::io::ReadOptions;
use crate::io::las::fields::layout::Layout;
use crate::io::las::header::crs::Projection;
use crate::io::las::header::lookup;
use crate::io::las::records::stream::Stream;
use std::ops::Range;
use std::path::Path;

/// Random access to the points of a LAS or LAZ file, including COPC and chunks of variable size.
///
/// Point `i` is the `i`-th point in the order of the file. Reading a range of an uncompressed file costs the bytes of
/// its records; of a LAZ file the decoding of the chunks that it overlaps. Memory: these chunks and the result.
#[derive(Debug)]
pub struct PointReader {
    stream: Stream,
    layout: Layout,
}

impl PointReader {
    /// Opens a file and checks everything except the points.
    ///
    /// # Errors
    /// If the file is not LAS or LAZ, or malformed.
    pub fn open(path: &Path) -> Result<Self> {
        let stream = Stream::open(path)?;
        let layout = Layout::of(&stream.records.header, &stream.records.vlrs);
        Ok(Self { stream, layout })
    }

    /// Number of points, which may be above 2^32.
    pub fn len(&self) -> u64 {
        self.stream.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The points of a range, with the selected columns.
    ///
    /// # Errors
    /// If the range is not ordered, ends after the last point, or holds 2^32 - 1 points or more; or if a chunk is
    /// damaged.
    pub fn read(&mut self, points: Range<u64>, options: &ReadOptions) -> Result<Cloud> {
        let count = points.end.checked_sub(points.start).filter(|&n| n < u64::from(u32::MAX));
        let (Some(count), true) = (count, points.end <= self.len()) else {
            let text = format!("0..{}, fewer than {} at once", self.len(), u32::MAX);
            return Err(Error::parameter("points", format!("{points:?}"), text));
        };
        self.stream.seek(points.start, &options.monitor)?;
        let bytes = self.stream.next(count as usize, &options.monitor)?;
        let axis = |name| match self.layout.column(name, &bytes).map(|c| c.values) {
            Some(Values::I32(ticks)) => ticks,
            _ => Vec::new(),
        };
        let header = &self.stream.records.header;
        let ticks = [axis("X"), axis("Y"), axis("Z")];
        let mut cloud = Cloud::new(Coordinates::Scaled { ticks, scale: header.scale, offset: header.offset })?;
        (cloud.scheme, cloud.class_names) = (CodeScheme::Asprs, lookup::get(&self.stream.records.vlrs));
        for name in self.layout.names().filter(|n| !["X", "Y", "Z"].contains(n)) {
            if let Some(column) = self.layout.column(name, &bytes).filter(|_| options.wants(name)) {
                cloud.set_column(column)?;
            }
        }
        let records = &self.stream.records;
        let projection = Projection::of(header.wkt(), records.vlrs.iter().chain(&records.evlrs));
        (cloud.crs, cloud.metres_per_unit) = (projection.crs, projection.metres_per_unit);
        Ok(cloud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::las::header::put;
    use std::io::{Seek, SeekFrom, Write};

    /// A sparse LAS 1.4 file with `points` points of format 6, some of whose records are written.
    fn sparse(path: &Path, points: u64, written: &[u64]) {
        let mut raw = vec![0; 375];
        put(&mut raw, 0, b"LASF");
        (raw[24], raw[25], raw[104]) = (1, 4, 6);
        put(&mut raw, 94, &375u16.to_le_bytes());
        put(&mut raw, 96, &375u32.to_le_bytes());
        put(&mut raw, 105, &30u16.to_le_bytes());
        put(&mut raw, 247, &points.to_le_bytes());
        (0..3).for_each(|a| put(&mut raw, 131 + 8 * a, &0.01f64.to_le_bytes()));
        let mut file = std::fs::File::create(path).unwrap();
        file.write_all(&raw).unwrap();
        file.set_len(375 + 30 * points).unwrap();
        for &i in written {
            let mut record = [0; 30];
            put(&mut record, 0, &((i % 1000) as i32 + 1).to_le_bytes());
            put(&mut record, 22, &(i as f64).to_le_bytes());
            file.seek(SeekFrom::Start(375 + 30 * i)).unwrap();
            file.write_all(&record).unwrap();
        }
    }

    #[test]
    fn points_beyond_two_to_the_32_are_counted_and_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sparse.las");
        let (points, edge) = (4_400_000_000u64, 1u64 << 32);
        let written = [0, edge - 1, edge, edge + 5, points - 1];
        sparse(&path, points, &written);
        assert_eq!(crate::io::inspect(&path).unwrap().points, points);
        let mut reader = PointReader::open(&path).unwrap();
        assert_eq!(reader.len(), points);
        for i in written {
            let cloud = reader.read(i..i + 1, &ReadOptions::default()).unwrap();
            assert_eq!(cloud.column("GpsTime").unwrap().values.get(0), i as f64);
            let x = f64::from((i % 1000) as i32 + 1).mul_add(0.01, 0.0);
            assert_eq!(cloud.xyz(0)[0], x);
        }
        let near = reader.read(edge + 3..edge + 8, &ReadOptions::default()).unwrap();
        assert_eq!(near.column("GpsTime").unwrap().values.to_f64(), [0.0, 0.0, (edge + 5) as f64, 0.0, 0.0]);
        assert!(reader.read(points - 1..points + 1, &ReadOptions::default()).is_err());
        let message = crate::io::read(&path).unwrap_err().to_string();
        assert!(message.contains("4400000000"), "{message}");
    }
}
