//! Variable length records, before and after the points. Lengths are checked before anything is allocated.

use super::{Header, array, bad, u16_at, u32_at, u64_at};
use crate::error::{Error, Mismatch, Result};
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// One record, with its header as stored in the file.
#[derive(Clone, Debug)]
pub(in crate::io) struct Vlr {
    /// 54 bytes (60 of an extended record).
    pub(in crate::io) head: Vec<u8>,
    pub(in crate::io) data: Vec<u8>,
}

impl Vlr {
    /// A new record.
    pub(in crate::io) fn new(user: &str, id: u16, description: &str, data: Vec<u8>) -> Self {
        let mut head = vec![0; 54];
        head[2..2 + user.len().min(16)].copy_from_slice(&user.as_bytes()[..user.len().min(16)]);
        head[18..20].copy_from_slice(&id.to_le_bytes());
        head[22..22 + description.len().min(32)].copy_from_slice(&description.as_bytes()[..description.len().min(32)]);
        let mut vlr = Self { head, data: Vec::new() };
        vlr.set_data(data);
        vlr
    }

    /// User id up to its first zero.
    pub(in crate::io) fn user(&self) -> String {
        let bytes: [u8; 16] = array(&self.head, 2);
        String::from_utf8_lossy(bytes.split(|&b| b == 0).next().unwrap_or_default()).into_owned()
    }

    pub(in crate::io) fn is(&self, user: &str, id: u16) -> bool {
        u16_at(&self.head, 18) == id && self.user() == user
    }

    /// Replaces the content and its length (at most 65535 bytes in a record before the points).
    pub(in crate::io) fn set_data(&mut self, data: Vec<u8>) {
        if self.head.len() == 54 {
            self.head[20..22].copy_from_slice(&(data.len().min(65_535) as u16).to_le_bytes());
        }
        self.data = data;
    }
}

/// Reads the records between header and points, and the bytes between the last record and the points.
pub(in crate::io) fn read_vlrs(path: &Path, file: &mut File, header: &Header) -> Result<(Vec<Vlr>, Vec<u8>)> {
    let start = header.raw.len();
    let room = header.points_at as usize - start;
    if u64::from(header.vlrs) * 54 > room as u64 {
        return Err(bad(
            path,
            "number of VLRs",
            100,
            Mismatch::new(header.vlrs, format!("at most {}: {room} bytes stand before the points", room / 54)),
        ));
    }
    let bytes = read_at(path, file, start as u64, room)?;
    let mut vlrs = Vec::with_capacity(header.vlrs as usize);
    let mut at = 0;
    for _ in 0..header.vlrs {
        let Some(head) = bytes.get(at..at + 54) else {
            return Err(bad(path, "VLR header", (start + at) as u64, Mismatch::new("the points", "54 bytes")));
        };
        let length = usize::from(u16_at(head, 20));
        let Some(data) = bytes.get(at + 54..at + 54 + length) else {
            let left = room - at - 54;
            return Err(bad(
                path,
                "VLR length",
                (start + at + 20) as u64,
                Mismatch::new(length, format!("at most {left} bytes before the points")),
            ));
        };
        vlrs.push(Vlr { head: head.to_vec(), data: data.to_vec() });
        at += 54 + length;
    }
    Ok((vlrs, bytes[at..].to_vec()))
}

/// Larger EVLRs are not held in memory.
pub(in crate::io::las) const MOST_EVLR: u64 = 64 << 20;

/// Reads the extended records of LAS 1.4; content of more than [`MOST_EVLR`] bytes is skipped (waveforms).
pub(in crate::io) fn read_evlrs(path: &Path, file: &mut File, header: &Header, size: u64) -> Result<Vec<Vlr>> {
    let mut evlrs = Vec::new();
    let mut at = header.evlrs_at;
    if header.evlrs > 0 && (at < header.points_at || at > size) {
        return Err(bad(path, "start of EVLRs", 235, Mismatch::new(at, format!("{} to {size}", header.points_at))));
    }
    if u64::from(header.evlrs) * 60 > size.saturating_sub(at) && header.evlrs > 0 {
        return Err(bad(
            path,
            "number of EVLRs",
            243,
            Mismatch::new(header.evlrs, format!("at most {}", (size - at) / 60)),
        ));
    }
    for _ in 0..header.evlrs {
        if size - at < 60 {
            return Err(bad(path, "EVLR header", at, Mismatch::new(format!("{} bytes", size - at), "60 bytes")));
        }
        let head = read_at(path, file, at, 60)?;
        let length = u64_at(&head, 20);
        if length > size - at - 60 {
            return Err(bad(
                path,
                "EVLR length",
                at + 20,
                Mismatch::new(length, format!("at most the {} bytes that are left", size - at - 60)),
            ));
        }
        let data = if length <= MOST_EVLR { read_at(path, file, at + 60, length as usize)? } else { Vec::new() };
        evlrs.push(Vlr { head, data });
        at += 60 + length;
    }
    Ok(evlrs)
}

/// Bytes at an offset; the caller has checked that they exist.
pub(in crate::io) fn read_at(path: &Path, file: &mut File, at: u64, length: usize) -> Result<Vec<u8>> {
    let mut bytes = vec![0; length];
    file.seek(SeekFrom::Start(at)).map_err(|e| Error::io(path, e))?;
    crate::io::open::fill(path, file, at, &mut bytes)?;
    Ok(bytes)
}

/// Number of bytes that records take in a file.
pub(in crate::io) fn size_of(vlrs: &[Vlr]) -> usize {
    vlrs.iter().map(|v| v.head.len() + v.data.len()).sum()
}

/// Chunk size in the LAZ record.
pub(in crate::io) fn laz_chunk_size(vlr: &Vlr) -> u32 {
    u32_at(&vlr.data, 12)
}
