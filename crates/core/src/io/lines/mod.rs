//! Text files in pieces of whole lines, so that a file of any size needs only a few megabytes.

mod decimal;
pub(super) mod words;

use crate::error::{Error, Result};
use crate::io::open;
use crate::memory;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Approximate bytes of a piece.
const PIECE: usize = 4 << 20;
/// Longest line that is accepted, in bytes.
const LONGEST: usize = 1 << 20;

/// Reads a file from an offset, piece by piece.
#[derive(Debug)]
pub(super) struct Pieces {
    path: PathBuf,
    format: &'static str,
    file: File,
    /// Start of the next piece: the bytes after the last line end.
    rest: Vec<u8>,
    done: bool,
}

impl Pieces {
    pub(super) fn open(path: &Path, format: &'static str, from: u64) -> Result<Self> {
        let mut file = open::file(path)?;
        file.seek(SeekFrom::Start(from)).map_err(|e| Error::io(path, e))?;
        Ok(Self { path: path.to_path_buf(), format, file, rest: Vec::new(), done: false })
    }

    /// The next whole lines (the last line of the file may lack its end); `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Vec<u8>>> {
        if self.done {
            return Ok(None);
        }
        let mut piece = Vec::new();
        memory::reserve(&mut piece, PIECE + self.rest.len(), "a piece of a text file")?;
        piece.append(&mut self.rest);
        let wanted = PIECE as u64;
        let read = (&mut self.file).take(wanted).read_to_end(&mut piece).map_err(|e| Error::io(&self.path, e))?;
        if (read as u64) < wanted {
            self.done = true;
            return Ok((!piece.is_empty()).then_some(piece));
        }
        let end = memchr::memrchr(b'\n', &piece).map_or(0, |at| at + 1);
        if piece.len() - end > LONGEST {
            return Err(Error::Malformed {
                path: self.path.clone(),
                format: self.format,
                field: "line length".into(),
                place: "a line".into(),
                found: format!("{} bytes and more", piece.len() - end),
                allowed: format!("at most {LONGEST}"),
            });
        }
        self.rest = piece.split_off(end);
        Ok(Some(piece))
    }
}

/// Reads a file line by line.
#[derive(Debug)]
pub(super) struct Lines {
    pieces: Pieces,
    piece: Vec<u8>,
    at: usize,
    number: usize,
}

impl Lines {
    /// The lines from byte `from` on, preceded by `before` lines.
    pub(super) fn open(path: &Path, format: &'static str, from: u64, before: usize) -> Result<Self> {
        Ok(Self { pieces: Pieces::open(path, format, from)?, piece: Vec::new(), at: 0, number: before })
    }

    /// The next non-blank line, trimmed, and its number from 1.
    pub(super) fn next(&mut self) -> Result<Option<(usize, &[u8])>> {
        let (start, end) = loop {
            if self.at >= self.piece.len() {
                match self.pieces.next()? {
                    Some(piece) => (self.piece, self.at) = (piece, 0),
                    None => return Ok(None),
                }
            }
            let start = self.at;
            let length = memchr::memchr(b'\n', &self.piece[start..]).unwrap_or(self.piece.len() - start);
            self.at = start + length + 1;
            self.number += 1;
            if !self.piece[start..start + length].trim_ascii().is_empty() {
                break (start, start + length);
            }
        };
        Ok(Some((self.number, self.piece[start..end].trim_ascii_end())))
    }
}

/// Lines of a piece without their ends.
pub(super) fn lines(piece: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = piece.get(at..).filter(|rest| !rest.is_empty())?;
        let length = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
        at += length + 1;
        rest.get(..length)
    })
}

/// Number of line ends.
pub(super) fn count(bytes: &[u8]) -> usize {
    memchr::memchr_iter(b'\n', bytes).count()
}

/// Splits a piece at line ends into at most `parts` parts of similar size.
pub(super) fn cut(piece: &[u8], parts: usize) -> Vec<&[u8]> {
    let step = piece.len() / parts.max(1) + 1;
    let (mut list, mut rest) = (Vec::new(), piece);
    while rest.len() > step {
        let end = memchr::memchr(b'\n', &rest[step..]).map_or(rest.len(), |at| step + at + 1);
        let (head, tail) = rest.split_at(end);
        list.push(head);
        rest = tail;
    }
    list.push(rest);
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_and_parts_together_are_the_file() {
        let text: Vec<u8> = (0..700_000u64).flat_map(|i| format!("line {i} {}\n", i * 7919).into_bytes()).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, &text).unwrap();
        let mut pieces = Pieces::open(&path, "text", 5).unwrap();
        let (mut whole, mut number) = (Vec::new(), 0);
        while let Some(piece) = pieces.next().unwrap() {
            assert!(piece.ends_with(b"\n"));
            let parts = cut(&piece, 3);
            assert_eq!(parts.concat(), piece);
            assert!(parts.iter().all(|p| p.ends_with(b"\n")));
            assert_eq!(lines(&piece).count(), count(&piece));
            whole.extend(piece);
            number += 1;
        }
        assert_eq!(whole, text[5..]);
        assert!(number > 2);
    }

    #[test]
    fn a_file_without_line_ends_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, vec![b'1'; 6 << 20]).unwrap();
        let mut pieces = Pieces::open(&path, "text", 0).unwrap();
        assert!(pieces.next().unwrap_err().to_string().contains("line length"));
    }
}
