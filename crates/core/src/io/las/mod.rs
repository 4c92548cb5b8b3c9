//! LAS 1.0 to 1.5, point formats 0 to 10, and LAZ. Header, records and dimensions are parsed by our own code.

mod chunks;
mod copc;
mod fields;
mod header;
mod info;
mod read;
mod records;
mod rewrite;
mod salvage;
mod write;

pub(super) use fields::layout::Layout;
pub use header::crs::{ProjectionRecord, las_georeference};
pub(super) use header::vlr::{Vlr, read_at};
pub(super) use header::{HEADER_SIZES, Header, f64_at, u16_at, u64_at};
pub(super) use info::inspect;
pub use read::point_reader::PointReader;
pub(super) use read::{Reader, read, read_records};
pub(super) use records::Records;
pub(super) use records::outside::Outside;
pub(super) use records::stream::Stream;
pub(super) use rewrite::crop::crop;
pub(super) use rewrite::merge::merge;
pub(super) use rewrite::{check_dimensions, convert, rewrite_records, select};
pub use write::step::LasFrame;
pub(super) use write::step::moved_by_scale;
pub(super) use write::{check_finite, write};
pub use write::{las_frame, las_wkt};

/// Whether some point format has a field of this name.
pub(super) fn is_field(name: &str) -> bool {
    (0..=10).any(|format| fields::Field::named(name, format).is_some())
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
