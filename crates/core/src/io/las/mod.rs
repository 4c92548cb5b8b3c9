//! LAS 1.0 to 1.5, point formats 0 to 10, and LAZ. Header, records and dimensions are parsed by our own code.

mod chunks;
mod copc;
mod crop;
mod decoder;
mod deep;
mod extra;
mod fields;
mod fit;
mod grid;
mod header;
mod info;
mod layout;
mod merge;
mod outside;
mod point_reader;
mod promote;
mod read;
mod records;
mod rewrite;
mod salvage;
mod sink;
mod step;
mod stream;
mod tally;
mod vlr;
mod walk;
mod write;
mod writer;

pub(super) use crop::crop;
pub(super) use header::{HEADER_SIZES, Header, f64_at, u16_at, u64_at};
pub(super) use info::inspect;
pub(super) use layout::Layout;
pub(super) use merge::merge;
pub(super) use outside::Outside;
pub use point_reader::PointReader;
pub(super) use read::{Reader, read, read_records};
pub(super) use records::Records;
pub(super) use rewrite::{check_dimensions, convert, rewrite, rewrite_records};
pub use step::LasFrame;
pub(super) use stream::Stream;
pub(super) use vlr::{Vlr, read_at};
pub use write::las_frame;
pub(super) use write::write;

/// The warning if heights have a unit of their own.
fn vertical_warning(horizontal: Option<f64>, vertical: f64) -> String {
    let horizontal = horizontal.unwrap_or(1.0);
    format!(
        "x and y are in units of {horizontal} m, heights in units of {vertical} m: shapes will be distorted; bring them to one \
         unit first, e.g. with PDAL's filters.reprojection"
    )
}

/// Whether a file starts like LAS and LAZ files.
pub(super) fn is_las(path: &std::path::Path) -> crate::error::Result<bool> {
    use std::io::Read;
    let mut start = Vec::new();
    super::open::refuse_partial(path)?;
    let file = super::open::file(path)?;
    file.take(4).read_to_end(&mut start).map_err(|e| crate::error::Error::io(path, e))?;
    Ok(start == b"LASF")
}
