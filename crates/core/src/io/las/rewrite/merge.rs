//! Merges several LAS or LAZ files by streaming.

use super::grid::Grid;
use super::plan::describe;
use super::promote;
use super::tail::Tail;
use crate::cloud::crs::vertical_of;
use crate::error::{Error, Result};
use crate::io::info::{NamedCrs, check_crs};
use crate::io::las::chunks::unpack::slab;
use crate::io::las::fields::extra::{self, Extra};
use crate::io::las::header::crs::Projection;
use crate::io::las::header::vlr::Vlr;
use crate::io::las::header::{Header, RECORD_SIZES, array, f64_at, put, u16_at};
use crate::io::las::records::Records;
use crate::io::las::records::outside::Outside;
use crate::io::las::records::stream::Stream;
use crate::io::las::write::writer::{CHUNK, Front, Writer};
use crate::io::{RewriteReport, WriteOptions, run};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Information about an input before its points are read.
struct Part {
    path: PathBuf,
    header: Header,
    vlrs: Vec<Vlr>,
    /// Extended records, without their content.
    evlrs: Vec<String>,
    crs: Option<String>,
}

/// Conversion of the records of one input to those of the output.
struct Mapper {
    /// Point format of the input and of the output.
    formats: [u8; 2],
    old_base: usize,
    /// Bytes of a record of the output.
    length: usize,
    /// Source offset, destination offset and length of each extra dimension.
    moves: Vec<(usize, usize, usize)>,
    /// Factor and shift of the coordinates' integers.
    ticks: [(i64, i64); 3],
}

pub(in crate::io) fn merge(inputs: &[PathBuf], output: &Path, options: &WriteOptions) -> Result<RewriteReport> {
    let parts = inputs.iter().map(|path| part(path)).collect::<Result<Vec<_>>>()?;
    let mut notes = Vec::new();
    check(&parts, &mut notes)?;
    let points = parts.iter().map(|p| p.header.points).sum::<u64>();
    let to = common_format(&parts, points)?;
    let grid = Grid::common(&parts.iter().map(|p| (p.path.as_path(), &p.header)).collect::<Vec<_>>())?;
    let mut first = Records::open(&inputs[0])?;
    let mut front = front(&first, &parts, to, output);
    let (extras, length) = extras(&parts, to, &mut front.vlrs, &mut notes)?;
    put(&mut front.header, 105, &length.to_le_bytes());
    fill_header(&mut front.header, &parts, points, &grid)?;
    let tail = Tail::of(&mut first, &mut front)?;
    other_records(&parts, &mut front.vlrs, &mut notes);
    let mut writer = Writer::create(output, front)?;
    options.monitor.stage("merge", points);
    for (part, moves) in parts.iter().zip(extras) {
        let formats = [part.header.format, to];
        let old_base = usize::from(RECORD_SIZES[usize::from(part.header.format)]);
        let mapper = Mapper { formats, old_base, length: usize::from(length), moves, ticks: grid.ticks(&part.header) };
        if mapper.ticks != [(1, 0); 3] {
            notes.push(format!("{}: same positions on another grid of scale and offset", part.path.display()));
        }
        copy(part, &mapper, &mut writer, options)?;
    }
    let old = parts[0].header.clone();
    let monitor = &options.monitor;
    writer.finish(monitor, |file| tail.copy(&mut first, file, monitor), |header, end| tail.patch(&old, header, end))?;
    Ok(RewriteReport { points, notes })
}

fn part(path: &Path) -> Result<Part> {
    let records = Records::open(path)?;
    let Projection { crs, .. } = Projection::of(records.header.wkt(), records.vlrs.iter().chain(&records.evlrs));
    let evlrs = records.evlrs.iter().map(|v| format!("{} {}", v.user(), u16_at(&v.head, 18))).collect();
    Ok(Part { path: path.to_path_buf(), header: records.header, vlrs: records.vlrs, evlrs, crs })
}

/// Checks that reference systems and kinds of GPS time are the same, and that at most one file has waveforms.
fn check(parts: &[Part], notes: &mut Vec<String>) -> Result<()> {
    let first = &parts[0];
    // The first input, or the first after it that tells of heights.
    let mut told = first;
    for part in parts {
        check_crs(
            NamedCrs::new(&told.path, told.crs.as_deref()),
            NamedCrs::new(&part.path, part.crs.as_deref()),
            notes,
        )?;
        let heights = |part: &Part| part.crs.as_deref().and_then(vertical_of).is_some();
        if told.crs.is_some() && !heights(told) && heights(part) {
            told = part;
        }
        let time = |p: &Part| p.header.time();
        if time(part) != time(first) {
            let text = "has another kind of GPS time (global encoding, bits 0 and 6, and time offset) than";
            return Err(Error::input(format!("{} {text} {}", part.path.display(), first.path.display())));
        }
        if promote::wave(part.header.format) && parts.len() > 1 {
            let reason = format!(
                "point format {} has waveforms, which cannot be joined; merge into .npz or .ply instead, which keeps all \
                 fields of the points but their waveforms",
                part.header.format
            );
            return Err(Error::Unsupported { path: part.path.clone(), reason });
        }
    }
    Ok(())
}

