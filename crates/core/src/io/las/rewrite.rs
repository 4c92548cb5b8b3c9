//! Passing a LAS or LAZ file through: only what is asked changes.
//!
//! The raw records stream from input to output. Header, VLRs, the bytes between VLRs and points, every field and every extra
//! byte of the records, and everything behind the points are copied as they stand.

use super::extra::{self, Extra};
use super::fields::Field;
use super::header::{RECORD_SIZES, put, u64_at};
use super::promote;
use super::read::{check_codes, check_values};
use super::records::{Records, par_records};
use super::vlr::{Vlr, laz_chunk_size, read_at};
use super::writer::{CHUNK, Front, Writer};
use crate::cloud::{Column, Values};
use crate::error::{Error, Result};
use crate::io::{Edit, RewriteReport, WriteOptions};
use rayon::prelude::*;
use std::path::Path;

/// Chunks of the input's size are written up to this many points; beyond it memory would follow the chunk.
const LARGEST_CHUNK: u32 = 500_000;

/// Where a dimension's values go in the record that is written.
struct Slot<'a> {
    at: usize,
    values: &'a Values,
}

/// All that changes.
struct Plan<'a> {
    codes: Option<&'a [u8]>,
    slots: Vec<Slot<'a>>,
    /// The record gets the layout of LAS 1.4 first.
    promote: bool,
    format: u8,
    old_length: usize,
    new_length: usize,
}

/// Copies `input` to `output` (LAS or LAZ by its extension) with the edits applied.
pub(in crate::io) fn rewrite(
    input: &Path,
    output: &Path,
    edits: &[Edit],
    options: &WriteOptions,
) -> Result<RewriteReport> {
    let mut records = Records::open(input)?;
    let points = records.len()? as u64;
    let mut report = RewriteReport { points, notes: Vec::new() };
    let codes = edits.iter().find_map(|e| if let Edit::Classification(codes) = e { Some(&codes[..]) } else { None });
    if let Some(codes) = codes {
        check_codes(codes, points)?;
    }
    let largest = codes.and_then(|c| c.iter().max().copied()).unwrap_or(0);
    let promote = records.header.format < 6 && largest > 31;
    let mut front = front(&records, promote, output);
    if promote {
        let to = promote::target(records.header.format);
        report.notes.push(format!(
            "class codes up to {largest} need LAS 1.4: point format {} became {to}",
            records.header.format
        ));
    }
    if drop_copc(&mut records, &mut front) {
        report.notes.push("the octree of the COPC input is not kept; the output is plain LAZ".into());
    }
    let plan = plan(&records, &mut front, edits, codes, promote)?;
    let tail = tail(&mut records)?;
    let old = records.header.clone();
    let mut writer = Writer::create(output, front)?;
    options.monitor.stage("write", points);
    let monitor = options.monitor.clone();
    records.for_each(&monitor, |slab| {
        let first = slab.points.start;
        monitor.advance(slab.points.len() as u64);
        if plan.old_length != plan.new_length {
            return writer.push(&plan.widen(slab.bytes, first), &monitor);
        }
        par_records(slab.bytes, first, plan.old_length).for_each(|(i, record)| plan.apply(record, i));
        writer.push(slab.bytes, &monitor)
    })?;
    writer.finish(&tail.bytes, &options.monitor, |header, end| {
        if tail.evlrs > 0 {
            put(header, 235, &(end + (old.evlrs_at - tail.start)).to_le_bytes());
        } else if old.minor >= 4 {
            put(header, 235, &[0; 12]);
        }
        // In older versions these bytes of a longer header are somebody's own.
        let wave = if old.minor >= 3 { u64_at(header, 227) } else { 0 };
        if wave >= tail.start && !tail.bytes.is_empty() && wave > 0 {
            put(header, 227, &(end + (wave - tail.start)).to_le_bytes());
        }
    })?;
    Ok(report)
}

