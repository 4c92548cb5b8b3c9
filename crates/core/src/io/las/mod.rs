//! LAS 1.0 to 1.4, point formats 0 to 10, and LAZ. Header, records and dimensions are parsed by our own code.

mod chunks;
mod copc;
mod extra;
mod fields;
mod fit;
mod header;
mod info;
mod promote;
mod read;
mod records;
mod rewrite;
mod sink;
mod stream;
mod vlr;
mod write;
mod writer;

pub(super) use info::inspect;
pub(super) use read::{Reader, read};
pub(super) use rewrite::rewrite;
pub(super) use write::write;
