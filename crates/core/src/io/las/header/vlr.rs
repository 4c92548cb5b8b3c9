//! Variable length records, before and after the points. Lengths are checked before anything is allocated.

use super::{Header, array, bad, u16_at, u32_at, u64_at};
use crate::cloud::crs::{Unit, unit_of, vertical_unit_of};
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

/// The CRS as WKT or `EPSG:n`, and metres per unit, from WKT or GeoTIFF keys.
pub(in crate::io) fn crs<'a>(
    header: &Header,
    vlrs: impl Iterator<Item = &'a Vlr> + Clone,
) -> (Option<String>, Option<f64>) {
    let find = |id| vlrs.clone().find(|v| v.is("LASF_Projection", id)).map(|v| &v.data[..]);
    let wkt =
        find(2112).map(|d| String::from_utf8_lossy(d).trim_end_matches('\0').to_string()).filter(|w| !w.is_empty());
    let keys = find(34735).map(|keys| Keys { keys, doubles: find(34736).unwrap_or_default() });
    match (wkt, keys) {
        (Some(wkt), keys) if header.wkt() || keys.is_none() => {
            let metres = length(&wkt);
            (Some(wkt), metres)
        }
        (_, Some(keys)) => {
            let crs = keys.system();
            let metres = keys.unit(3076, 3077).or_else(|| crs.as_deref().and_then(length));
            (crs, metres)
        }
        _ => (None, None),
    }
}

/// Metres per unit of height, if the file states it and it differs from that of x and y.
pub(in crate::io) fn other_vertical_unit<'a>(
    header: &Header,
    vlrs: impl Iterator<Item = &'a Vlr> + Clone,
) -> Option<f64> {
    let (crs, horizontal) = crs(header, vlrs.clone());
    let find = |id| vlrs.clone().find(|v| v.is("LASF_Projection", id)).map(|v| &v.data[..]);
    let keys = find(34735).filter(|_| !header.wkt());
    let keys = keys.map(|keys| Keys { keys, doubles: find(34736).unwrap_or_default() });
    let vertical = keys.and_then(|keys| keys.unit(4099, 0)).or_else(|| vertical_unit_of(&crs?))?;
    Some(vertical).filter(|v| horizontal.is_some_and(|h| (h / v - 1.0).abs() > 1e-4))
}

fn length(crs: &str) -> Option<f64> {
    match unit_of(crs) {
        Some(Unit::Length(metres)) => Some(metres),
        _ => None,
    }
}

/// GeoTIFF keys (OGC 19-008) and the numbers that some of them refer to.
#[derive(Clone, Copy)]
struct Keys<'a> {
    keys: &'a [u8],
    doubles: &'a [u8],
}

impl Keys<'_> {
    /// Value of a short key.
    fn short(&self, wanted: u16) -> Option<u16> {
        let entries = self.keys.chunks_exact(8).skip(1);
        entries.filter(|e| u16_at(e, 0) == wanted && u16_at(e, 2) == 0).map(|e| u16_at(e, 6)).next()
    }

    /// Value of a key that refers to a double.
    fn double(&self, wanted: u16) -> Option<f64> {
        let mut entries = self.keys.chunks_exact(8).skip(1);
        let entry = entries.find(|e| u16_at(e, 0) == wanted && u16_at(e, 2) == 34736)?;
        self.doubles.chunks_exact(8).nth(usize::from(u16_at(entry, 6))).map(|d| f64::from_le_bytes(array(d, 0)))
    }

    /// The projected system, or the geographic one of a file without projection.
    fn system(&self) -> Option<String> {
        let code = |key| self.short(key).filter(|&code| code > 0 && code != 32767);
        let geographic = || code(2048).filter(|_| self.short(1024) == Some(2) && self.short(3072).is_none());
        code(3072).or_else(geographic).map(|code| format!("EPSG:{code}"))
    }

    /// Metres in the linear unit of key `code`, or, if that is user-defined, in the number of key `size`.
    fn unit(&self, code: u16, size: u16) -> Option<f64> {
        let metres = match self.short(code)? {
            9001 => 1.0,
            9002 => 0.3048,
            9003 => 1200.0 / 3937.0,
            9005 => 0.304_797_265_4,
            9030 => 1852.0,
            9031 => 1.000_013_596_5,
            9036 => 1000.0,
            9040 => 0.914_398_414_616_029,
            9041 => 0.304_799_471_538_676,
            9080 => 0.304_799_510_248_147,
            9094 => 0.304_799_710_181_509,
            9095 => 0.304_800_749_1,
            9096 => 0.9144,
            32767 => self.double(size)?,
            _ => return None,
        };
        (metres.is_finite() && metres > 0.0).then_some(metres)
    }
}

/// Number of bytes that records take in a file.
pub(in crate::io) fn size_of(vlrs: &[Vlr]) -> usize {
    vlrs.iter().map(|v| v.head.len() + v.data.len()).sum()
}

/// Chunk size in the LAZ record.
pub(in crate::io) fn laz_chunk_size(vlr: &Vlr) -> u32 {
    u32_at(&vlr.data, 12)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The keys as bytes, headed.
    fn keys(entries: &[[u16; 4]]) -> Vec<u8> {
        let head = [1, 1, 0, entries.len() as u16];
        [&[head], entries].concat().concat().into_iter().flat_map(u16::to_le_bytes).collect()
    }

    #[test]
    fn geotiff_keys_tell_system_and_unit() {
        let doubles: Vec<u8> = [7.0, 0.25].into_iter().flat_map(f64::to_le_bytes).collect();
        let of = |entries: &[[u16; 4]]| {
            let keys = keys(entries);
            let keys = Keys { keys: &keys, doubles: &doubles };
            (keys.system(), keys.unit(3076, 3077))
        };
        let epsg = |code| Some(format!("EPSG:{code}"));
        assert_eq!(of(&[[3072, 0, 1, 26910], [3076, 0, 1, 9002]]), (epsg(26910), Some(0.3048)));
        assert_eq!(of(&[[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, 2229]]), (epsg(2229), None));
        assert_eq!(of(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]), (epsg(4326), None));
        assert_eq!(of(&[[3072, 0, 1, 32767], [3076, 0, 1, 32767], [3077, 34736, 1, 1]]), (None, Some(0.25)));
        assert_eq!(of(&[]), (None, None));
    }

    #[test]
    fn a_code_alone_tells_the_unit_and_keys_tell_that_of_heights() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.las");
        crate::io::write(&path, &crate::Cloud::from_rows(&[[1.0; 3]]).unwrap(), &Default::default()).unwrap();
        let header = crate::io::las::Records::open(&path).unwrap().header;
        let record = |entries: &[[u16; 4]]| [Vlr::new("LASF_Projection", 34735, "", keys(entries))];
        let feet = record(&[[1024, 0, 1, 1], [3072, 0, 1, 2229], [4099, 0, 1, 9001]]);
        let found = crs(&header, feet.iter());
        assert_eq!(found.0.as_deref(), Some("EPSG:2229"));
        assert!((found.1.unwrap() - 0.304_800_609_6).abs() < 1e-10);
        assert_eq!(other_vertical_unit(&header, feet.iter()), Some(1.0));
        let utm = record(&[[1024, 0, 1, 1], [3072, 0, 1, 32632], [4099, 0, 1, 9001]]);
        assert_eq!(crs(&header, utm.iter()), (Some("EPSG:32632".into()), Some(1.0)));
        assert_eq!(other_vertical_unit(&header, utm.iter()), None);
        let degrees = record(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]);
        assert_eq!(crs(&header, degrees.iter()), (Some("EPSG:4326".into()), None));
    }
}
