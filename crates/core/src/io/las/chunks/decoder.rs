//! Decoding of single LAZ chunks in memory.
//!
//! The arithmetic decoding is done by the `laz` crate. Sizes that it would allocate are checked here first, and its
//! panics become errors.

use crate::error::{Error, Mismatch, Result};
use crate::io::las::header::{bad, u32_at};
use laz::laszip::LazItemType;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem, LazVlr};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Settings for decoding the chunks of a file.
#[derive(Clone, Copy)]
pub(in crate::io::las) struct How<'a> {
    pub(in crate::io::las) vlr: &'a LazVlr,
    /// Fields outside the selection are not decoded (layered chunks only).
    pub(in crate::io::las) selection: DecompressionSelection,
    /// Whether a chunk must end exactly after its last point.
    pub(in crate::io::las) whole: bool,
}

/// The compressed bytes of a chunk, and its number in the file.
pub(in crate::io::las) struct ChunkBytes<B> {
    pub(in crate::io::las) index: usize,
    pub(in crate::io::las) bytes: B,
}

/// Whether chunks have one layer per field (LAZ with point formats from 6 on).
pub(in crate::io::las) fn layered(vlr: &LazVlr) -> bool {
    vlr.items().first().is_some_and(|item| item.version() >= 3)
}

/// Decodes one chunk, several records at a time. `B` owns or borrows the bytes of the chunk.
pub(in crate::io::las) struct Decoder<'a, B> {
    path: PathBuf,
    place: String,
    /// Bytes of the chunk.
    bytes: u64,
    whole: bool,
    inner: Box<dyn RecordDecompressor<Cursor<B>> + Send + Sync + 'a>,
}

impl<'a, B: AsRef<[u8]> + Send + Sync + 'a> Decoder<'a, B> {
    pub(in crate::io::las) fn new(path: &Path, how: How<'_>, chunk: ChunkBytes<B>) -> Result<Self> {
        let How { vlr, selection, whole } = how;
        let ChunkBytes { index, bytes } = chunk;
        if layered(vlr) {
            check_layers(path, vlr, index, bytes.as_ref())?;
        }
        let place = format!("chunk {index}");
        let length = bytes.as_ref().len() as u64;
        let inner = guarded(path, &place, || {
            let source = Cursor::new(bytes);
            let mut inner: Box<dyn RecordDecompressor<Cursor<B>> + Send + Sync + 'a> = match layered(vlr) {
                true => Box::new(LayeredPointRecordDecompressor::new(source)),
                false => Box::new(SequentialPointRecordDecompressor::new(source)),
            };
            inner.set_fields_from(vlr.items()).map_err(std::io::Error::other)?;
            inner.set_selection(selection);
            Ok(inner)
        })?;
        Ok(Self { path: path.to_path_buf(), place, bytes: length, whole, inner })
    }

    /// Fills `out`, a whole number of records, with the next ones.
    pub(in crate::io::las) fn next(&mut self, out: &mut [u8]) -> Result<()> {
        let Self { path, place, inner, .. } = self;
        guarded(path, place, || inner.decompress_many(out))
    }

    /// Fills `out`, records of this length, as far as they can be decoded; how many were.
    pub(in crate::io::las) fn readable(&mut self, out: &mut [u8], length: usize) -> usize {
        let Self { path, place, inner, .. } = self;
        let mut good = 0;
        // The error says no more than the number of records does.
        let _ = guarded(path, place, || {
            for record in out.chunks_exact_mut(length) {
                inner.decompress_next(record)?;
                good += 1;
            }
            Ok(())
        });
        good
    }

    /// Fails unless the chunk ends exactly after its last decoded point; with damaged bytes the decoder reads too much
    /// or too little.
    pub(in crate::io::las) fn end(&self) -> Result<()> {
        let (found, all) = (self.consumed(), self.bytes);
        match found == all || !self.whole {
            true => Ok(()),
            false => Err(Error::Malformed {
                path: self.path.clone(),
                format: "LAZ",
                field: "end of the compressed points".into(),
                place: self.place.clone(),
                found: format!("byte {found} of the chunk"),
                allowed: format!("its last, {all}"),
            }),
        }
    }

    /// Number of bytes of the chunk read so far.
    pub(in crate::io::las) fn consumed(&self) -> u64 {
        self.inner.get().position()
    }
}

/// Decodes a whole chunk.
pub(in crate::io::las) fn decode<B: AsRef<[u8]> + Send + Sync>(
    path: &Path,
    how: How<'_>,
    chunk: ChunkBytes<B>,
    out: &mut [u8],
) -> Result<()> {
    let mut decoder = Decoder::new(path, how, chunk)?;
    decoder.next(out)?;
    decoder.end()
}

/// Number of layers of a layered chunk.
pub(in crate::io::las) fn layers(vlr: &LazVlr) -> usize {
    let of = |item: &LazItem| match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => usize::from(count),
        _ => 1,
    };
    vlr.items().iter().map(of).sum()
}

/// The layers of a chunk follow its first point, with their lengths: in total they must fit into the chunk.
fn check_layers(path: &Path, vlr: &LazVlr, index: usize, bytes: &[u8]) -> Result<()> {
    let layers = layers(vlr);
    let start = vlr.items_size() as usize + 4;
    let declared: u64 = (0..layers).map(|l| u64::from(u32_at(bytes, start + 4 * l))).sum();
    let room = (bytes.len() as u64).saturating_sub((start + 4 * layers) as u64);
    if bytes.len() < start + 4 * layers || declared > room {
        return Err(bad(
            path,
            &format!("layers of chunk {index}"),
            0,
            Mismatch::new(format!("{declared} bytes"), format!("at most {room}")),
        ));
    }
    Ok(())
}

/// Runs a part of the decoder; its errors and panics become an error that mentions `what`.
pub(super) fn guarded<T>(path: &Path, what: &str, work: impl FnOnce() -> std::io::Result<T>) -> Result<T> {
    let failed = |found: String| Error::Malformed {
        path: path.to_path_buf(),
        format: "LAZ",
        field: "compressed points".into(),
        place: what.to_string(),
        found,
        allowed: "what a LAZ encoder writes".into(),
    };
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(e)) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Err(failed("its end before its last point".into()))
        }
        Ok(Err(e)) if e.kind() == std::io::ErrorKind::WouldBlock => Err(Error::io(path, e)),
        Ok(Err(e)) => Err(failed(e.to_string())),
        Err(_) => Err(failed("bytes that no encoder writes".into())),
    }
}
