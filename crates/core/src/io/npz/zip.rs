//! The parts of ZIP that npz needs (PKWARE, APPNOTE 6.3.10): stored and deflated entries, with 64-bit sizes.

use crate::error::{Error, Mismatch, Result};
use crate::io::atomic::AtomicFile;
use crate::io::open;
use crate::io::table::limits;
use crate::io::table::number::array;
use crate::memory;
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const STORED: u16 = 0;
const DEFLATED: u16 = 8;
const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
const LOCATOR: u32 = 0x0706_4b50;
const END64: u32 = 0x0606_4b50;

/// A file in the archive.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) name: String,
    method: u16,
    crc: u32,
    packed: u64,
    /// Unpacked size in bytes.
    pub(super) size: u64,
    local: u64,
}

/// An archive with a checked list of entries.
#[derive(Debug)]
pub(super) struct Archive {
    path: PathBuf,
    file: File,
    pub(super) length: u64,
    pub(super) entries: Vec<Entry>,
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(bytes, at))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(array(bytes, at))
}

pub(super) fn bad(path: &Path, field: &str, place: String, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "npz",
        field: field.to_string(),
        place,
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = open::file(path)?;
        let length = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut archive = Self { path: path.to_path_buf(), file, length, entries: Vec::new() };
        let (count, size, at) = archive.end()?;
        if size > length || at > length - size || count > size / 46 {
            let place = format!("byte {at}");
            return Err(bad(
                path,
                "list of entries",
                place,
                Mismatch::new(format!("{count} entries, {size} bytes"), "what fits the file"),
            ));
        }
        let list = archive.bytes(at, size)?;
        archive.entries = entries(path, &list, count)?;
        let sum = archive.entries.iter().fold(0, |sum: u64, e| sum.saturating_add(e.size));
        limits::unpacked(path, "npz", length, sum)?;
        Ok(archive)
    }

    fn bytes(&mut self, at: u64, length: u64) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.file.seek(SeekFrom::Start(at)).map_err(|e| Error::io(&self.path, e))?;
        (&mut self.file).take(length).read_to_end(&mut bytes).map_err(|e| Error::io(&self.path, e))?;
        match bytes.len() as u64 == length {
            true => Ok(bytes),
            false => Err(bad(
                &self.path,
                "archive",
                format!("byte {at}"),
                Mismatch::new("the end of the file", format!("{length} bytes")),
            )),
        }
    }

    /// Number of entries, and size and offset of their list.
    fn end(&mut self) -> Result<(u64, u64, u64)> {
        let from = self.length.saturating_sub(65_557);
        let tail = self.bytes(from, self.length - from)?;
        let at = (0..tail.len().saturating_sub(21)).rev().find(|&at| u32_at(&tail, at) == END);
        let none = || {
            bad(&self.path, "end of archive", "end of the file".into(), Mismatch::new("none", "a complete ZIP archive"))
        };
        let at = at.ok_or_else(none)?;
        let locator = at.checked_sub(20).filter(|&l| u32_at(&tail, l) == LOCATOR);
        let Some(locator) = locator else {
            let list = (u32_at(&tail, at + 12), u32_at(&tail, at + 16));
            return Ok((u64::from(u16_at(&tail, at + 10)), u64::from(list.0), u64::from(list.1)));
        };
        let place = u64_at(&tail, locator + 8);
        let end = self.bytes(place.min(self.length), 56)?;
        match u32_at(&end, 0) == END64 {
            true => Ok((u64_at(&end, 32), u64_at(&end, 40), u64_at(&end, 48))),
            false => Err(bad(
                &self.path,
                "end of archive",
                format!("byte {place}"),
                Mismatch::new("something else", "its 64-bit form"),
            )),
        }
    }

    /// A reader of an entry's unpacked bytes.
    fn reader(&mut self, entry: &Entry) -> Result<Box<dyn Read + '_>> {
        let local = self.bytes(entry.local.min(self.length), 30)?;
        let start = entry.local + 30 + u64::from(u16_at(&local, 26)) + u64::from(u16_at(&local, 28));
        if u32_at(&local, 0) != LOCAL || start > self.length || entry.packed > self.length - start {
            let place = format!("byte {}", entry.local);
            return Err(bad(
                &self.path,
                &entry.name,
                place,
                Mismatch::new(format!("{} bytes", entry.packed), "what fits the file"),
            ));
        }
        self.file.seek(SeekFrom::Start(start)).map_err(|e| Error::io(&self.path, e))?;
        let packed = (&self.file).take(entry.packed);
        match entry.method {
            STORED => Ok(Box::new(packed)),
            DEFLATED => Ok(Box::new(DeflateDecoder::new(packed))),
            other => {
                let reason = format!("{} is compressed with method {other}; stored and deflated are read", entry.name);
                Err(Error::Unsupported { path: self.path.clone(), reason })
            }
        }
    }

    /// The first bytes of an entry, at most `most`.
    pub(super) fn start(&mut self, entry: &Entry, most: u64) -> Result<Vec<u8>> {
        let path = self.path.clone();
        let mut bytes = Vec::new();
        memory::reserve(&mut bytes, most.min(entry.size) as usize, &entry.name)?;
        let read = self.reader(entry)?.take(most).read_to_end(&mut bytes);
        read.map_err(|e| bad(&path, &entry.name, "its start".into(), Mismatch::new(e, "deflated bytes")))?;
        Ok(bytes)
    }

    /// All bytes of an entry, with size and checksum verified.
    pub(super) fn content(&mut self, entry: &Entry) -> Result<Vec<u8>> {
        let bytes = self.start(entry, entry.size.saturating_add(1))?;
        let found = (bytes.len() as u64, crc32fast::hash(&bytes));
        match found == (entry.size, entry.crc) {
            true => Ok(bytes),
            false => {
                let say = |(size, crc): (u64, u32)| format!("{size} bytes, checksum {crc:08x}");
                Err(bad(
                    &self.path,
                    &entry.name,
                    "its content".into(),
                    Mismatch::new(say(found), say((entry.size, entry.crc))),
                ))
            }
        }
    }
}

