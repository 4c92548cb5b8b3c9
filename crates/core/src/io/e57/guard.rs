//! Checks of an E57 file before and during decoding.

use crate::error::{Error, Mismatch, Result};
use crate::io::open;
use crate::io::table::limits;
use ::e57::{E57Reader, PointCloud, RecordDataType};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Page size in bytes, the only one that the standard allows.
const PAGE: u64 = 1024;
/// Largest XML section: real files have a few kilobytes a scan, and parsing takes several times its size.
const MOST_XML: u64 = 16 << 20;
/// Largest nesting of XML elements; deeper ones could overflow the parser's stack.
const DEEPEST: usize = 64;
/// Largest number of fields: the standard has about 20, extensions add some.
const MOST_FIELDS: usize = 1000;
/// Points that take no bytes in the file (all their fields are constant) are read up to this number.
const MOST_CONSTANT: u64 = 1_000_000;
/// Largest packet of points, in bits.
const PACKET: u64 = 8 << 16;
/// Bytes of a value in the decoder, which creates the values of constant fields for all points of a packet.
const VALUE: u64 = 16;

pub(super) type Reader = E57Reader<BufReader<File>>;

/// A file with a checked header and XML section.
pub(super) struct E57 {
    reader: Reader,
    size: u64,
}

pub(super) fn bad(path: &Path, field: &str, place: String, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "E57",
        field: field.to_string(),
        place,
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

/// Opens a file and compares its header with its size.
pub(super) fn open(path: &Path) -> Result<E57> {
    let mut file = open::file(path)?;
    let size = file.metadata().map_err(|e| Error::io(path, e))?.len();
    let mut head = [0; 48];
    file.read_exact(&mut head).map_err(|_| bad(path, "header", "byte 0".into(), Mismatch::new(size, "48 bytes")))?;
    let number = |at: usize| u64::from_le_bytes(crate::io::table::number::array(&head, at));
    let [length, xml_at, xml, page] = [16, 24, 32, 40].map(number);
    if page != PAGE {
        return Err(bad(path, "page size", "byte 40".into(), Mismatch::new(page, PAGE)));
    }
    if length != size || size % PAGE != 0 {
        return Err(bad(
            path,
            "file length",
            "byte 16".into(),
            Mismatch::new(length, format!("{size}, and whole pages of {PAGE}")),
        ));
    }
    if xml_at >= size || xml > (size - xml_at).min(MOST_XML) {
        let allowed = format!("inside the file, at most {MOST_XML} bytes");
        return Err(bad(
            path,
            "XML",
            "byte 24".into(),
            Mismatch::new(format!("{xml} bytes at byte {xml_at}"), allowed),
        ));
    }
    file.seek(SeekFrom::Start(0)).map_err(|e| Error::io(path, e))?;
    let copy = file.try_clone().map_err(|e| Error::io(path, e))?;
    let text = caught(path, "XML", || E57Reader::raw_xml(BufReader::new(copy)).map_err(|e| e.to_string()))?;
    let depth = depth(&text);
    if depth > DEEPEST {
        return Err(bad(
            path,
            "XML",
            format!("byte {xml_at}"),
            Mismatch::new(format!("{depth} nested elements"), DEEPEST),
        ));
    }
    file.seek(SeekFrom::Start(0)).map_err(|e| Error::io(path, e))?;
    let reader = caught(path, "XML", || E57Reader::new(BufReader::new(file)).map_err(|e| e.to_string()))?;
    Ok(E57 { reader, size })
}

/// Approximate nesting of elements; comments and the like only increase it.
fn depth(xml: &[u8]) -> usize {
    let (mut now, mut most) = (0usize, 0);
    for pair in xml.windows(2) {
        match pair {
            b"</" | b"/>" => now = now.saturating_sub(1),
            [b'<', next] if next.is_ascii_alphabetic() || *next == b'_' => now += 1,
            _ => {}
        }
        most = most.max(now);
    }
    most
}

/// Runs the decoder; its errors and panics become errors that mention `what`.
fn caught<T>(path: &Path, what: &str, work: impl FnOnce() -> std::result::Result<T, String>) -> Result<T> {
    let failed = |found: String| {
        // The standard library's message about a truncated file, made readable.
        let found = found.replace("failed to fill whole buffer", "the end of the file too early");
        bad(path, what, "its bytes".into(), Mismatch::new(found, "what an E57 writer writes"))
    };
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result.map_err(failed),
        Err(_) => Err(failed("bytes that no writer writes".into())),
    }
}