/// Everything before the points, as the input has it.
fn front(records: &Records, promote: bool, output: &Path) -> Front {
    let wkt = records.vlrs.iter().any(|v| v.is("LASF_Projection", 2112));
    let header = if promote { promote::header(&records.header, wkt) } else { records.header.raw.clone() };
    let laz = output.extension().and_then(|e| e.to_str()).is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    let own = records.vlrs.iter().find(|v| v.is("laszip encoded", 22204)).map(laz_chunk_size);
    let chunk = own.filter(|&c| c > 0 && c <= LARGEST_CHUNK).unwrap_or(CHUNK);
    Front { header, vlrs: records.vlrs.clone(), gap: records.gap.clone(), chunk: laz.then_some(chunk) }
}

/// COPC's info record and hierarchy speak of chunks that the output does not have.
fn drop_copc(records: &mut Records, front: &mut Front) -> bool {
    let before = front.vlrs.len();
    front.vlrs.retain(|v| v.user() != "copc");
    let hierarchy = records.evlrs.iter().any(|v| v.user() == "copc");
    records.evlrs.retain(|v| v.user() != "copc");
    if hierarchy {
        put(&mut front.header, 243, &(records.evlrs.len() as u32).to_le_bytes());
    }
    before != front.vlrs.len() || hierarchy
}

struct Tail {
    bytes: Vec<u8>,
    /// Where these bytes stood in the input.
    start: u64,
    evlrs: usize,
}

/// What stands behind the points: EVLRs and waveforms.
fn tail(records: &mut Records) -> Result<Tail> {
    let header = &records.header;
    let evlrs = records.evlrs.len();
    if evlrs as u32 != header.evlrs {
        // Some were dropped: the others are written anew.
        let bytes = records.evlrs.iter().flat_map(|v| v.head.iter().chain(&v.data)).copied().collect();
        return Ok(Tail { bytes, start: header.evlrs_at, evlrs });
    }
    let start = match &records.chunks {
        None => header.points_at + header.points * u64::from(header.record_length),
        Some(_) if evlrs > 0 => header.evlrs_at,
        Some(_) if header.minor >= 3 && u64_at(&header.raw, 227) > header.points_at => u64_at(&header.raw, 227),
        Some(_) => records.size,
    };
    let length = records.size.saturating_sub(start);
    let (path, evlrs) = (records.path.clone(), if header.evlrs_at >= start { evlrs } else { 0 });
    let bytes = read_at(&path, &mut records.file, start.min(records.size), length as usize)?;
    Ok(Tail { bytes, start, evlrs })
}

/// Decides where each edit goes and extends record length and descriptors.
fn plan<'a>(
    records: &Records,
    front: &mut Front,
    edits: &'a [Edit],
    codes: Option<&'a [u8]>,
    promote: bool,
) -> Result<Plan<'a>> {
    let header = &records.header;
    let format = if promote { promote::target(header.format) } else { header.format };
    let base = usize::from(RECORD_SIZES[usize::from(format)]);
    let moved = base as isize - isize::try_from(usize::from(RECORD_SIZES[usize::from(header.format)])).unwrap_or(0);
    let (known, undescribed) = extra::described(header, &records.vlrs);
    let mut length = base + header.extra();
    let (mut slots, mut added) = (Vec::new(), Vec::new());
    for edit in edits {
        let Edit::Dimension(column) = edit else { continue };
        check_values(&column.name, &column.values, header.points)?;
        if Field::named(&column.name, format).is_some() {
            return Err(Error::parameter(
                "dimension",
                &column.name,
                "a name that the point format does not use itself",
            ));
        }
        match known.iter().find(|e| e.name == column.name) {
            Some(old) => {
                slots.push(Slot { at: same_type(old, column)?.saturating_add_signed(moved), values: &column.values })
            }
            None => {
                slots.push(Slot { at: length, values: &column.values });
                added.extend(extra::descriptor(column)?);
                length += extra::size_of(extra::kind_of(&column.values));
            }
        }
    }
    if !added.is_empty() {
        describe(&mut front.vlrs, undescribed, &added)?;
    }
    let new_length = u16::try_from(length)
        .map_err(|_| Error::input(format!("records of {length} bytes; at most 65535 are possible")))?;
    put(&mut front.header, 105, &new_length.to_le_bytes());
    Ok(Plan {
        codes,
        slots,
        promote,
        format: header.format,
        old_length: usize::from(header.record_length),
        new_length: length,
    })
}

