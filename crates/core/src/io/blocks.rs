//! Reading files in blocks of points, so that the whole file never needs to be in memory.

use super::format::{Format, format_of};
use super::reader::{BlockReader, Whole};
use super::{ReadOptions, check_resolution, e57, inside, kitti, las, npz, pcd, ply, ptx, text};
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Reads a file in blocks of `size` points (the last may be shorter), in the order of the file: together they are what
/// [`read_with`](super::read_with) reads, except for column types of text.
///
/// LAS, LAZ, COPC, PLY, text, PTS and binary or ascii PCD need the memory of about one block. Compressed PCD, binary
/// PLY with lists in its vertices, E57, npz, PTX and sweeps of SemanticKITTI are read as a whole first and then divided into blocks. Numbers in
/// text are `f64` in every block, because a type that fits one block may not fit the next. With `bounds`, blocks of LAS
/// keep their size; those of other formats hold the points of a full block that lie in the box, and empty ones are
/// skipped.
///
/// # Errors
/// As [`read_with`](super::read_with), and if `size` is 0. After an error the iterator ends.
pub fn blocks(path: &Path, size: usize, options: &ReadOptions) -> Result<Blocks> {
    options.validate()?;
    if size == 0 {
        return Err(Error::parameter("size", size, "1 or more points a block"));
    }
    let format = format_of(path)?;
    check_resolution(format, options)?;
    let source = Some(OpenFile::open(format, path, options)?);
    Ok(Blocks { path: path.to_path_buf(), source, size, options: options.clone() })
}

/// The iterator returned by [`blocks`].
#[derive(Debug)]
pub struct Blocks {
    path: PathBuf,
    /// `None` after the last block.
    source: Option<OpenFile>,
    size: usize,
    options: ReadOptions,
}

/// An open file.
#[derive(Debug)]
struct OpenFile {
    reader: Box<dyn BlockReader>,
    /// Whether its blocks hold points outside the box.
    uncut: bool,
}

impl OpenFile {
    fn open(format: Format, path: &Path, options: &ReadOptions) -> Result<Self> {
        let whole = |cloud: Cloud| {
            let cut = options.bounds.as_ref().map(|bounds| inside(&cloud, bounds));
            Box::new(Whole::new(cut.unwrap_or(cloud)))
        };
        let reader: Box<dyn BlockReader> = match format {
            Format::Las => Box::new(las::Reader::open(path, options)?),
            Format::Ply => Box::new(ply::Reader::open(path, options)?),
            Format::Pcd => Box::new(pcd::Reader::open(path, options)?),
            Format::Text => Box::new(text::Reader::open(path, options)?),
            Format::E57 => whole(e57::read(path, options)?),
            Format::Npz => whole(npz::read(path, options)?),
            Format::Ptx => whole(ptx::read(path, options)?),
            Format::Kitti => whole(kitti::read(path, options)?),
        };
        Ok(Self { reader, uncut: matches!(format, Format::Ply | Format::Pcd | Format::Text) })
    }
}

impl Iterator for Blocks {
    type Item = Result<Cloud>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let source = self.source.as_mut()?;
            let (taken, uncut) = (source.reader.take(self.size), source.uncut);
            let block = match taken {
                Ok(block) => block,
                Err(e) => {
                    self.source = None;
                    return Some(Err(e));
                }
            };
            if block.is_empty() {
                self.source = None;
                return None;
            }
            let block = match &self.options.bounds {
                Some(bounds) if uncut => inside(&block, bounds),
                _ => block,
            };
            if !block.is_empty() {
                let mut block = block;
                let settled = self.options.settle(&mut block, &self.path);
                return Some(settled.map(|()| block).inspect_err(|_| self.source = None));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};
    use crate::io::{self, WriteOptions};

    fn cloud(n: usize) -> Cloud {
        let rows: Vec<[f64; 3]> = (0..n).map(|i| [i as f64 * 0.25, (i % 97) as f64, -1.0]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        let codes = (0..n).map(|i| (i % 7) as u8).collect();
        cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
        cloud
    }

    #[test]
    fn blocks_together_are_the_file_in_every_format() {
        let folder = tempfile::tempdir().unwrap();
        let n = 130_001;
        for name in ["a.las", "a.laz", "a.ply", "a.pcd", "c.pcd", "a.npz", "a.csv"] {
            let path = folder.path().join(name);
            let compressed = name.starts_with('c');
            io::write(&path, &cloud(n), &WriteOptions { compressed, ..Default::default() }).unwrap();
            let whole = io::read(&path).unwrap();
            let mut next = 0;
            for block in blocks(&path, 40_000, &ReadOptions::default()).unwrap() {
                let block = block.unwrap();
                assert_eq!(block.len(), (n - next).min(40_000), "{name}");
                for i in (0..block.len()).step_by(997) {
                    assert_eq!(block.xyz(i), whole.xyz(next + i), "{name}");
                    let code = |c: &Cloud, i| c.column("Classification").unwrap().values.get(i);
                    assert_eq!(code(&block, i), code(&whole, next + i));
                }
                next += block.len();
            }
            assert_eq!(next, n, "{name}");
            let bounds = Some([[10.0, 0.0, -2.0], [20.0, 50.0, 0.0]]);
            let options = ReadOptions { bounds, ..Default::default() };
            let inside: usize = blocks(&path, 1000, &options).unwrap().map(|b| b.unwrap().len()).sum();
            assert_eq!((inside, io::read_with(&path, &options).unwrap().len()), (11, 11), "{name}");
        }
    }

    #[test]
    fn an_error_in_the_middle_ends_the_blocks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xyz");
        let text: String = (0..900_000).map(|i| if i == 800_000 { "q".into() } else { format!("{i} 2 3\n") }).collect();
        std::fs::write(&path, text).unwrap();
        let mut blocks = blocks(&path, 100_000, &ReadOptions::default()).unwrap();
        let read: usize = blocks.by_ref().map_while(|b| b.ok()).map(|b| b.len()).sum();
        assert!((100_000..800_000).contains(&read), "{read}");
        assert!(blocks.next().is_none());
        assert!(super::blocks(&path, 0, &ReadOptions::default()).is_err());
    }
}