/// The smallest point format with all fields of all inputs; more points than fit into 32 bits need LAS 1.4.
fn common_format(parts: &[Part], points: u64) -> Result<u8> {
    let first = parts[0].header.format;
    let holds = |to: u8| parts.iter().all(|p| promote::missing(p.header.format, to).is_empty());
    let old = points > u64::from(u32::MAX) && first < 6;
    let mut candidates = std::iter::once(first).chain(0..=10).filter(|&to| !old || to >= 6);
    candidates.find(|&to| holds(to)).ok_or_else(|| Error::input("no point format holds the fields of all inputs"))
}

fn front(first: &Records, parts: &[Part], to: u8, output: &Path) -> Front {
    let wkt = first.vlrs.iter().any(|v| v.is("LASF_Projection", 2112));
    let header = match parts[0].header.format == to {
        true => parts[0].header.raw.clone(),
        false => promote::header(&parts[0].header, to, wkt),
    };
    let laz = output.extension().and_then(|e| e.to_str()).is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    let mut vlrs = first.vlrs.clone();
    vlrs.retain(|v| v.user() != "copc");
    Front { header, vlrs, gap: first.gap.clone(), chunk: laz.then_some(CHUNK) }
}

/// Source offset, destination offset and length of the extra dimensions of one input.
type Moves = Vec<(usize, usize, usize)>;

/// The destinations of each input's extra dimensions, and the record length of the output.
fn extras(parts: &[Part], to: u8, vlrs: &mut Vec<Vlr>, notes: &mut Vec<String>) -> Result<(Vec<Moves>, u16)> {
    let base = usize::from(RECORD_SIZES[usize::from(to)]);
    let old_base = |p: &Part| usize::from(RECORD_SIZES[usize::from(p.header.format)]);
    let described =
        |p: &Part| p.vlrs.iter().filter(|v| extra::is_record(v)).flat_map(|v| v.data.clone()).collect::<Vec<_>>();
    let first = &parts[0];
    let alike = |p: &Part| p.header.extra() == first.header.extra() && described(p) == described(first);
    if parts.iter().all(alike) {
        let moves = parts.iter().map(|p| vec![(old_base(p), base, p.header.extra())]).collect();
        return Ok((moves, (base + first.header.extra()) as u16));
    }
    let (mut known, mut end): (Vec<(Extra, usize)>, usize) = (Vec::new(), base);
    // Position of each name in `known`, and the number of inputs that have it.
    let mut places: HashMap<String, (usize, usize)> = HashMap::new();
    let mut all = Vec::new();
    for part in parts {
        let (list, _) = extra::described(&part.header, &part.vlrs);
        let named: usize = list.iter().filter(|e| !e.is_element).map(|e| extra::size_of(e.kind)).sum();
        if named != part.header.extra() {
            let reason = format!(
                "{} extra bytes a point have no type, or several values; merge needs names",
                part.header.extra() - named
            );
            return Err(Error::Unsupported { path: part.path.clone(), reason });
        }
        let mut moves = Vec::new();
        let mut seen = HashSet::new();
        for extra in list {
            let size = extra::size_of(extra.kind);
            if seen.insert(extra.name.clone())
                && let Some((_, inputs)) = places.get_mut(&extra.name)
            {
                *inputs += 1;
            }
            let place = match places.get(&extra.name).map(|&(at, _)| &known[at]) {
                Some((old, at)) if old.kind == extra.kind && old.scaled == extra.scaled => *at,
                Some(_) => {
                    let text = format!("dimension {} has another type or scale than before", extra.name);
                    return Err(Error::input(format!("{}: {text}", part.path.display())));
                }
                None => {
                    if !std::ptr::eq(part, first) {
                        describe(vlrs, 0, &descriptor(part, &extra.name)?)?;
                    }
                    places.insert(extra.name.clone(), (known.len(), 1));
                    known.push((extra.clone(), end));
                    end += size;
                    end - size
                }
            };
            moves.push((extra.at, place, size));
        }
        all.push(moves);
    }
    for (extra, _) in &known {
        let count = parts.len() - places.get(&extra.name).map_or(0, |&(_, inputs)| inputs);
        if count > 0 {
            notes.push(format!("{} is not in {count} of {} inputs; 0 there", extra.name, parts.len()));
        }
    }
    let length = u16::try_from(end).map_err(|_| Error::input(format!("records of {end} bytes; at most 65535")))?;
    Ok((all, length))
}

/// The descriptor of a dimension as stored in the file.
fn descriptor(part: &Part, name: &str) -> Result<Vec<u8>> {
    let blocks = part.vlrs.iter().filter(|v| extra::is_record(v)).flat_map(|v| v.data.chunks_exact(192));
    let of = |block: &&[u8]| block[4..36].split(|&b| b == 0).next().is_some_and(|n| n == name.as_bytes());
    let found = blocks.into_iter().find(of);
    found.map(<[u8]>::to_vec).ok_or_else(|| Error::input(format!("dimension {name} has no plain name")))
}

