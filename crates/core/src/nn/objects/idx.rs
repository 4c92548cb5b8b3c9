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
/// Bytes of a file that is read, at most.
const MOST: u64 = 4 << 30;

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
/// [`Error::Malformed`] if it is no IDX file, has other elements than bytes, or other than the declared length.
pub fn read_idx(path: &Path) -> Result<Idx> {
    let bytes = open::bytes(path, MOST)?;
    if !bytes.starts_with(&GZIP) {
        return parse(bytes, path);
    }
    let mut plain = Vec::new();
    let read = GzDecoder::new(&bytes[..]).take(MOST).read_to_end(&mut plain);
    read.map_err(|e| malformed(path, "compressed bytes", e, "a gzip stream"))?;
    parse(plain, path)
}

fn parse(mut bytes: Vec<u8>, path: &Path) -> Result<Idx> {
    let start = bytes.get(..4).unwrap_or(&bytes);
    let &[0, 0, BYTES, axes] = start else {
        return Err(malformed(path, "the first 4 bytes", format!("{start:?}"), "0, 0, 8 (bytes), number of axes"));
    };
    let header = 4 + 4 * usize::from(axes);
    let lengths = bytes.get(4..header).unwrap_or_default().chunks_exact(4);
    let shape: Vec<usize> = lengths.map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]) as usize).collect();
    let count = shape.iter().try_fold(1usize, |product, &length| product.checked_mul(length));
    let found = bytes.len().saturating_sub(header);
    if shape.len() != usize::from(axes) || axes == 0 || count != Some(found) {
        let allowed = count.map_or("an array that fits into memory".into(), |count| format!("{count}, by its shape"));
        return Err(malformed(path, "number of elements", format!("{found} (shape {shape:?})"), allowed));
    }
    bytes.drain(..header);
    Ok(Idx { shape, values: bytes })
}

fn malformed(path: &Path, field: &str, found: impl ToString, allowed: impl ToString) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "IDX",
        field: field.into(),
        place: "byte 0".into(),
        found: found.to_string(),
        allowed: allowed.to_string(),
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

    #[test]
    fn arrays_are_read_compressed_or_not() {
        let expected = Idx { shape: vec![2, 3], values: vec![1, 2, 3, 4, 5, 6] };
        assert_eq!(read(&FILE).unwrap(), expected);
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(&FILE).unwrap();
        let compressed = encoder.finish().unwrap();
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
        assert!(read(&huge).unwrap_err().to_string().contains("fits into memory"));
    }
}