fn entries(path: &Path, list: &[u8], count: u64) -> Result<Vec<Entry>> {
    let (mut entries, mut at) = (Vec::new(), 0);
    for i in 0..count {
        let short =
            || bad(path, "list of entries", format!("entry {i}"), Mismatch::new("its end", format!("{count} entries")));
        let head = list.get(at..at + 46).filter(|head| u32_at(head, 0) == CENTRAL).ok_or_else(short)?;
        let [name, extra, comment] = [28, 30, 32].map(|field| usize::from(u16_at(head, field)));
        let name = list.get(at + 46..at + 46 + name).ok_or_else(short)?;
        let extra_at = at + 46 + name.len();
        let extra = list.get(extra_at..extra_at + extra).ok_or_else(short)?;
        let name = String::from_utf8_lossy(name).into_owned();
        if u16_at(head, 8) & 1 != 0 {
            return Err(Error::Unsupported { path: path.to_path_buf(), reason: format!("{name} is encrypted") });
        }
        let (size, packed, local) = sizes(head, extra);
        entries.push(Entry { name, method: u16_at(head, 10), crc: u32_at(head, 16), packed, size, local });
        at = extra_at + extra.len() + comment;
    }
    Ok(entries)
}

/// Unpacked size, packed size and offset; values that do not fit into 32 bits are in extra field 1.
fn sizes(head: &[u8], extra: &[u8]) -> (u64, u64, u64) {
    let mut at = 0;
    let mut wide: &[u8] = &[];
    while let Some(field) = extra.get(at..at + 4) {
        let length = usize::from(u16_at(field, 2));
        if u16_at(field, 0) == 1 {
            wide = extra.get(at + 4..at + 4 + length).unwrap_or_default();
        }
        at += 4 + length;
    }
    let mut next = 0;
    let mut value = |narrow: u32| {
        if narrow != u32::MAX {
            return u64::from(narrow);
        }
        next += 8;
        u64_at(wide, next - 8)
    };
    (value(u32_at(head, 24)), value(u32_at(head, 20)), value(u32_at(head, 42)))
}

/// Writes an archive.
pub(super) struct Writer<'a> {
    path: &'a Path,
    file: AtomicFile,
    compressed: bool,
    at: u64,
    entries: Vec<Entry>,
}

impl<'a> Writer<'a> {
    pub(super) fn create(path: &'a Path, compressed: bool) -> Result<Self> {
        Ok(Self { path, file: AtomicFile::create(path)?, compressed, at: 0, entries: Vec::new() })
    }

