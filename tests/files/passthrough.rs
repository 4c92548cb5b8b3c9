//! Rewriting changes only what was requested: versions 1.0-1.4 x formats 0-10 x LAS and LAZ. The `las` crate writes the
//! inputs and reads the outputs.

use las::{Builder, Color, Point, Reader, Version, Vlr, Writer, point::Format};
use scansion_core::cloud::{Column, Values};
use scansion_core::io::{self, Edit, WriteOptions};
use std::path::{Path, PathBuf};

const POINTS: usize = 300;

fn input(folder: &Path, (minor, format): (u8, u8), laz: bool) -> Option<PathBuf> {
    let path = folder.join(format!("in_{minor}_{format}.{}", if laz { "laz" } else { "las" }));
    let mut builder = Builder::from((1, minor));
    builder.point_format = Format::new(format).ok()?;
    builder.point_format.is_compressed = laz;
    builder.point_format.extra_bytes = 3;
    builder.vlrs.push(Vlr {
        user_id: "somebody".into(),
        record_id: 77,
        description: "keep me".into(),
        data: vec![1, 2, 3, 4, 5],
    });
    if minor == 4 {
        builder.evlrs.push(Vlr {
            user_id: "somebody".into(),
            record_id: 78,
            description: "and me".into(),
            data: vec![9; 1000],
        });
        builder.evlrs.push(Vlr {
            user_id: "somebody".into(),
            record_id: 79,
            description: "me too".into(),
            data: vec![8; 10],
        });
    }
    let header = builder.into_header().ok()?;
    let has = *header.point_format();
    let mut writer = Writer::from_path(&path, header).ok()?;
    for i in 0..POINTS {
        let point = Point {
            x: i as f64 * 0.5,
            y: -(i as f64),
            z: 10.0 + (i % 7) as f64,
            intensity: (i * 200) as u16,
            return_number: 1 + (i % 3) as u8,
            number_of_returns: 3,
            user_data: (i % 256) as u8,
            scan_angle: (i % 40) as f32 - 20.0,
            point_source_id: 7,
            gps_time: has.has_gps_time.then_some(i as f64 * 0.25),
            color: has.has_color.then_some(Color::new(i as u16, 2, 65_000)),
            nir: has.has_nir.then_some(i as u16),
            waveform: has.has_waveform.then(Default::default),
            extra_bytes: vec![i as u8, 1, 2],
            ..Point::default()
        };
        writer.write_point(point).ok()?;
    }
    writer.close().ok()?;
    Some(path)
}

fn points(path: &Path) -> (Vec<Point>, Reader) {
    let mut reader = Reader::from_path(path).unwrap();
    let points = reader.read_all().unwrap().points().map(Result::unwrap).collect();
    (points, reader)
}

#[test]
fn only_the_asked_fields_change_in_every_version_and_format() {
    let folder = tempfile::tempdir().unwrap();
    let mut cases = 0;
    for minor in 0..=4u8 {
        for format in 0..=10u8 {
            for (from, to) in [(false, "las"), (false, "laz"), (true, "las"), (true, "laz")] {
                let Some(source) = input(folder.path(), (minor, format), from) else { continue };
                check(&source, &folder.path().join(format!("out.{to}")));
                cases += 1;
            }
        }
    }
    assert!(cases >= 60, "only {cases} cases could be made");
}

fn check(source: &Path, target: &Path) {
    let codes: Vec<u8> = (0..POINTS).map(|i| [2, 5, 6, 31][i % 4]).collect();
    let confidence: Vec<f32> = (0..POINTS).map(|i| i as f32 / 1000.0).collect();
    let edits = [
        Edit::Classification(codes.clone()),
        Edit::Dimension(Column::new("Confidence", Values::F32(confidence.clone()))),
    ];
    io::rewrite(source, target, &edits, &WriteOptions::default())
        .unwrap_or_else(|e| panic!("{}: {e}", source.display()));
    let ((before, old), (after, new)) = (points(source), points(target));
    assert_eq!(before.len(), after.len());
    for (i, (a, b)) in before.iter().zip(&after).enumerate() {
        assert_eq!(u8::from(b.classification), codes[i], "{} point {i}", source.display());
        assert_eq!(b.extra_bytes[..3], a.extra_bytes[..], "{}", source.display());
        assert_eq!(b.extra_bytes[3..], confidence[i].to_le_bytes());
        let same = Point { classification: a.classification, extra_bytes: a.extra_bytes.clone(), ..b.clone() };
        assert_eq!(same, *a, "{} point {i}", source.display());
    }
    let (old, new) = (old.header(), new.header());
    assert_eq!((old.version(), old.bounds(), old.transforms()), (new.version(), new.bounds(), new.transforms()));
    let kept = |h: &las::Header| {
        h.vlrs().iter().filter(|v| v.user_id == "somebody").map(|v| v.data.clone()).collect::<Vec<_>>()
    };
    assert_eq!(kept(old), kept(new));
    assert_eq!(old.evlrs().len(), new.evlrs().len(), "{}", source.display());
    assert!(old.evlrs().iter().zip(new.evlrs()).all(|(a, b)| a.data == b.data));
    let back = io::read(target).unwrap();
    assert_eq!(back.column("Confidence").unwrap().values, Values::F32(confidence));
    assert_eq!(back.column("Classification").unwrap().values, Values::U8(codes));
}