/// Counts, bounds, scale and offset of the output.
fn fill_header(raw: &mut [u8], parts: &[Part], points: u64, grid: &Grid) -> Result<()> {
    let (new_format, minor) = (raw[104] & 0x3f >= 6, raw[25]);
    let legacy = if new_format { 0 } else { u32::try_from(points).unwrap_or(0) };
    put(raw, 107, &legacy.to_le_bytes());
    // Counts of returns in headers are not verified.
    let all = |r| parts.iter().fold(0, |sum: u64, p| sum.saturating_add(p.header.points_of_return(r)));
    let returns: Vec<u64> = (0..15).map(all).collect();
    for (r, &n) in returns.iter().enumerate().take(5) {
        let old = if new_format { 0 } else { u32::try_from(n).unwrap_or(0) };
        put(raw, 111 + 4 * r, &old.to_le_bytes());
    }
    if minor >= 4 {
        put(raw, 247, &points.to_le_bytes());
        returns.iter().enumerate().for_each(|(r, n)| put(raw, 255 + 8 * r, &n.to_le_bytes()));
    }
    let filled: Vec<&Part> = parts.iter().filter(|p| p.header.points > 0).collect();
    for a in 0..3 {
        put(raw, 131 + 8 * a, &grid.scale[a].to_le_bytes());
        put(raw, 155 + 8 * a, &grid.offset[a].to_le_bytes());
        let high = filled.iter().map(|p| f64_at(&p.header.raw, 179 + 16 * a)).fold(f64::NEG_INFINITY, f64::max);
        let low = filled.iter().map(|p| f64_at(&p.header.raw, 187 + 16 * a)).fold(f64::INFINITY, f64::min);
        if low <= high {
            put(raw, 179 + 16 * a, &high.to_le_bytes());
            put(raw, 187 + 16 * a, &low.to_le_bytes());
        }
    }
    Ok(())
}

/// Records of the other inputs: new ones are added, those with different content are mentioned in a note.
fn other_records(parts: &[Part], vlrs: &mut Vec<Vlr>, notes: &mut Vec<String>) {
    for part in parts.iter().skip(1) {
        for vlr in &part.vlrs {
            let id = u16_at(&vlr.head, 18);
            if ["laszip encoded", "copc"].contains(&&vlr.user()[..]) || extra::is_record(vlr) {
                continue;
            }
            match vlrs.iter().find(|v| v.is(&vlr.user(), id)) {
                None => vlrs.push(vlr.clone()),
                Some(kept) if kept.data != vlr.data => {
                    notes.push(format!(
                        "record {} {id} is the first input's, not {}'s",
                        vlr.user(),
                        part.path.display()
                    ));
                }
                Some(_) => {}
            }
        }
        let lost: Vec<&str> = part.evlrs.iter().map(|e| &e[..]).filter(|e| !e.starts_with("copc")).collect();
        if !lost.is_empty() {
            notes.push(format!("{}: extended records not kept: {}", part.path.display(), lost.join(", ")));
        }
    }
}

fn copy(part: &Part, mapper: &Mapper, writer: &mut Writer, options: &WriteOptions) -> Result<()> {
    let mut stream = Stream::open(&part.path)?;
    let (old_length, length) = (stream.record_length(), mapper.length);
    if stream.len() != part.header.points || old_length != usize::from(part.header.record_length) {
        return Err(Error::input(format!("{}: the file changed while it was read", part.path.display())));
    }
    let mut outside = Outside::new(&part.header);
    loop {
        let old = stream.next(slab(stream.record_length()), &options.monitor)?;
        if old.is_empty() {
            outside.report(&part.path, &part.header, &options.monitor);
            return run::unchanged(&part.path);
        }
        outside.add(&old, old_length);
        let count = old.len() / old_length;
        let mut new = vec![0; count * length];
        for (from, to) in old.chunks_exact(old_length).zip(new.chunks_exact_mut(length)) {
            mapper.map(from, to).map_err(|text| Error::input(format!("{}: {text}", part.path.display())))?;
        }
        writer.push(&new, &options.monitor)?;
        options.monitor.advance(count as u64);
    }
}

impl Mapper {
    fn map(&self, old: &[u8], new: &mut [u8]) -> std::result::Result<(), String> {
        let old_part = &old[..self.old_base];
        let [from, to] = self.formats;
        match from == to {
            true => new[..self.old_base].copy_from_slice(old_part),
            false => promote::record(from, to, old_part, new),
        }
        for &(from, to, size) in &self.moves {
            new[to..to + size].copy_from_slice(&old[from..from + size]);
        }
        for (a, &(factor, shift)) in self.ticks.iter().enumerate() {
            if (factor, shift) != (1, 0) {
                let tick = i32::from_le_bytes(array(old, 4 * a));
                let moved = i64::from(tick).checked_mul(factor).and_then(|t| t.checked_add(shift));
                let moved = moved.and_then(|t| i32::try_from(t).ok());
                let tick = moved.ok_or_else(|| format!("tick {tick} of axis {a} does not fit the common grid"))?;
                put(new, 4 * a, &tick.to_le_bytes());
            }
        }
        Ok(())
    }
}
