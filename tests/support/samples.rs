//! Small valid files of every format, to be damaged by tests.

use crate::data;
use scansion_core::Cloud;
use scansion_core::cloud::{Column, Values};
use scansion_core::io::{self, WriteOptions};
use std::path::{Path, PathBuf};

/// The formats that [`of`] has samples of.
pub const FORMATS: [&str; 9] = ["las", "laz", "copc", "ply", "text", "pcd", "npz", "e57", "kitti"];

/// A name with the format's extension, and the bytes of the file.
pub type Sample = (String, Vec<u8>);

/// A cloud with columns of several types.
///
/// # Panics
/// Never: the columns are as long as the cloud.
#[must_use]
pub fn cloud(points: usize) -> Cloud {
    let rows: Vec<[f64; 3]> =
        (0..points).map(|i| [(i % 13) as f64 * 0.5, (i / 13) as f64, (i * 7 % 5) as f64 * 0.25]).collect();
    let mut cloud = Cloud::from_rows(&rows).expect("three axes");
    let mut set = |name: &str, values| cloud.set_column(Column::new(name, values)).expect("one value a point");
    set("Intensity", Values::U16((0..points).map(|i| (i * 31) as u16).collect()));
    set("Classification", Values::U8((0..points).map(|i| [2, 5, 6][i % 3]).collect()));
    set("Height", Values::F32((0..points).map(|i| i as f32 * 0.5).collect()));
    cloud.crs = Some("PROJCS[\"a\",UNIT[\"metre\",1]]".into());
    cloud
}

/// Samples of a format, our own first; also real ones if the shared data are available.
///
/// # Panics
/// If the folder cannot be written.
#[must_use]
pub fn of(format: &str, folder: &Path) -> Vec<Sample> {
    let own = |name: &str, compressed| {
        let path = folder.join(name);
        io::write(&path, &cloud(60), &WriteOptions { compressed, ..Default::default() }).expect("a folder to write in");
        (name.to_string(), std::fs::read(path).expect("what was written"))
    };
    let mut samples = match format {
        "las" => vec![own("seed.las", false), peer(folder, "las")],
        "laz" => vec![own("seed.laz", false), peer(folder, "laz")],
        "copc" => vec![("seed.copc.laz".into(), copc(&own("seed.laz", false).1))],
        "ply" => vec![own("seed.ply", false), ("ascii.ply".into(), ASCII_PLY.into()), ("big.ply".into(), big_ply())],
        "text" => vec![
            own("seed.txt", false),
            ("plain.txt".into(), PLAIN.into()),
            ("seed.pts".into(), PTS.into()),
            ("seed.ptx".into(), PTX.into()),
        ],
        "kitti" => vec![("seed.bin".into(), (0..240u16).flat_map(|i| f32::from(i).to_le_bytes()).collect())],
        "e57" => vec![("seed.e57".into(), e57(&folder.join("seed.e57")))],
        other => vec![own(&format!("seed.{other}"), false), own(&format!("packed.{other}"), true)],
    };
    samples.extend(match format {
        "copc" => shared(".copc.laz", 5_000),
        "e57" => shared(".e57", 20_000),
        "pcd" => shared(".pcd", 20_000),
        _ => Vec::new(),
    });
    samples
}

const PLAIN: &str = "1.5 2.5 3.5 -100 10 20 30\n4 5 6 7 8 9 10\n-7.25e1 8 9 10 11 12 13\n";
const PTS: &str = "2\n1 2 3 -900 10 20 30\n4 5 6 7 40 50 60\n";
const PTX: &str = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n\
                   1 2 3 0.5\n4 5 6 0.25\n0 0 0 0\n7 8 9 1\n";
const ASCII_PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty double z\n\
                         property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                         0 0 1 7\n1 0 2.5 8\n0 1 -3e2 9\n3 0 1 2\n";

fn big_ply() -> Vec<u8> {
    let head = &b"ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list uchar int i\nelement vertex 2\n\
        property float x\nproperty float y\nproperty float z\nproperty list uchar short n\nend_header\n\
        \x02\0\0\0\x01\0\0\0\x02"[..];
    [head, &[63; 12], &[1, 0, 9], &[63; 12], &[0]].concat()
}

/// Readable real files, by the end of their names.
fn shared(part: &str, most: u64) -> Vec<Sample> {
    let Some(Ok(entries)) = data().map(|d| d.join("hostile").read_dir()) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(|e| e.ok().map(|e| e.path())).collect();
    paths.sort();
    let fits = |p: &PathBuf| p.to_string_lossy().ends_with(part) && p.metadata().is_ok_and(|m| m.len() < most);
    let sound = paths.into_iter().filter(fits).filter(|p| io::read(p).is_ok());
    sound.filter_map(|p| Some((format!("real{part}"), std::fs::read(p).ok()?))).collect()
}