impl E57 {
    /// The scans, with the number of points checked against the size of the file.
    pub(super) fn scans(&self, path: &Path) -> Result<Vec<PointCloud>> {
        let scans = self.reader.pointclouds();
        let (mut total, mut constant, mut packed) = (0u64, 0u64, 0u64);
        for (number, scan) in scans.iter().enumerate() {
            if scan.prototype.len() > MOST_FIELDS {
                let found = format!("{} fields a point", scan.prototype.len());
                return Err(bad(
                    path,
                    "prototype",
                    format!("scan {number}"),
                    Mismatch::new(found, format!("at most {MOST_FIELDS}")),
                ));
            }
            let (mut bits, mut filled) = (0u64, 0u64);
            for record in &scan.prototype {
                let own = bits_of(&record.data_type).ok_or_else(|| {
                    let found = format!("{:?}", record.data_type);
                    bad(path, "prototype", format!("scan {number}"), Mismatch::new(found, "minimum <= maximum"))
                })?;
                bits += own;
                filled += u64::from(own == 0);
            }
            if let Some(points) = PACKET.checked_div(bits) {
                limits::unpacked(path, "E57", self.size, points * filled * VALUE)?;
            }
            // The bytes of different scans do not overlap.
            let most = match bits {
                0 => MOST_CONSTANT - constant,
                bits => (8 * self.size - packed) / bits,
            };
            if scan.records > most {
                let allowed = format!("at most {most}, as this scan and those before it have room for");
                return Err(bad(path, "recordCount", format!("scan {number}"), Mismatch::new(scan.records, allowed)));
            }
            match bits {
                0 => constant += scan.records,
                bits => packed += bits * scan.records,
            }
            total += scan.records;
        }
        match total < u64::from(u32::MAX) {
            true => Ok(scans),
            false => Err(bad(
                path,
                "recordCount",
                "all scans".into(),
                Mismatch::new(total, format!("fewer than {}", u32::MAX)),
            )),
        }
    }

    /// Size of the file in bytes.
    pub(super) fn size(&self) -> u64 {
        self.size
    }

    /// The coordinate reference system in the file.
    pub(super) fn crs(&self) -> Option<String> {
        self.reader.coordinate_metadata().map(str::trim).filter(|t| !t.is_empty()).map(String::from)
    }

    /// Runs a reading function of the decoder; its panics become errors.
    pub(super) fn guarded<T>(
        &mut self,
        path: &Path,
        what: &str,
        work: impl FnOnce(&mut Reader) -> Result<T>,
    ) -> Result<T> {
        caught(path, what, || Ok(work(&mut self.reader)))?
    }
}

/// Bits of a value; `None` if its range is not ordered.
fn bits_of(kind: &RecordDataType) -> Option<u64> {
    match kind {
        RecordDataType::Single { .. } => Some(32),
        RecordDataType::Double { .. } => Some(64),
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            let range = max.wrapping_sub(*min) as u64;
            (min <= max).then_some(u64::from(u64::BITS - range.leading_zeros()))
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// CRC-32C of a page, bit by bit.
    pub(in crate::io::e57) fn checksum(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
        !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
    }

    #[test]
    fn bits_follow_the_range() {
        let integer = |min, max| bits_of(&RecordDataType::Integer { min, max });
        assert_eq!([integer(0, 0), integer(0, 1), integer(-1, 254), integer(0, 256)], [0, 1, 8, 9].map(Some));
        assert_eq!((integer(i64::MIN, i64::MAX), integer(1, 0)), (Some(64), None));
    }

    #[test]
    fn nesting_is_counted() {
        assert_eq!(depth(b"<?xml?><a><b/><c><d x='1'/></c></a>"), 3);
    }
}
