//! COPC: the octree of a LAZ file (Cloud Optimized Point Cloud Specification 1.0). Each node is a LAZ chunk.

use super::chunks::Chunk;
use super::header::vlr::read_at;
use super::header::{array, bad, f64_at, u64_at};
use super::records::Records;
use crate::cloud::Bounds;
use crate::error::{Mismatch, Result};
use crate::io::ReadOptions;
use crate::io::info::Octree;
use std::collections::BTreeSet;

/// Bytes of a hierarchy entry.
const ENTRY: usize = 32;
/// Largest depth: deeper nodes would be smaller than the scale of any file.
const DEEPEST: i32 = 31;
/// Largest page in bytes; those of real files have some hundred kilobytes.
const LARGEST_PAGE: u64 = 256 << 20;

/// Level and place of a node in the grid of its level, as the file stores them. No key of `crate::voxels`: those have
/// 21 bits an axis and the size of their cells for a level; COPC nests 32 levels.
type Key = [i32; 4];

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    key: Key,
    chunk: Chunk,
}

/// The info record.
#[derive(Clone, Copy, Debug)]
struct Info {
    centre: [f64; 3],
    half: f64,
    /// Point spacing of level 0.
    spacing: f64,
    root: (u64, u64),
}

/// Whether a file has a COPC info record.
pub(super) fn is(records: &Records) -> bool {
    records.chunks.is_some() && records.vlrs.iter().any(|v| v.is("copc", 1))
}

/// Keeps only the chunks of the nodes needed for the box and the resolution, in the order of the file.
pub(super) fn narrow(records: &mut Records, options: &ReadOptions) -> Result<()> {
    options.validate()?;
    let info = info(records)?;
    let deepest = options.resolution.map_or(DEEPEST, |resolution| level(info.spacing, resolution));
    let mut nodes = walk(records, &info)?;
    nodes.retain(|node| node.key[0] <= deepest && options.bounds.as_ref().is_none_or(|b| info.touches(node.key, b)));
    nodes.sort_by_key(|node| node.chunk.at);
    records.header.points = nodes.iter().map(|n| n.chunk.points).sum();
    if let Some(chunks) = &mut records.chunks {
        chunks.list = nodes.into_iter().map(|n| n.chunk).collect();
    }
    Ok(())
}

/// The levels of the octree, for `inspect`.
pub(super) fn describe(records: &mut Records) -> Result<Octree> {
    let info = info(records)?;
    let nodes = walk(records, &info)?;
    let mut levels = Vec::new();
    for node in &nodes {
        let level = node.key[0].unsigned_abs() as usize;
        levels.resize(levels.len().max(level + 1), 0);
        levels[level] += node.chunk.points;
    }
    Ok(Octree { spacing: info.spacing, nodes: nodes.len() as u64, points_per_level: levels })
}

/// The last level that is needed: spacing / 2^level <= resolution.
fn level(spacing: f64, resolution: f64) -> i32 {
    (spacing / resolution).log2().ceil().clamp(0.0, f64::from(DEEPEST)) as i32
}

fn info(records: &Records) -> Result<Info> {
    let vlr = records.vlrs.iter().find(|v| v.is("copc", 1));
    let data = vlr.map(|v| &v.data[..]).unwrap_or_default();
    let at = records.header.raw.len() as u64 + 54;
    let wrong = |field: &str, place: u64, fault: Mismatch| Err(bad(&records.path, field, at + place, fault));
    if data.len() < 160 {
        return wrong("COPC info", 0, Mismatch::new(format!("{} bytes", data.len()), "160 bytes"));
    }
    let info = Info {
        centre: [0, 8, 16].map(|a| f64_at(data, a)),
        half: f64_at(data, 24),
        spacing: f64_at(data, 32),
        root: (u64_at(data, 40), u64_at(data, 48)),
    };
    let positive = |v: f64| v.is_finite() && v > 0.0;
    if !info.centre.iter().all(|v| v.is_finite()) || !positive(info.half) {
        return wrong(
            "COPC cube",
            0,
            Mismatch::new(format!("{:?} +- {}", info.centre, info.half), "finite numbers, a size above 0"),
        );
    }
    match positive(info.spacing) {
        true => Ok(info),
        false => wrong("COPC spacing", 32, Mismatch::new(info.spacing, "a number above 0")),
    }
}

impl Info {
    /// Whether a node's cube intersects a box. The cube is slightly enlarged, because points can lie on its faces.
    fn touches(&self, [level, cell @ ..]: Key, [low, high]: &Bounds) -> bool {
        let size = 2.0 * self.half / f64::from(1u32 << level.clamp(0, DEEPEST));
        let hair = 1e-6 * self.half + 1e-3 * size;
        (0..3).all(|a| {
            let start = self.centre[a] - self.half + f64::from(cell[a]) * size;
            start - hair <= high[a] && start + size + hair >= low[a]
        })
    }
}

