//! The public header block of LAS 1.0 to 1.5. Every size in it is checked against the file before it is used.

pub(in crate::io::las) mod crs;
pub(in crate::io::las) mod lookup;
pub(in crate::io::las) mod vlr;

use crate::error::{Error, Mismatch, Result};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes of a record of point format 0..=10 without extra bytes.
pub(in crate::io) const RECORD_SIZES: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
/// Header bytes of version 1.0..=1.5. LAS 1.5 adds the range of GPS times and an offset; everything else is as in 1.4.
pub(in crate::io) const HEADER_SIZES: [usize; 6] = [227, 227, 227, 235, 375, 393];

/// The header: its bytes, and the fields needed for reading.
#[derive(Clone, Debug)]
pub(in crate::io) struct Header {
    /// The bytes of the header as stored in the file, including user data at its end.
    pub(in crate::io) raw: Vec<u8>,
    pub(in crate::io) minor: u8,
    pub(in crate::io) format: u8,
    pub(in crate::io) compressed: bool,
    pub(in crate::io) record_length: u16,
    pub(in crate::io) points: u64,
    pub(in crate::io) points_at: u64,
    pub(in crate::io) vlrs: u32,
    pub(in crate::io) scale: [f64; 3],
    pub(in crate::io) offset: [f64; 3],
    pub(in crate::io) low: [f64; 3],
    pub(in crate::io) high: [f64; 3],
    pub(in crate::io) evlrs_at: u64,
    pub(in crate::io) evlrs: u32,
}

pub(in crate::io) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(bytes, at))
}

pub(in crate::io) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}

pub(in crate::io) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(array(bytes, at))
}

pub(in crate::io) fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(array(bytes, at))
}

/// N bytes at an offset; zeros beyond the end.
pub(in crate::io) fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut out = [0; N];
    if let Some(found) = bytes.get(at..at + N) {
        out.copy_from_slice(found);
    }
    out
}

pub(in crate::io) fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(slot) = bytes.get_mut(at..at + value.len()) {
        slot.copy_from_slice(value);
    }
}

