//! Conversion to a point format that has all fields of the old one; class codes above 31 need formats 6 to 10 of LAS
//! 1.4.

use crate::cloud::Values;
use crate::io::las::fields::{Field, of_format};
use crate::io::las::header::{Header, RECORD_SIZES, put};

/// The LAS 1.4 format that has all fields of a legacy format.
pub(super) fn target(format: u8) -> u8 {
    match format {
        0 | 1 => 6,
        2 | 3 => 7,
        4 => 9,
        _ => 10,
    }
}

/// The format that has all fields of another, and colours.
pub(super) fn coloured(format: u8) -> u8 {
    match format {
        0 => 2,
        1 => 3,
        4 => 5,
        6 => 7,
        9 => 10,
        _ => format,
    }
}

/// Names of the fields that the new format lacks; empty if every record can be converted.
pub(super) fn missing(from: u8, to: u8) -> Vec<&'static str> {
    let mut missing: Vec<&str> =
        of_format(from).map(|(_, name)| name).filter(|name| Field::named(name, to).is_none()).collect();
    if from >= 6 && to < 6 {
        missing.push("class codes above 31");
        missing.push("return numbers above 7");
    }
    if wave(from) && !wave(to) {
        missing.push("waveforms");
    }
    missing
}

/// Whether records of this format end with a wave packet.
pub(super) fn wave(format: u8) -> bool {
    matches!(format, 4 | 5 | 9 | 10)
}

/// Converts a record between formats: copies every field, then the extra bytes.
pub(super) fn record(format: u8, to: u8, old: &[u8], new: &mut [u8]) {
    new[..14].copy_from_slice(&old[..14]);
    for (field, _) in of_format(format) {
        let mut value = field.values();
        field.append(format, old, old.len(), &mut value);
        field.store(to, new, number(&value));
    }
    let (old_base, new_base) =
        (usize::from(RECORD_SIZES[usize::from(format)]), usize::from(RECORD_SIZES[usize::from(to)]));
    if wave(format) && wave(to) {
        // Both records end with the 29 bytes of the wave packet.
        new[new_base - 29..new_base].copy_from_slice(&old[old_base - 29..old_base]);
    }
    let extra = old.len() - old_base;
    new[new_base..new_base + extra].copy_from_slice(&old[old_base..]);
}

fn number(value: &Values) -> f64 {
    value.get(0)
}

/// The converted header, LAS 1.4 for formats from 6 on; `wkt` says whether the file has a WKT record.
pub(in crate::io::las) fn header(old: &Header, to: u8, wkt: bool) -> Vec<u8> {
    let mut raw = old.raw.clone();
    raw[104] = to | old.raw[104] & 0xc0;
    let length = RECORD_SIZES[usize::from(to)] + old.extra() as u16;
    put(&mut raw, 105, &length.to_le_bytes());
    if to < 6 {
        // Waveforms need version 1.3, colours 1.2, GPS times 1.0.
        raw[25] = old.minor.max(if wave(to) {
            3
        } else if to >= 2 {
            2
        } else {
            0
        });
        return if raw[25] == 3 && old.minor < 3 { at_least_1_3(raw) } else { raw };
    }
    if old.format >= 6 {
        return raw;
    }
    if old.minor < 4 {
        // User data after the old header follow the new one.
        let standard = if old.minor >= 3 { 235 } else { 227 };
        let own = raw.split_off(standard);
        raw.resize(375, 0);
        raw.extend(own);
    }
    if wkt {
        raw[6] |= 16;
    }
    raw[25] = old.minor.max(4);
    let length = raw.len() as u16;
    put(&mut raw, 94, &length.to_le_bytes());
    let returns: [[u8; 4]; 5] = [0, 1, 2, 3, 4].map(|r| crate::io::las::header::array(&old.raw, 111 + 4 * r));
    let counted = old.minor >= 4 && old.raw[255..375].iter().any(|&b| b != 0);
    // The legacy counters are 0 with formats from 6 on.
    raw[107..131].fill(0);
    put(&mut raw, 247, &old.points.to_le_bytes());
    if !counted {
        let wide = returns.map(|n| u64::from(u32::from_le_bytes(n)).to_le_bytes());
        wide.iter().enumerate().for_each(|(r, n)| put(&mut raw, 255 + 8 * r, n));
    }
    raw
}

/// Inserts the field that LAS 1.3 added to the header.
fn at_least_1_3(mut raw: Vec<u8>) -> Vec<u8> {
    let own = raw.split_off(227);
    raw.resize(235, 0);
    raw.extend(own);
    let length = raw.len() as u16;
    put(&mut raw, 94, &length.to_le_bytes());
    raw
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_survives_promotion() {
        for format in 0..=5u8 {
            let size = usize::from(RECORD_SIZES[usize::from(format)]);
            let old: Vec<u8> = (0..size + 3).map(|i| (i * 37 + 11) as u8).collect();
            let to = target(format);
            let mut new = vec![0; usize::from(RECORD_SIZES[usize::from(to)]) + 3];
            record(format, to, &old, &mut new);
            for (field, name) in of_format(format) {
                let (mut a, mut b) = (field.values(), field.values());
                field.append(format, &old, old.len(), &mut a);
                field.append(to, &new, new.len(), &mut b);
                let close = (a.get(0) - b.get(0)).abs() < 0.004 || a.get(0).to_bits() == b.get(0).to_bits();
                assert!(close, "{name} of format {format}: {a:?} {b:?}");
            }
            assert_eq!(old[..14], new[..14]);
            assert_eq!(old[size..], new[new.len() - 3..]);
        }
    }
}