/// All nodes with points. Each page is read once; entries are checked against file, parent levels and header.
fn walk(records: &mut Records, info: &Info) -> Result<Vec<Node>> {
    let mut pages = vec![info.root];
    let (mut seen, mut keys, mut nodes) = (BTreeSet::new(), BTreeSet::new(), Vec::new());
    let (mut bytes, mut points) = (0u64, 0u64);
    while let Some((at, size)) = pages.pop() {
        bytes = bytes.saturating_add(size);
        let whole = size % ENTRY as u64 == 0 && size > 0;
        if at > records.size || size > (records.size - at).min(LARGEST_PAGE) || !whole || bytes > records.size {
            let allowed = format!("entries of {ENTRY} bytes inside the file of {}", records.size);
            return Err(bad(&records.path, "COPC page", at, Mismatch::new(format!("{size} bytes"), allowed)));
        }
        if !seen.insert(at) {
            return Err(bad(
                &records.path,
                "COPC page",
                at,
                Mismatch::new("a page that was read before", "each page once"),
            ));
        }
        let page = read_at(&records.path, &mut records.file, at, size as usize)?;
        for (place, entry) in (at..).step_by(ENTRY).zip(page.chunks_exact(ENTRY)) {
            match checked(records, place, entry)? {
                (_, None) => pages.push((u64_at(entry, 16), u64::from(u32::from_le_bytes(array(entry, 24))))),
                (key, Some(chunk)) => {
                    if !keys.insert(key) {
                        return Err(bad(
                            &records.path,
                            "COPC node",
                            place,
                            Mismatch::new(format!("{key:?} again"), "each node once"),
                        ));
                    }
                    points += chunk.points;
                    if chunk.points > 0 {
                        nodes.push(Node { key, chunk });
                    }
                }
            }
        }
    }
    match points == records.header.points {
        true => Ok(nodes),
        false => {
            let allowed = format!("{} as the header says", records.header.points);
            Err(bad(&records.path, "points of all COPC nodes", info.root.0, Mismatch::new(points, allowed)))
        }
    }
}

