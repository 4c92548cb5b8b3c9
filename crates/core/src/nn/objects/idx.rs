//! IDX files, in which MNIST comes: bytes in an array of any number of axes.

use crate::error::{Error, Result};
use crate::io::open;
use flate2::read::GzDecoder;
use std::io::Read;
use std::path::Path;

/// The type of elements that are bytes.
const BYTES: u8 = 8;
/// What gzip files begin with.
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// Bytes of a file, and elements of an array, at most.
const MOST: u64 = 4 << 30;
/// Axes of an array, at most: as many as a tensor of objects has besides its samples.
const MOST_AXES: u8 = 4;
/// Bytes that a byte of deflate can stand for, at most.
const MOST_EXPANSION: u64 = 1032;

/// An array of bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Idx {
    /// Length along each axis, the last running fastest.
    pub shape: Vec<usize>,
    /// The elements.
    pub values: Vec<u8>,
}

/// Reads an IDX file of bytes, compressed by gzip or not.
///
/// # Errors
/// [`Error::Malformed`] if it is no IDX file, has other elements than bytes, more than 4 axes, or other than the declared
/// length. No more is unpacked than the file declares.
pub fn read_idx(path: &Path) -> Result<Idx> {
    let bytes = open::bytes(path, MOST)?;
    if bytes.starts_with(&GZIP) {
        let room = (bytes.len() as u64).saturating_mul(MOST_EXPANSION);
        File { path, room, from: GzDecoder::new(&bytes[..]) }.read()
    } else {
        File { path, room: bytes.len() as u64, from: &bytes[..] }.read()
    }
}

/// A file that is read.
struct File<'a, R> {
    path: &'a Path,
    /// Bytes that it may have when it is unpacked.
    room: u64,
    from: R,
}

impl<R: Read> File<'_, R> {
    fn read(mut self) -> Result<Idx> {
        let shape = self.shape()?;
        let count = shape.iter().try_fold(1u64, |product, &length| product.checked_mul(length as u64));
        let Some(count) = count.filter(|&count| count <= MOST.min(self.room)) else {
            let allowed = format!("up to {}, by the length of the file", MOST.min(self.room));
            return Err(self.malformed("number of elements", format!("shape {shape:?}"), allowed));
        };
        let values = self.next("elements", count.saturating_add(1))?;
        if values.len() as u64 != count {
            let found = if values.len() as u64 > count { "more".into() } else { values.len().to_string() };
            let allowed = format!("{count}, by the shape {shape:?}");
            return Err(self.malformed("number of elements", found, allowed));
        }
        Ok(Idx { shape, values })
    }

    /// The length along each axis, from the start of the file.
    fn shape(&mut self) -> Result<Vec<usize>> {
        let start = self.next("the first 4 bytes", 4)?;
        let &[0, 0, BYTES, axes @ 1..=MOST_AXES] = &start[..] else {
            let allowed = format!("0, 0, 8 (bytes), number of axes from 1 to {MOST_AXES}");
            return Err(self.malformed("the first 4 bytes", format!("{start:?}"), allowed));
        };
        let bytes = self.next("lengths", 4 * u64::from(axes))?;
        let (lengths, _) = bytes.as_chunks::<4>();
        match lengths.len() == usize::from(axes) {
            true => Ok(lengths.iter().map(|&length| u32::from_be_bytes(length) as usize).collect()),
            false => Err(self.malformed("lengths", format!("{} bytes", bytes.len()), format!("{}", 4 * axes))),
        }
    }

    /// The next bytes, fewer at the end of the file.
    fn next(&mut self, field: &str, count: u64) -> Result<Vec<u8>> {
        let mut found = Vec::new();
        match self.from.by_ref().take(count).read_to_end(&mut found) {
            Ok(_) => Ok(found),
            Err(e) => Err(self.malformed(field, e, "a gzip stream")),
        }
    }

    fn malformed(&self, field: &str, found: impl ToString, allowed: impl ToString) -> Error {
        Error::Malformed {
            path: self.path.to_path_buf(),
            format: "IDX",
            field: field.into(),
            place: "byte 0".into(),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use std::io::Write;

    const FILE: [u8; 18] = [0, 0, 8, 2, 0, 0, 0, 2, 0, 0, 0, 3, 1, 2, 3, 4, 5, 6];

    fn read(bytes: &[u8]) -> Result<Idx> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("images");
        std::fs::write(&path, bytes).unwrap();
        read_idx(&path)
    }

    /// The bytes and so many zeros, compressed.
    fn packed(bytes: &[u8], zeros: u64) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(bytes).unwrap();
        std::io::copy(&mut std::io::repeat(0).take(zeros), &mut encoder).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn arrays_are_read_compressed_or_not() {
        let expected = Idx { shape: vec![2, 3], values: vec![1, 2, 3, 4, 5, 6] };
        assert_eq!(read(&FILE).unwrap(), expected);
        let compressed = packed(&FILE, 0);
        assert_eq!(read(&compressed).unwrap(), expected);
        assert!(read(&compressed[..compressed.len() / 2]).unwrap_err().to_string().contains("gzip"));
    }

    #[test]
    fn damaged_files_are_refused() {
        for cut in 0..FILE.len() {
            assert!(matches!(read(&FILE[..cut]), Err(Error::Malformed { .. })), "{cut}");
        }
        let mut floats = FILE;
        floats[2] = 0x0d;
        assert!(read(&floats).unwrap_err().to_string().contains("8 (bytes)"));
        let huge = [0, 0, 8, 3, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1];
        assert!(read(&huge).unwrap_err().to_string().contains("by the length of the file"));
        let five = [&[0, 0, 8, 5][..], &[0, 0, 0, 1].repeat(5), &[7]].concat();
        assert!(read(&five).unwrap_err().to_string().contains("axes from 1 to 4"));
        assert!(read(&[0, 0, 8, 0, 1]).unwrap_err().to_string().contains("axes from 1 to 4"));
        assert!(read(&[&FILE[..], &[7]].concat()).unwrap_err().to_string().contains("more"));
    }

    #[test]
    fn a_small_file_unpacks_to_no_more_than_its_shape() {
        // 64 MiB of zeros after 6 elements: no more than one of them is unpacked.
        let compressed = packed(&FILE, 64 << 20);
        let mut file = File { path: Path::new("x"), room: 1 << 30, from: GzDecoder::new(&compressed[..]) };
        assert_eq!(file.shape().unwrap(), [2, 3]);
        assert_eq!(file.next("elements", 7).unwrap(), [1, 2, 3, 4, 5, 6, 0]);
        assert!(read(&compressed).unwrap_err().to_string().contains("more"));
        // A shape that no file of this length can hold.
        let large = [0, 0, 8, 2, 0, 0, 255, 255, 0, 0, 255, 255, 1];
        assert!(read(&packed(&large, 0)).unwrap_err().to_string().contains("by the length of the file"));
        // A shape that it does hold.
        let long = [0, 0, 8, 1, 0, 16, 0, 0];
        assert_eq!(read(&packed(&long, 1 << 20)).unwrap().values, vec![0; 1 << 20]);
    }
}
