//! LAS 1.0 to 1.4, point formats 0 to 10, and LAZ. Header, records and dimensions are parsed by our own code.

mod chunks;
mod copc;
mod crop;
mod decoder;
mod extra;
mod fields;
mod fit;
mod grid;
mod header;
mod info;
mod layout;
mod merge;
mod point_reader;
mod promote;
mod read;
mod records;
mod rewrite;
mod salvage;
mod sink;
mod stream;
mod tally;
mod vlr;
mod walk;
mod write;
mod writer;

pub(super) use crop::crop;
pub(super) use header::{Header, f64_at, u16_at, u64_at};
pub(super) use info::inspect;
pub(super) use layout::Layout;
pub(super) use merge::merge;
pub use point_reader::PointReader;
pub(super) use read::{Reader, read, read_records};
pub(super) use records::Records;
pub(super) use rewrite::{convert, rewrite, rewrite_records};
pub(super) use stream::Stream;
pub(super) use vlr::{Vlr, read_at};
pub(super) use write::write;

/// Whether a file begins as LAS and LAZ files do.
pub(super) fn is_las(path: &std::path::Path) -> crate::error::Result<bool> {
    use std::io::Read;
    let mut start = Vec::new();
    let file = super::open::file(path)?;
    file.take(4).read_to_end(&mut start).map_err(|e| crate::error::Error::io(path, e))?;
    Ok(start == b"LASF")
}