/// Key and chunk of an entry; no chunk if the entry refers to another page.
fn checked(records: &Records, place: u64, entry: &[u8]) -> Result<(Key, Option<Chunk>)> {
    let number = |at: usize| i32::from_le_bytes(array(entry, at));
    let (key, at) = ([0, 4, 8, 12].map(number), u64_at(entry, 16));
    let (bytes, points) = (number(24), number(28));
    let wrong = |field: &str, fault: Mismatch| Err(bad(&records.path, field, place, fault));
    let [level, cell @ ..] = key;
    if !(0..=DEEPEST).contains(&level) || cell.iter().any(|c| *c < 0 || i64::from(*c) >= 1 << level) {
        return wrong(
            "COPC node",
            Mismatch::new(format!("{key:?}"), format!("a level of 0 to {DEEPEST}, a cell of its grid")),
        );
    }
    if bytes < 0 || points < -1 || (points == -1 && bytes == 0) {
        return wrong(
            "COPC entry",
            Mismatch::new(format!("{bytes} bytes, {points} points"), "positive numbers, or -1 points"),
        );
    }
    if points == -1 {
        return Ok((key, None));
    }
    let (bytes, points) = (bytes.unsigned_abs().into(), u64::from(points.unsigned_abs()));
    let first = records.header.points_at + 8;
    let inside = at >= first && at <= records.size && bytes <= records.size - at;
    if points > 0 && (!inside || points > 4096 * bytes) {
        let found = format!("{points} points in {bytes} bytes at byte {at}");
        return wrong(
            "COPC chunk",
            Mismatch::new(found, format!("bytes {first} to {} and at most 4096 points a byte", records.size)),
        );
    }
    Ok((key, Some(Chunk { at, bytes, points })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::io::{self, Bounds};
    use std::path::{Path, PathBuf};

    #[test]
    fn levels_follow_the_resolution() {
        assert_eq!([8.0, 4.0, 3.9, 1.0, 100.0].map(|r| level(8.0, r)), [0, 1, 2, 3, 0]);
    }

    /// A COPC file with one node for each of these runs of points; `break_it` changes its hierarchy.
    fn copc(path: &Path, break_it: impl Fn(&mut Vec<u8>, u64)) {
        use crate::io::las::header::vlr::Vlr;
        use crate::io::las::write::writer::{Front, Writer};
        let rows: Vec<[f64; 3]> =
            (0..300).map(|i| [f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)]).collect();
        let plain = path.with_extension("las");
        io::write(&plain, &Cloud::from_rows(&rows).unwrap(), &Default::default()).unwrap();
        let mut records = Records::open(&plain).unwrap();
        let mut info = vec![0; 160];
        for (at, value) in [(0, 5.0), (8, 5.0), (16, 5.0), (24, 5.0), (32, 4.0f64)] {
            info[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        // One chunk of 100 points for the root, two for nodes of level 1.
        let vlrs = vec![Vlr::new("copc", 1, "COPC info", info)];
        let front = Front { header: records.header.raw.clone(), vlrs, gap: Vec::new(), chunk: Some(100) };
        let monitor = crate::parallel::Monitor::default();
        let mut writer = Writer::create(path, front).unwrap();
        records.for_each(&monitor, |slab| writer.push(slab.bytes, &monitor)).unwrap();
        writer.finish(&monitor, |_| Ok(0), |_, _| {}).unwrap();
        let chunks = Records::open(path).unwrap().chunks.unwrap().list;
        let mut bytes = std::fs::read(path).unwrap();
        let root = bytes.len() as u64;
        let mut page = Vec::new();
        // The third node is in a page of its own.
        let keys = [[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]];
        for (n, (key, chunk)) in keys.iter().zip(&chunks).enumerate() {
            let key = if n == 2 { [1, 1, 0, 0] } else { *key };
            if n == 2 {
                page.extend(key.iter().flat_map(|v: &i32| v.to_le_bytes()));
                page.extend((root + 96).to_le_bytes());
                page.extend(32i32.to_le_bytes());
                page.extend((-1i32).to_le_bytes());
            }
            page.extend(key.iter().flat_map(|v: &i32| v.to_le_bytes()));
            page.extend(chunk.at.to_le_bytes());
            page.extend((chunk.bytes as i32).to_le_bytes());
            page.extend((chunk.points as i32).to_le_bytes());
        }
        break_it(&mut page, root);
        bytes[375 + 54 + 40..375 + 54 + 48].copy_from_slice(&root.to_le_bytes());
        bytes[375 + 54 + 48..375 + 54 + 56].copy_from_slice(&96u64.to_le_bytes());
        bytes.extend(page);
        std::fs::write(path, bytes).unwrap();
    }

    fn file() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.copc.laz");
        (folder, path)
    }

    #[test]
    fn the_walk_finds_the_chunks_and_levels_and_boxes_narrow_them() {
        let (_folder, path) = file();
        copc(&path, |_, _| {});
        let info = io::inspect(&path).unwrap();
        assert_eq!(info.octree.unwrap().points_per_level, [100, 200]);
        let read = |bounds: Option<Bounds>, resolution| {
            io::read_with(&path, &ReadOptions { bounds, resolution, ..Default::default() }).unwrap()
        };
        let all = read(None, None);
        assert_eq!((all.len(), read(None, Some(4.0)).len(), read(None, Some(2.0)).len()), (300, 100, 300));
        // In this file the node for x above 5 holds the points with z = 2: the box must exclude its chunk.
        let bounds = [[0.0, 0.0, 0.0], [3.0, 3.0, 9.0]];
        let inside = |i: &u32| (0..3).all(|a| (bounds[0][a]..=bounds[1][a]).contains(&all.xyz(*i as usize)[a]));
        let expected: Vec<u32> = (0..200).filter(inside).collect();
        assert_eq!(read(Some(bounds), None).coordinates(), all.select(&expected).coordinates());
    }

    #[test]
    fn hostile_hierarchies_are_errors() {
        let (_folder, path) = file();
        type Change = fn(&mut Vec<u8>, u64);
        let cases: [(Change, &str); 9] = [
            (|page, root| page[80..88].copy_from_slice(&root.to_le_bytes()), "COPC page"),
            (|page, _| page[88..92].copy_from_slice(&33i32.to_le_bytes()), "COPC page"),
            (|page, _| page[88..92].copy_from_slice(&i32::MIN.to_le_bytes()), "COPC entry"),
            (|page, _| page[28..32].copy_from_slice(&(-2i32).to_le_bytes()), "COPC entry"),
            (|page, _| page[0..4].copy_from_slice(&40i32.to_le_bytes()), "COPC node"),
            (|page, _| page[36..40].copy_from_slice(&9i32.to_le_bytes()), "COPC node"),
            (|page, _| page[16..24].copy_from_slice(&u64::MAX.to_le_bytes()), "COPC chunk"),
            (|page, _| page[28..32].copy_from_slice(&99i32.to_le_bytes()), "299"),
            (|page, _| page[100..104].copy_from_slice(&0i32.to_le_bytes()), "again"),
        ];
        for (change, expected) in cases {
            copc(&path, change);
            let options = ReadOptions { resolution: Some(1.0), ..Default::default() };
            let message = io::read_with(&path, &options).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}: {expected}");
            assert_eq!(io::read(&path).unwrap().len(), 300, "the chunk table is whole");
            assert!(io::inspect(&path).unwrap().warnings.iter().any(|w| w.contains("octree")));
        }
    }
}
