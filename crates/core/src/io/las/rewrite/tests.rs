//! Tests of rewriting.

use super::*;
use crate::cloud::{Column, Values};
use crate::io::las::fields::extra;
use crate::io::las::header::put;
use crate::io::las::header::vlr::Vlr;
use crate::io::rewrite;
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

/// Inserts user data after the header.
fn lengthen_header(path: &Path, length: usize) {
    let mut bytes = std::fs::read(path).unwrap();
    let old = usize::from(u16::from_le_bytes([bytes[94], bytes[95]]));
    let at = crate::io::las::header::u32_at(&bytes, 96) + (length - old) as u32;
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
            rewrite(&source, &target, &[Edit::Classification(vec![200; POINTS])], &WriteOptions::default()).unwrap();
            let (old, new) = (Records::open(&source).unwrap(), Records::open(&target).unwrap());
            assert_eq!(new.header.format, 7);
            let content = |r: &Records| r.evlrs.iter().map(|v| (v.head.clone(), v.data.clone())).collect::<Vec<_>>();
            assert_eq!((content(&old), 2), (content(&new), new.evlrs.len()));
        }
    }
}

#[test]
fn a_dimension_is_described_after_all_others_in_a_file_with_two_descriptions() {
    let folder = tempfile::tempdir().unwrap();
    let source = input(folder.path(), (4, 6), "in.las");
    let mut records = Records::open(&source).unwrap();
    let mut front = front(&records, None, &source);
    for (name, n) in [("First", 1), ("Second", 2)] {
        let values = if n == 1 { Values::U8(vec![]) } else { Values::U16(vec![]) };
        let data = extra::descriptor(&Column::new(name, values)).unwrap();
        front.vlrs.push(Vlr::new("LASF_Spec", 4, "", data));
    }
    let (odd, target) = (folder.path().join("odd.las"), folder.path().join("out.laz"));
    let mut writer = Writer::create(&odd, front).unwrap();
    let monitor = crate::parallel::Monitor::default();
    records.for_each(&monitor, |slab| writer.push(slab.bytes, &monitor)).unwrap();
    writer.finish(&monitor, |_| Ok(0), |header, _| put(header, 235, &[0; 12])).unwrap();
    let values = Values::F32((0..POINTS).map(|i| i as f32).collect());
    let edit = Edit::Dimension(Column::new("Third", values.clone()));
    rewrite(&odd, &target, &[edit], &WriteOptions::default()).unwrap();
    let (before, after) = (io::read(&odd).unwrap(), io::read(&target).unwrap());
    assert_eq!(after.column("Third").unwrap().values, values);
    // Other software reads the first record only.
    let described = Records::open(&target).unwrap().vlrs.into_iter().filter(extra::is_record);
    assert_eq!(described.map(|v| v.data.len()).collect::<Vec<_>>(), [3 * 192]);
    for name in ["First", "Second"] {
        assert_eq!(before.column(name).unwrap(), after.column(name).unwrap());
    }
}

#[test]
fn columns_read_alone_are_those_read_with_all_others() {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> =
        (0..=10).map(|format| input(folder.path(), (4, format), &format!("{format}.laz"))).collect();
    let mut compared = 0;
    for path in files {
        let Ok(whole) = io::read(&path) else { continue };
        for column in whole.columns() {
            let options = ReadOptions { columns: Columns::Only(vec![column.name.clone()]), ..Default::default() };
            let Ok(alone) = io::read_with(&path, &options) else { panic!("{}", path.display()) };
            assert!(alone.coordinates() == whole.coordinates(), "{}", path.display());
            // A name that occurs twice gets a number only when both columns are read.
            if let Some(found) = alone.column(&column.name) {
                let bits = |v: &Values| v.to_f64().into_iter().map(f64::to_bits).collect::<Vec<_>>();
                assert!(bits(&found.values) == bits(&column.values), "{} {}", path.display(), column.name);
                compared += 1;
            }
        }
    }
    assert!(compared > 100, "{compared}");
}

/// A file with a single chunk of `bytes`, whose header and LAZ record declare `points` points.
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
    file.extend(crate::io::las::chunks::encode_table(target, &vlr, &[(points, bytes.len() as u64)]).unwrap());
    std::fs::write(target, file).unwrap();
}

