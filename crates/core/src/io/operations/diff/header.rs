//! Comparison of the headers and variable length records of two LAS or LAZ files.

use super::Changed;
use crate::error::Result;
use crate::io::las::{HEADER_SIZES, Header, Records, Vlr, f64_at, read_at, u16_at, u64_at};
use crate::parallel::Monitor;

/// Header fields that differ, except those that follow from the storage of the points.
pub(super) fn fields(a: &Records, b: &Records) -> Vec<Changed> {
    let (one, two) = (named(&a.header), named(&b.header));
    let mut changed: Vec<Changed> = one
        .into_iter()
        .zip(two)
        .filter(|((_, a), (_, b))| a != b)
        .map(|((name, a), (_, b))| Changed::new(name, a, b))
        .collect();
    if a.gap != b.gap {
        let text = |gap: &[u8]| format!("{} bytes", gap.len());
        changed.push(Changed::new("bytes between VLRs and points", text(&a.gap), text(&b.gap)));
    }
    changed
}

fn named(header: &Header) -> Vec<(String, String)> {
    let raw = &header.raw;
    let text = |at: usize, size: usize| {
        let bytes = raw.get(at..at + size).unwrap_or_default();
        let end = bytes.iter().rposition(|&b| b != 0).map_or(0, |e| e + 1);
        String::from_utf8_lossy(&bytes[..end]).into_owned()
    };
    let mut list = vec![
        ("version".to_string(), format!("1.{}", header.minor)),
        ("file source id".into(), u16_at(raw, 4).to_string()),
        ("global encoding".into(), u16_at(raw, 6).to_string()),
        ("GUID".into(), hex(&raw[8..24])),
        ("system identifier".into(), text(26, 32)),
        ("generating software".into(), text(58, 32)),
        ("creation day".into(), u16_at(raw, 90).to_string()),
        ("creation year".into(), u16_at(raw, 92).to_string()),
        ("header size".into(), raw.len().to_string()),
        ("point format".into(), header.format.to_string()),
        ("record length".into(), header.record_length.to_string()),
    ];
    for (a, axis) in ["x", "y", "z"].iter().enumerate() {
        for (name, at) in
            [("scale", 131 + 8 * a), ("offset", 155 + 8 * a), ("max", 179 + 16 * a), ("min", 187 + 16 * a)]
        {
            list.push((format!("{name} {axis}"), f64_at(raw, at).to_string()));
        }
    }
    for r in 0..15 {
        list.push((format!("points of return {}", r + 1), header.points_of_return(r).to_string()));
    }
    // The fields added by LAS 1.5 are user data in longer headers of 1.4, and are compared as such.
    let standard = HEADER_SIZES[usize::from(header.minor).min(4)].min(raw.len());
    list.push(("bytes behind the header's fields".into(), hex(&raw[standard..])));
    list
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Records that only one file has, or whose content differs. Records with the same user and number are compared in
/// their order.
pub(super) fn records(a: &mut Records, b: &mut Records, monitor: &Monitor) -> Result<Vec<Changed>> {
    let mut changed = Vec::new();
    for extended in [false, true] {
        let (one, two) = (keyed(a, extended), keyed(b, extended));
        for (key, place) in &one {
            monitor.check()?;
            match two.iter().find(|(k, _)| k == key) {
                None => changed.push(Changed::new(name(key), size(a, extended, *place), "absent")),
                Some((_, other)) => {
                    changed.extend(content(
                        key,
                        RecordOf { file: a, place: *place },
                        RecordOf { file: b, place: *other },
                        extended,
                    )?);
                }
            }
        }
        let new = two.iter().filter(|(key, _)| !one.iter().any(|(k, _)| k == key));
        changed.extend(new.map(|(key, place)| Changed::new(name(key), "absent", size(b, extended, *place))));
    }
    Ok(changed)
}

/// What identifies a record.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    user: String,
    id: u16,
    /// How many records with the same user and number precede it.
    serial: usize,
}

fn name(Key { user, id, serial }: &Key) -> String {
    if *serial == 0 { format!("{user} {id}") } else { format!("{user} {id} (no. {})", serial + 1) }
}

fn list(records: &Records, extended: bool) -> &[Vlr] {
    if extended { &records.evlrs } else { &records.vlrs }
}

/// Keys and positions of all records except the one that describes the compression of the points.
fn keyed(records: &Records, extended: bool) -> Vec<(Key, usize)> {
    let mut keys: Vec<(Key, usize)> = Vec::new();
    for (place, vlr) in list(records, extended).iter().enumerate() {
        let (user, id) = (vlr.user(), u16_at(&vlr.head, 18));
        if user == "laszip encoded" {
            continue;
        }
        let serial = keys.iter().filter(|(key, _)| (&key.user, key.id) == (&user, id)).count();
        keys.push((Key { user, id, serial }, place));
    }
    keys
}

/// Length of a record's content according to its header.
fn length(vlr: &Vlr) -> u64 {
    if vlr.head.len() == 60 { u64_at(&vlr.head, 20) } else { vlr.data.len() as u64 }
}

fn size(records: &Records, extended: bool, place: usize) -> String {
    format!("{} bytes", list(records, extended).get(place).map_or(0, length))
}

/// One of the records of a file, by its place among them.
struct RecordOf<'a> {
    file: &'a mut Records,
    place: usize,
}

/// Compares two records: description and reserved bytes, then the content.
fn content(key: &Key, mut one: RecordOf<'_>, mut two: RecordOf<'_>, extended: bool) -> Result<Option<Changed>> {
    let (size_a, size_b) = (size(one.file, extended, one.place), size(two.file, extended, two.place));
    let (x, y) = (&list(one.file, extended)[one.place], &list(two.file, extended)[two.place]);
    if length(x) != length(y) {
        return Ok(Some(Changed::new(name(key), size_a, size_b)));
    }
    let at = match x.data.len() as u64 == length(x) {
        true => x.data.iter().zip(&y.data).position(|(p, q)| p != q).map(|p| p as u64),
        false => first_difference(&mut one, &mut two)?,
    };
    let (x, y) = (&list(one.file, extended)[one.place], &list(two.file, extended)[two.place]);
    let said = |p: &str, q: &str| Some(Changed::new(name(key), p, q));
    Ok(match at {
        Some(at) => said(&size_a, &format!("{size_b}, other content from byte {at}")),
        None if x.head != y.head => said("same content", "another description or reserved bytes"),
        None => None,
    })
}

/// The first differing byte of two extended records that are too large to be held in memory.
fn first_difference(one: &mut RecordOf<'_>, two: &mut RecordOf<'_>) -> Result<Option<u64>> {
    const PIECE: u64 = 1 << 20;
    let start = |of: &RecordOf<'_>| {
        let before = of.file.evlrs.iter().take(of.place);
        of.file.header.evlrs_at + before.map(|v| 60 + length(v)).sum::<u64>() + 60
    };
    let (from_a, from_b, total) = (start(one), start(two), length(&one.file.evlrs[one.place]));
    let (a, b) = (&mut *one.file, &mut *two.file);
    let mut done = 0;
    while done < total {
        let now = (total - done).min(PIECE) as usize;
        let x = read_at(&a.path, &mut a.file, from_a + done, now)?;
        let y = read_at(&b.path, &mut b.file, from_b + done, now)?;
        if let Some(at) = x.iter().zip(&y).position(|(p, q)| p != q) {
            return Ok(Some(done + at as u64));
        }
        done += now as u64;
    }
    Ok(None)
}