/// An error about a LAS field.
pub(in crate::io) fn bad(path: &Path, field: &str, at: u64, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "LAS",
        field: field.to_string(),
        place: format!("byte {at}"),
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

/// Header size of a version; `None` for unsupported versions.
pub(in crate::io) fn least_size([major, minor]: [u8; 2]) -> Option<usize> {
    HEADER_SIZES.get(usize::from(minor)).filter(|_| major == 1).copied()
}

impl Header {
    /// Reads the header from the start of a file of `size` bytes.
    pub(in crate::io) fn read(path: &Path, file: &mut File, size: u64) -> Result<Self> {
        let mut raw = Vec::new();
        file.take(375).read_to_end(&mut raw).map_err(|e| Error::io(path, e))?;
        if raw.len() < 227 {
            return Err(bad(path, "header", 0, Mismatch::new(format!("{} bytes", raw.len()), "at least 227 bytes")));
        }
        if &raw[..4] != b"LASF" {
            return Err(bad(path, "file signature", 0, Mismatch::new(format!("{:?}", &raw[..4]), "LASF")));
        }
        let (major, minor) = (raw[24], raw[25]);
        let length = usize::from(u16_at(&raw, 94));
        let least = least_size([major, minor])
            .ok_or_else(|| bad(path, "version", 24, Mismatch::new(format!("{major}.{minor}"), "1.0 to 1.5")))?;
        if length < least || length as u64 > size {
            return Err(bad(
                path,
                "header size",
                94,
                Mismatch::new(length, format!("{least} to the file's {size} bytes")),
            ));
        }
        let rest = (length as u64).saturating_sub(raw.len() as u64);
        file.take(rest).read_to_end(&mut raw).map_err(|e| Error::io(path, e))?;
        raw.truncate(length);
        let header = Self::parse(raw);
        header.check(path, size)?;
        Ok(header)
    }

    /// Extracts the fields from bytes whose length has been checked.
    pub(in crate::io) fn parse(raw: Vec<u8>) -> Self {
        let minor = raw[25];
        let triple = |at: usize| [0, 1, 2].map(|a| f64_at(&raw, at + 8 * a));
        let bounds = |first: usize| [0, 1, 2].map(|a| f64_at(&raw, first + 16 * a));
        let legacy = u64::from(u32_at(&raw, 107));
        let points = if minor >= 4 && u64_at(&raw, 247) > 0 { u64_at(&raw, 247) } else { legacy };
        Self {
            minor,
            format: raw[104] & 0x3f,
            compressed: raw[104] & 0xc0 != 0,
            record_length: u16_at(&raw, 105),
            points,
            points_at: u64::from(u32_at(&raw, 96)),
            vlrs: u32_at(&raw, 100),
            scale: triple(131),
            offset: triple(155),
            high: bounds(179),
            low: bounds(187),
            evlrs_at: if minor >= 4 { u64_at(&raw, 235) } else { 0 },
            evlrs: if minor >= 4 { u32_at(&raw, 243) } else { 0 },
            raw,
        }
    }

    fn check(&self, path: &Path, size: u64) -> Result<()> {
        let Some(&least) = RECORD_SIZES.get(usize::from(self.format)) else {
            return Err(bad(path, "point format", 104, Mismatch::new(self.format, "0 to 10")));
        };
        if self.record_length < least {
            return Err(bad(
                path,
                "record length",
                105,
                Mismatch::new(self.record_length, format!("{least} or more in point format {}", self.format)),
            ));
        }
        if self.points_at < self.raw.len() as u64 || self.points_at > size {
            return Err(bad(
                path,
                "offset to points",
                96,
                Mismatch::new(self.points_at, format!("{} to {size}", self.raw.len())),
            ));
        }
        for a in 0..3 {
            if !(self.scale[a].is_finite() && self.scale[a] > 0.0) {
                return Err(bad(path, "scale", 131 + 8 * a as u64, Mismatch::new(self.scale[a], "a positive number")));
            }
            if !self.offset[a].is_finite() {
                return Err(bad(path, "offset", 155 + 8 * a as u64, Mismatch::new(self.offset[a], "a finite number")));
            }
        }
        let bytes = self.points.checked_mul(u64::from(self.record_length));
        let room = size - self.points_at;
        if !self.compressed && bytes.is_none_or(|b| b > room) {
            let there = room / u64::from(self.record_length);
            let place = if self.minor >= 4 { 247 } else { 107 };
            return Err(bad(
                path,
                "number of points",
                place,
                Mismatch::new(self.points, format!("at most {there}, the file ends after them")),
            ));
        }
        if self.compressed && self.points > 0 && room < 8 {
            return Err(bad(
                path,
                "number of points",
                107,
                Mismatch::new(self.points, "0, the file ends where points begin"),
            ));
        }
        Ok(())
    }

    /// The reference of GPS times: standard time or the week, and since LAS 1.5 an offset (bit 6, millions of seconds).
    pub(in crate::io) fn time(&self) -> (u16, Option<u16>) {
        let encoding = u16_at(&self.raw, 6);
        let moved = self.minor >= 5 && encoding & 64 != 0;
        (encoding & 1, moved.then(|| u16_at(&self.raw, 391)))
    }

    /// Number of points of return `r` (from 0): from the 64-bit counters of LAS 1.4 if they are used, else from the old
    /// ones.
    pub(in crate::io) fn points_of_return(&self, r: usize) -> u64 {
        let wide = self.minor >= 4 && self.raw.get(255..375).is_some_and(|c| c.iter().any(|&b| b != 0));
        match (wide, r < 5) {
            (true, _) => u64_at(&self.raw, 255 + 8 * r),
            (false, true) => u64::from(u32_at(&self.raw, 111 + 4 * r)),
            (false, false) => 0,
        }
    }

    /// Bytes of a record beyond its point format.
    pub(in crate::io) fn extra(&self) -> usize {
        usize::from(self.record_length) - usize::from(RECORD_SIZES[usize::from(self.format)])
    }

    /// Whether the CRS is stored as WKT (global encoding, bit 4).
    pub(in crate::io) fn wkt(&self) -> bool {
        u16_at(&self.raw, 6) & 16 != 0
    }
}