#[test]
fn codes_above_31_promote_old_formats_and_keep_all_fields() {
    let folder = tempfile::tempdir().unwrap();
    for format in 0..=5u8 {
        let Some(source) = input(folder.path(), (3, format), false) else { continue };
        let target = folder.path().join("promoted.laz");
        let report =
            io::rewrite(&source, &target, &[Edit::Classification(vec![64; POINTS])], &WriteOptions::default()).unwrap();
        assert!(report.notes[0].contains("LAS 1.4"), "{:?}", report.notes);
        let ((before, _), (after, reader)) = (points(&source), points(&target));
        assert_eq!(reader.header().version(), Version::new(1, 4));
        for (a, b) in before.iter().zip(&after) {
            assert_eq!(u8::from(b.classification), 64);
            assert_eq!(
                (a.x, a.y, a.z, a.intensity, a.color, a.user_data, a.return_number),
                (b.x, b.y, b.z, b.intensity, b.color, b.user_data, b.return_number)
            );
            assert_eq!(a.gps_time.unwrap_or(0.0), b.gps_time.unwrap_or(0.0));
            assert!((a.scan_angle - b.scan_angle).abs() < 0.004);
            assert_eq!(a.extra_bytes, b.extra_bytes);
        }
    }
}

#[test]
fn without_edits_an_uncompressed_file_comes_back_byte_for_byte_and_onto_itself() {
    let folder = tempfile::tempdir().unwrap();
    let source = input(folder.path(), (4, 7), false).unwrap();
    let bytes = std::fs::read(&source).unwrap();
    let target = folder.path().join("copy.las");
    io::rewrite(&source, &target, &[], &WriteOptions::default()).unwrap();
    assert!(std::fs::read(&target).unwrap() == bytes);
    io::rewrite(&source, &source, &[], &WriteOptions::default()).unwrap();
    assert!(std::fs::read(&source).unwrap() == bytes);
}

#[test]
fn a_cloud_of_our_own_is_read_alike_by_the_peer() {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = scansion_tests::street(10.0, 1);
    let n = cloud.len();
    cloud.set_column(Column::new("Intensity", Values::U16((0..n).map(|i| i as u16).collect()))).unwrap();
    cloud.set_column(Column::new("Red", Values::U16(vec![300; n]))).unwrap();
    cloud.set_column(Column::new("Height", Values::F32((0..n).map(|i| i as f32 * 0.1).collect()))).unwrap();
    for name in ["own.las", "own.laz"] {
        let path = folder.path().join(name);
        io::write(&path, &cloud, &WriteOptions::default()).unwrap();
        let (points, _) = points(&path);
        assert_eq!(points.len(), n);
        for (i, p) in points.iter().enumerate() {
            let [x, y, z] = cloud.xyz(i);
            assert!((p.x - x).abs() < 6e-4 && (p.y - y).abs() < 6e-4 && (p.z - z).abs() < 6e-4);
            assert_eq!((p.intensity, p.color.unwrap().red), (i as u16, 300));
        }
        let back = io::read(&path).unwrap();
        assert_eq!(back.column("Height").unwrap().values, cloud.column("Height").unwrap().values);
    }
}

#[test]
fn columns_of_real_files_read_alone_are_those_read_with_all_others() {
    let Some(data) = scansion_tests::data() else { return };
    let list = std::fs::read_dir(data.join("hostile")).unwrap().map(|entry| entry.unwrap().path());
    let mut compared = 0;
    for path in list.filter(|path| path.extension().is_some_and(|e| e == "laz")) {
        let Ok(whole) = io::read(&path) else { continue };
        for column in whole.columns() {
            let columns = io::Columns::Only(vec![column.name.clone()]);
            let alone = io::read_with(&path, &io::ReadOptions { columns, ..Default::default() }).unwrap();
            assert!(alone.coordinates() == whole.coordinates(), "{}", path.display());
            // A name that occurs twice gets a number only when both columns are read.
            if let Some(found) = alone.column(&column.name) {
                let bits = |values: &Values| values.to_f64().into_iter().map(f64::to_bits).collect::<Vec<_>>();
                assert!(bits(&found.values) == bits(&column.values), "{} {}", path.display(), column.name);
                compared += 1;
            }
        }
    }
    assert!(compared > 20, "{compared}");
}