fn same_type(old: &Extra, column: &Column) -> Result<usize> {
    match old.kind == extra::kind_of(&column.values) && old.scaled.is_none() {
        true => Ok(old.at),
        false => Err(Error::parameter(
            "dimension",
            &column.name,
            "another name: the file has a dimension of this name and another type",
        )),
    }
}

/// Adds descriptors to the one Extra Bytes record, making it if there is none.
fn describe(vlrs: &mut Vec<Vlr>, undescribed: usize, added: &[u8]) -> Result<()> {
    let mut data = extra::undescribed(undescribed);
    data.extend_from_slice(added);
    // The last one, should there be several: descriptors stand in the order of the bytes.
    match vlrs.iter_mut().rfind(|v| extra::is_record(v)) {
        Some(vlr) => {
            let whole = vlr.data.len() / 192 * 192;
            vlr.set_data([&vlr.data[..whole], &data].concat());
        }
        None => vlrs.push(Vlr::new("LASF_Spec", 4, "Extra Bytes Record", data)),
    }
    match vlrs.iter().any(|v| extra::is_record(v) && v.data.len() > 65_535) {
        true => Err(Error::input("more than 341 extra dimensions do not fit into one Extra Bytes record")),
        false => Ok(()),
    }
}

impl Plan<'_> {
    /// Changes a record in place.
    fn apply(&self, record: &mut [u8], i: usize) {
        if let Some(codes) = self.codes {
            let format = if self.promote { promote::target(self.format) } else { self.format };
            Field::Classification.store(format, record, f64::from(codes[i]));
        }
        for slot in &self.slots {
            extra::store(slot.values, i, &mut record[slot.at..]);
        }
    }

    /// Longer records with the old ones in them, changed.
    fn widen(&self, old: &[u8], first: usize) -> Vec<u8> {
        let mut new = vec![0; old.len() / self.old_length * self.new_length];
        let pairs = new.par_chunks_exact_mut(self.new_length).zip(old.par_chunks_exact(self.old_length));
        pairs.with_min_len(8192).enumerate().for_each(|(i, (to, from))| {
            match self.promote {
                true => promote::record(self.format, from, to),
                false => to[..from.len()].copy_from_slice(from),
            }
            self.apply(to, first + i);
        });
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{self, Columns, ReadOptions};
    use las::{Builder, Color, Point, point::Format};
    use std::path::PathBuf;

    const POINTS: usize = 700;

    fn input(folder: &Path, (minor, format): (u8, u8), name: &str) -> PathBuf {
        let path = folder.join(name);
        let mut builder = Builder::from((1, minor));
        builder.point_format = Format::new(format).unwrap();
        builder.point_format.is_compressed = name.ends_with("laz");
        builder.point_format.extra_bytes = 3;
        if minor == 4 {
            for id in [78, 79] {
                let data = vec![id as u8; 100];
                builder.evlrs.push(las::Vlr { user_id: "x".into(), record_id: id, description: "".into(), data });
            }
        }
        let mut writer = las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
        let has = *writer.header().point_format();
        for i in 0..POINTS {
            let mixed = (i as u32).wrapping_mul(2_654_435_761) >> 7;
            let point = Point {
                x: f64::from(mixed % 9973) * 0.01,
                y: f64::from(mixed % 7919) * 0.01,
                z: (mixed % 31) as f64,
                intensity: mixed as u16,
                return_number: 1 + (mixed % 3) as u8,
                number_of_returns: 3,
                is_withheld: mixed.is_multiple_of(2),
                user_data: mixed as u8,
                scan_angle: (mixed % 40) as f32 - 20.0,
                point_source_id: (mixed % 5) as u16,
                classification: las::point::Classification::new((mixed % 7) as u8 + 1).unwrap(),
                gps_time: has.has_gps_time.then_some(f64::from(mixed) * 0.25),
                color: has.has_color.then_some(Color::new(mixed as u16, 2, (mixed % 77) as u16)),
                nir: has.has_nir.then_some((mixed % 999) as u16),
                waveform: has.has_waveform.then(Default::default),
                extra_bytes: vec![i as u8, 1, mixed as u8],
                ..Point::default()
            };
            writer.write_point(point).unwrap();
        }
        writer.close().unwrap();
        path
    }

    /// Puts bytes of somebody's own behind the header.
    fn lengthen_header(path: &Path, length: usize) {
        let mut bytes = std::fs::read(path).unwrap();
        let old = usize::from(u16::from_le_bytes([bytes[94], bytes[95]]));
        let at = super::super::header::u32_at(&bytes, 96) + (length - old) as u32;
        bytes.splice(old..old, (old..length).map(|i| i as u8 | 1));
        put(&mut bytes, 94, &(length as u16).to_le_bytes());
        put(&mut bytes, 96, &at.to_le_bytes());
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn bytes_of_somebodys_own_behind_an_old_header_stay() {
        let folder = tempfile::tempdir().unwrap();
        let source = input(folder.path(), (2, 1), "in.las");
        lengthen_header(&source, 400);
        let target = folder.path().join("out.las");
        rewrite(&source, &target, &[], &WriteOptions::default()).unwrap();
        assert!(std::fs::read(&source).unwrap() == std::fs::read(&target).unwrap());
        rewrite(&source, &target, &[Edit::Classification(vec![64; POINTS])], &WriteOptions::default()).unwrap();
        let (old, new) = (Records::open(&source).unwrap().header, Records::open(&target).unwrap().header);
        assert_eq!((new.minor, &new.raw[375..]), (4, &old.raw[227..]));
    }

    #[test]
    fn promotion_of_a_1_4_file_keeps_its_extended_records() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["in.las", "in.laz"] {
            let source = input(folder.path(), (4, 3), name);
            for target in ["out.las", "out.laz"].map(|n| folder.path().join(n)) {
                rewrite(&source, &target, &[Edit::Classification(vec![200; POINTS])], &WriteOptions::default())
                    .unwrap();
                let (old, new) = (Records::open(&source).unwrap(), Records::open(&target).unwrap());
                assert_eq!(new.header.format, 7);
                let content =
                    |r: &Records| r.evlrs.iter().map(|v| (v.head.clone(), v.data.clone())).collect::<Vec<_>>();
                assert_eq!((content(&old), 2), (content(&new), new.evlrs.len()));
            }
        }
    }

    #[test]
    fn a_dimension_is_described_after_all_others_in_a_file_with_two_descriptions() {
        let folder = tempfile::tempdir().unwrap();
        let source = input(folder.path(), (4, 6), "in.las");
        let mut records = Records::open(&source).unwrap();
        let mut front = front(&records, false, &source);
        for (name, n) in [("First", 1), ("Second", 2)] {
            let values = if n == 1 { Values::U8(vec![]) } else { Values::U16(vec![]) };
            let data = extra::descriptor(&Column::new(name, values)).unwrap();
            front.vlrs.push(Vlr::new("LASF_Spec", 4, "", data));
        }
        let (odd, target) = (folder.path().join("odd.las"), folder.path().join("out.laz"));
        let mut writer = Writer::create(&odd, front).unwrap();
        let monitor = crate::parallel::Monitor::default();
        records.for_each(&monitor, |slab| writer.push(slab.bytes, &monitor)).unwrap();
        writer.finish(&[], &monitor, |header, _| put(header, 235, &[0; 12])).unwrap();
        let values = Values::F32((0..POINTS).map(|i| i as f32).collect());
        let edit = Edit::Dimension(Column::new("Third", values.clone()));
        rewrite(&odd, &target, &[edit], &WriteOptions::default()).unwrap();
        let (before, after) = (io::read(&odd).unwrap(), io::read(&target).unwrap());
        assert_eq!(after.column("Third").unwrap().values, values);
        for name in ["First", "Second"] {
            assert_eq!(before.column(name).unwrap(), after.column(name).unwrap());
        }
    }

    #[test]
    fn columns_read_alone_are_those_read_with_all_others() {
        let folder = tempfile::tempdir().unwrap();
        let mut files: Vec<PathBuf> =
            (0..=10).map(|format| input(folder.path(), (4, format), &format!("{format}.laz"))).collect();
        let data = std::env::var_os("SCANSION_DATA").map(PathBuf::from);
        let data = data.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"));
        match std::fs::read_dir(data.join("hostile")) {
            Ok(list) => {
                files.extend(list.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "laz")))
            }
            Err(_) => eprintln!("only own files: no real ones here (set SCANSION_DATA)"),
        }
        let mut compared = 0;
        for path in files {
            let Ok(whole) = io::read(&path) else { continue };
            for column in whole.columns() {
                let options = ReadOptions { columns: Columns::Only(vec![column.name.clone()]), ..Default::default() };
                let Ok(alone) = io::read_with(&path, &options) else { panic!("{}", path.display()) };
                assert!(alone.coordinates() == whole.coordinates(), "{}", path.display());
                // A name that the file has twice is told apart only when both are read.
                if let Some(found) = alone.column(&column.name) {
                    let bits = |v: &Values| v.to_f64().into_iter().map(f64::to_bits).collect::<Vec<_>>();
                    assert!(bits(&found.values) == bits(&column.values), "{} {}", path.display(), column.name);
                    compared += 1;
                }
            }
        }
        assert!(compared > 100, "{compared}");
    }

    /// A file with one chunk of `bytes` whose header and LAZ record declare `points` points.
    fn one_chunk(source: &Path, target: &Path, (bytes, points): (&[u8], u64)) {
        let records = Records::open(source).unwrap();
        let at = records.header.points_at as usize;
        let mut file = std::fs::read(source).unwrap()[..at].to_vec();
        let field = if records.header.minor >= 4 { 247 } else { 107 };
        put(&mut file, field, &points.to_le_bytes()[..if field == 247 { 8 } else { 4 }]);
        if records.header.minor >= 4 {
            put(&mut file, 235, &[0; 12]);
        }
        let name = file.windows(14).position(|w| w == b"laszip encoded").unwrap();
        put(&mut file, name - 2 + 54 + 12, &(u32::MAX - 1).to_le_bytes());
        let mut vlr = records.vlrs.iter().find(|v| v.is("laszip encoded", 22204)).unwrap().data.clone();
        put(&mut vlr, 12, &(u32::MAX - 1).to_le_bytes());
        let vlr = laz::LazVlr::from_buffer(&vlr).unwrap();
        file.extend((at as u64 + 8 + bytes.len() as u64).to_le_bytes());
        file.extend(bytes);
        file.extend(super::super::chunks::encode_table(target, &vlr, &[(points, bytes.len() as u64)]).unwrap());
        std::fs::write(target, file).unwrap();
    }

    #[test]
    fn a_count_of_four_billion_points_in_a_small_file_is_an_error_without_the_memory() {
        let folder = tempfile::tempdir().unwrap();
        for (minor, format) in [(4, 7), (3, 3)] {
            let source = input(folder.path(), (minor, format), "in.laz");
            let target = folder.path().join("bomb.laz");
            let mut random = crate::random::stream(1, 0);
            let bytes: Vec<u8> = (0..1 << 20).map(|_| random.below(256) as u8).collect();
            one_chunk(&source, &target, (&bytes, u64::from(u32::MAX) - 1));
            let start = std::time::Instant::now();
            assert!(io::read(&target).is_err(), "format {format}");
            assert!(rewrite(&target, &folder.path().join("out.laz"), &[], &WriteOptions::default()).is_err());
            assert!(start.elapsed().as_secs() < 4, "format {format}: {:?}", start.elapsed());
        }
    }

    #[test]
    fn a_chunk_too_large_for_memory_at_once_is_read_in_pieces() {
        let folder = tempfile::tempdir().unwrap();
        let rows: Vec<[f64; 3]> = (0..450_000).map(|i| [f64::from(i % 777), f64::from(i / 777), 1.0]).collect();
        let (source, target) = (folder.path().join("in.laz"), folder.path().join("large.laz"));
        io::write(&source, &crate::Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
        let mut records = Records::open(&source).unwrap();
        let front = Front { chunk: Some(300_000), ..front(&records, false, &target) };
        let mut writer = Writer::create(&target, front).unwrap();
        let monitor = crate::parallel::Monitor::default();
        records.for_each(&monitor, |slab| writer.push(slab.bytes, &monitor)).unwrap();
        writer.finish(&[], &monitor, |_, _| {}).unwrap();
        let chunks = Records::open(&target).unwrap().chunks.unwrap().list;
        assert_eq!(chunks.iter().map(|c| c.points).collect::<Vec<_>>(), [300_000, 150_000]);
        assert!(io::read(&target).unwrap() == io::read(&source).unwrap());
    }
}