#[test]
fn a_chunk_size_of_zero_means_chunks_of_any_size() {
    // lasR writes COPC files with it; LASzip takes it for the largest number, which says the same.
    let folder = tempfile::tempdir().unwrap();
    for (minor, format) in [(4, 7), (3, 3)] {
        let (source, target) = (input(folder.path(), (minor, format), "in.laz"), folder.path().join("zero.laz"));
        let records = Records::open(&source).unwrap();
        let [chunk] = records.chunks.as_ref().unwrap().list[..] else { panic!("one chunk") };
        let at = records.header.points_at as usize;
        let bytes = std::fs::read(&source).unwrap();
        let mut file = bytes[..at].to_vec();
        if minor >= 4 {
            put(&mut file, 235, &[0; 12]);
        }
        let name = file.windows(14).position(|w| w == b"laszip encoded").unwrap();
        put(&mut file, name - 2 + 54 + 12, &[0; 4]);
        let mut vlr = records.vlrs.iter().find(|v| v.is("laszip encoded", 22204)).unwrap().data.clone();
        put(&mut vlr, 12, &u32::MAX.to_le_bytes());
        let vlr = laz::LazVlr::from_buffer(&vlr).unwrap();
        let points = &bytes[chunk.at as usize..(chunk.at + chunk.bytes) as usize];
        file.extend((at as u64 + 8 + chunk.bytes).to_le_bytes());
        file.extend(points);
        file.extend(crate::io::las::chunks::encode_table(&target, &vlr, &[(chunk.points, chunk.bytes)]).unwrap());
        std::fs::write(&target, file).unwrap();
        assert!(io::read(&target).unwrap() == io::read(&source).unwrap());
        let copy = folder.path().join("copy.laz");
        rewrite(&target, &copy, &[], &WriteOptions::default()).unwrap();
        assert!(io::read(&copy).unwrap() == io::read(&source).unwrap());
    }
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
    let front = Front { chunk: Some(300_000), ..front(&records, None, &target) };
    let mut writer = Writer::create(&target, front).unwrap();
    let monitor = crate::parallel::Monitor::default();
    records.for_each(&monitor, |slab| writer.push(slab.bytes, &monitor)).unwrap();
    writer.finish(&monitor, |_| Ok(0), |_, _| {}).unwrap();
    let chunks = Records::open(&target).unwrap().chunks.unwrap().list;
    assert_eq!(chunks.iter().map(|c| c.points).collect::<Vec<_>>(), [300_000, 150_000]);
    assert!(io::read(&target).unwrap() == io::read(&source).unwrap());
}

#[test]
fn laz_items_of_wrong_sizes_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let source = input(folder.path(), (4, 7), "in.laz");
    let bytes = std::fs::read(&source).unwrap();
    let items = bytes.windows(14).position(|w| w == b"laszip encoded").unwrap() - 2 + 54 + 34;
    // Sizes whose sum overflows 16 bits, a size that is not the type's, a type that does not exist.
    for (at, value) in [(2, 65_535u16), (8, 65_535), (14, 65_535), (2, 29), (0, 99)] {
        let mut wrong = bytes.clone();
        put(&mut wrong, items + at, &value.to_le_bytes());
        let path = folder.path().join("wrong.laz");
        std::fs::write(&path, wrong).unwrap();
        let message = io::read(&path).unwrap_err().to_string();
        assert!(message.contains("LAZ item"), "{message}");
    }
}

#[test]
fn gps_times_of_both_signs_are_kept_or_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    for (minor, format) in [(2, 1), (4, 6)] {
        let source = input(folder.path(), (minor, format), "in.las");
        let mut bytes = std::fs::read(&source).unwrap();
        let records = Records::open(&source).unwrap();
        let (at, length) = (records.header.points_at as usize, usize::from(records.header.record_length));
        let time = if format >= 6 { 22 } else { 20 };
        for i in 0..POINTS {
            let value = if i % 2 == 0 { -5.5 } else { 1e9 } + i as f64;
            put(&mut bytes, at + i * length + time, &value.to_le_bytes());
        }
        std::fs::write(&source, bytes).unwrap();
        let before = io::read(&source).unwrap();
        for name in ["out.las", "out.laz"] {
            let target = folder.path().join(name);
            match rewrite(&source, &target, &[], &WriteOptions::default()) {
                Ok(_) => assert!(io::read(&target).unwrap() == before),
                Err(e) => assert!(name == "out.laz" && e.to_string().contains("write .las"), "{e}"),
            }
        }
    }
}