    /// Adds an entry whose content comes in pieces, until `next` returns none.
    pub(super) fn add(&mut self, name: &str, mut next: impl FnMut() -> Result<Option<Vec<u8>>>) -> Result<()> {
        let local = self.at;
        let method = if self.compressed { DEFLATED } else { STORED };
        let mut entry = Entry { name: name.into(), method, crc: 0, packed: 0, size: 0, local };
        self.put(&local_header(&entry))?;
        let mut crc = crc32fast::Hasher::new();
        let mut packer = self.compressed.then(|| DeflateEncoder::new(Vec::new(), Compression::default()));
        while let Some(bytes) = next()? {
            crc.update(&bytes);
            entry.size += bytes.len() as u64;
            match &mut packer {
                None => self.put(&bytes)?,
                Some(packer) => {
                    packer.write_all(&bytes).map_err(|e| Error::io(self.path, e))?;
                    let ready = std::mem::take(packer.get_mut());
                    self.put(&ready)?;
                }
            }
        }
        if let Some(packer) = packer {
            let rest = packer.finish().map_err(|e| Error::io(self.path, e))?;
            self.put(&rest)?;
        }
        let start = local + local_header(&entry).len() as u64;
        (entry.crc, entry.packed) = (crc.finalize(), self.at - start);
        self.patch(&entry)?;
        self.entries.push(entry);
        Ok(())
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.at += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    /// Rewrites the local header with the final sizes.
    fn patch(&mut self, entry: &Entry) -> Result<()> {
        let writer = self.file.writer()?;
        let back = writer
            .seek(SeekFrom::Start(entry.local))
            .and_then(|_| writer.write_all(&local_header(entry)))
            .and_then(|()| writer.seek(SeekFrom::End(0)));
        back.map(|_| ()).map_err(|e| Error::io(self.path, e))
    }

    /// Writes the list of entries; then only the final name of the file is missing.
    pub(super) fn close(mut self) -> Result<AtomicFile> {
        let at = self.at;
        let list: Vec<u8> = self.entries.iter().flat_map(central_header).collect();
        self.put(&list)?;
        let end = end_records(self.entries.len() as u64, list.len() as u64, at);
        self.put(&end)?;
        Ok(self.file)
    }
}

fn local_header(entry: &Entry) -> Vec<u8> {
    let mut bytes = LOCAL.to_le_bytes().to_vec();
    bytes.extend(common_fields(entry, 20));
    bytes.extend(entry.name.as_bytes());
    bytes.extend([1u16, 16].map(u16::to_le_bytes).concat());
    bytes.extend([entry.size, entry.packed].map(u64::to_le_bytes).concat());
    bytes
}

fn central_header(entry: &Entry) -> Vec<u8> {
    let mut bytes = CENTRAL.to_le_bytes().to_vec();
    bytes.extend(45u16.to_le_bytes());
    bytes.extend(common_fields(entry, 28));
    bytes.extend([0; 10]);
    bytes.extend(u32::MAX.to_le_bytes());
    bytes.extend(entry.name.as_bytes());
    bytes.extend([1u16, 24].map(u16::to_le_bytes).concat());
    bytes.extend([entry.size, entry.packed, entry.local].map(u64::to_le_bytes).concat());
    bytes
}

/// Version, UTF-8 flag, method, 1 January 1980 (for reproducible bytes), checksum, sizes in the extra field, lengths.
fn common_fields(entry: &Entry, extra: u16) -> Vec<u8> {
    let mut bytes = [45, 0x800, entry.method, 0, 33].map(u16::to_le_bytes).concat();
    bytes.extend([entry.crc, u32::MAX, u32::MAX].map(u32::to_le_bytes).concat());
    bytes.extend([entry.name.len() as u16, extra].map(u16::to_le_bytes).concat());
    bytes
}

fn end_records(count: u64, size: u64, at: u64) -> Vec<u8> {
    let mut bytes = END64.to_le_bytes().to_vec();
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([45u16, 45].map(u16::to_le_bytes).concat());
    bytes.extend([0; 8]);
    bytes.extend([count, count, size, at].map(u64::to_le_bytes).concat());
    bytes.extend([LOCATOR, 0].map(u32::to_le_bytes).concat());
    bytes.extend((at + size).to_le_bytes());
    bytes.extend([1, END, 0].map(u32::to_le_bytes).concat());
    bytes.extend([count.min(0xffff) as u16; 2].map(u16::to_le_bytes).concat());
    bytes.extend([size, at].map(|v| (v.min(u64::from(u32::MAX)) as u32).to_le_bytes()).concat());
    bytes.extend([0; 2]);
    bytes
}
