//! EPSG's reference systems by their codes. `epsg.bin` contains their WKT; `scripts/epsg-table` generates it.

use super::wkt::{Node, part_of};
use std::collections::BTreeMap;
use std::io::Read;
use std::sync::OnceLock;

/// EPSG's systems as WKT, deflated; `scripts/epsg-table` describes the layout.
const EPSG: &[u8] = include_bytes!("epsg.bin");

/// Bytes per entry of the table's index.
const ENTRY: usize = 6;

/// The WKT of an EPSG code, if it is in the table.
pub fn wkt_of(code: u16) -> Option<String> {
    let first = |frame: usize| number(2 + ENTRY * frame, 2);
    let frame = (0..frames()).take_while(|&f| first(f).is_some_and(|c| c <= usize::from(code))).last()?;
    let text = lines_of(frame)?;
    let line = text.lines().find_map(|line| line.split_once('\t').filter(|(c, _)| c.parse() == Ok(code)))?;
    Some(line.1.to_string())
}

/// A number of the table.
fn number(at: usize, bytes: usize) -> Option<usize> {
    Some(EPSG.get(at..at + bytes)?.iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte)))
}

/// Number of frames of the table.
fn frames() -> usize {
    number(0, 2).unwrap_or(0)
}

/// The systems in a frame of the table, one a line.
fn lines_of(frame: usize) -> Option<String> {
    let end = |frame: usize| number(4 + ENTRY * frame, 4);
    let start = if frame == 0 { 0 } else { end(frame - 1)? };
    let data = 2 + ENTRY * frames();
    let mut text = String::new();
    flate2::read::DeflateDecoder::new(EPSG.get(data + start..data + end(frame)?)?).read_to_string(&mut text).ok()?;
    Some(text)
}

/// The WKT of a vertical system; the table has those that are a part of its compound systems.
pub(super) fn vertical_wkt(code: u16) -> Option<&'static str> {
    static KNOWN: OnceLock<BTreeMap<u16, String>> = OnceLock::new();
    KNOWN.get_or_init(vertical_parts).get(&code).map(String::as_str)
}

/// The vertical parts of the table's compound systems, by code.
fn vertical_parts() -> BTreeMap<u16, String> {
    let mut found = BTreeMap::new();
    for text in (0..frames()).filter_map(lines_of) {
        for part in
            text.lines().filter(|line| line.contains("\tCOMPD_CS[")).filter_map(|line| part_of(line, "VERT_CS["))
        {
            if let Some(code) = Node::parse(part).and_then(|node| node.code()) {
                found.entry(code).or_insert_with(|| part.to_string());
            }
        }
    }
    found
}