/// A file of an old point format, whose LAZ chunks have no layers, written by the `las` crate.
fn peer(folder: &Path, extension: &str) -> Sample {
    let path = folder.join(format!("peer.{extension}"));
    let mut builder = las::Builder::from((1, 3));
    builder.point_format = las::point::Format::new(3).expect("a format");
    builder.point_format.is_compressed = extension == "laz";
    builder.point_format.extra_bytes = 2;
    let header = builder.into_header().expect("a header");
    let mut writer = las::Writer::from_path(&path, header).expect("a folder to write in");
    for i in 0..40u16 {
        let color = Some(las::Color::new(i, 2 * i, 3));
        let (gps_time, extra_bytes) = (Some(1.0), vec![1, 2]);
        let point = las::Point { x: f64::from(i), intensity: i, gps_time, color, extra_bytes, ..las::Point::default() };
        writer.write_point(point).expect("a point");
    }
    writer.close().expect("a disk");
    (format!("peer.{extension}"), std::fs::read(path).expect("what was written"))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// A LAZ file of one chunk with an octree: its chunk is the root, a second page has a node without points.
fn copc(laz: &[u8]) -> Vec<u8> {
    const RECORD: usize = 54 + 160;
    let points_at = u32_at(laz, 96) as usize;
    let table = u32_at(laz, points_at) as usize;
    let mut record = vec![0; RECORD];
    record[2..6].copy_from_slice(b"copc");
    record[18] = 1;
    record[20] = 160;
    let root = (laz.len() + RECORD) as u64;
    for (at, value) in [(0, 5.0), (8, 5.0), (16, 5.0), (24, 8.0), (32, 4.0f64)] {
        record[54 + at..62 + at].copy_from_slice(&value.to_le_bytes());
    }
    record[94..102].copy_from_slice(&root.to_le_bytes());
    record[102..110].copy_from_slice(&64u64.to_le_bytes());
    let mut bytes = [&laz[..375], &record, &laz[375..]].concat();
    bytes[96..100].copy_from_slice(&((points_at + RECORD) as u32).to_le_bytes());
    bytes[100..104].copy_from_slice(&(u32_at(laz, 100) + 1).to_le_bytes());
    let moved = points_at + RECORD;
    bytes[moved..moved + 8].copy_from_slice(&((table + RECORD) as u64).to_le_bytes());
    let entry = |key: [i32; 4], at: u64, (size, points): (i32, i32)| {
        let key: Vec<u8> = key.iter().flat_map(|v| v.to_le_bytes()).collect();
        [&key[..], &at.to_le_bytes(), &size.to_le_bytes(), &points.to_le_bytes()].concat()
    };
    let chunk = ((table - points_at - 8) as i32, u32_at(laz, 247) as i32);
    bytes.extend(entry([0; 4], moved as u64 + 8, chunk));
    bytes.extend(entry([1, 1, 0, 0], root + 64, (32, -1)));
    bytes.extend(entry([1, 1, 0, 0], 0, (0, 0)));
    bytes
}

/// Two scans: numbers of several widths with a pose, and spherical coordinates.
fn e57(path: &Path) -> Vec<u8> {
    use e57::{E57Writer, Record, RecordDataType as Type, RecordName as Name, RecordValue as Value};
    let record = |name, data_type| Record { name, data_type };
    let single = Type::Single { min: None, max: None };
    let scaled = Type::ScaledInteger { min: -1000, max: 1000, scale: 0.01, offset: 5.0 };
    let mut file = E57Writer::from_file(path, "sample").expect("a folder to write in");
    let fields = vec![
        record(Name::CartesianX, Type::F64),
        record(Name::CartesianY, scaled.clone()),
        record(Name::CartesianZ, scaled),
        record(Name::CartesianInvalidState, Type::Integer { min: 0, max: 2 }),
        record(Name::Intensity, single.clone()),
    ];
    let mut scan = file.add_pointcloud("a", fields).expect("fields");
    scan.set_transform(Some(e57::Transform {
        rotation: e57::Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 },
        translation: e57::Translation { x: 1000.0, y: 2000.0, z: 0.0 },
    }));
    for i in 0..20 {
        let place = [Value::Double(i as f64), Value::ScaledInteger(i), Value::ScaledInteger(-i)];
        let rest = [Value::Integer(i % 3), Value::Single(0.5)];
        scan.add_point(place.into_iter().chain(rest).collect()).expect("a point");
    }
    scan.finalize().expect("a scan");
    let fields = vec![
        record(Name::SphericalRange, single.clone()),
        record(Name::SphericalAzimuth, single.clone()),
        record(Name::SphericalElevation, single),
        record(Name::ColorRed, Type::Integer { min: 0, max: 255 }),
        record(Name::ColorGreen, Type::Integer { min: 0, max: 255 }),
        record(Name::ColorBlue, Type::Integer { min: 7, max: 7 }),
    ];
    let mut scan = file.add_pointcloud("b", fields).expect("fields");
    for i in 0..20 {
        let place = [2.0, i as f32 * 0.1, 0.2].map(Value::Single);
        scan.add_point(place.into_iter().chain([i, 3, 7].map(Value::Integer)).collect()).expect("a point");
    }
    scan.finalize().expect("a scan");
    file.finalize().expect("a file");
    std::fs::read(path).expect("what was written")
}

/// Sets the checksums of the pages of an E57 file (CRC-32C, most significant byte first).
pub fn seal(bytes: &mut [u8]) {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
    for page in bytes.chunks_exact_mut(1024) {
        let sum = !page[..1020].iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step));
        page[1020..].copy_from_slice(&sum.to_be_bytes());
    }
}
