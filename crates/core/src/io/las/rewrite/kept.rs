//! The records that are kept, and the header that counts them.

use crate::io::las::header::Header;
use crate::io::las::records::tally::Tally;

/// Selects records and counts them.
pub(super) struct Kept<'a> {
    /// Whether each point of the input is kept.
    marks: &'a [bool],
    tally: Tally,
    /// The header of the output as far as counts and bounds depend on it.
    header: Header,
}

impl<'a> Kept<'a> {
    /// Of an input with this header, whose records get another point format if one is given.
    pub(super) fn new(marks: &'a [bool], old: &Header, to: Option<u8>) -> Self {
        let format = to.unwrap_or(old.format);
        let minor = if to.is_some_and(|to| to >= 6) { old.minor.max(4) } else { old.minor };
        Self { marks, tally: Tally::new(format), header: Header { format, minor, ..old.clone() } }
    }

    /// Those of the records that are kept; the first has this index in the input.
    pub(super) fn of(&mut self, records: &[u8], first: usize, length: usize) -> Vec<u8> {
        let marked = records.chunks_exact(length).zip(&self.marks[first..]).filter(|(_, kept)| **kept);
        let kept: Vec<u8> = marked.flat_map(|(record, _)| record).copied().collect();
        self.tally.add(&kept, length);
        kept
    }

    /// Number of records that were kept.
    pub(super) fn points(&self) -> u64 {
        self.tally.points()
    }

    /// Writes counts and bounds into the bytes of the output's header.
    pub(super) fn put(&self, header: &mut [u8]) {
        self.tally.put(&self.header, header);
    }
}
