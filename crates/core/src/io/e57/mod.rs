//! E57 (ASTM E2807): the scans of a file as one cloud, with poses applied. Decoded by the `e57` crate, behind our own
//! checks.
//!
//! Points marked as invalid are left out; spherical coordinates are converted to Cartesian ones (E2807, 8.4.4). If
//! there are several scans, the column `ScanIndex` has the index of each point's scan, from 0. Values that a scan
//! lacks, or marks as invalid, are 0.

mod columns;
mod guard;
mod pose;
mod scan;

use super::table::limits;
use crate::cloud::{Cloud, Column, Values};
use crate::error::Result;
use crate::io::table::Table;
use crate::io::{FileInfo, ReadOptions};
use crate::memory;
use columns::ScanColumns;
use std::path::Path;

/// Reads all scans.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let mut file = guard::open(path)?;
    let scans = file.scans(path)?;
    let columns = ScanColumns::of(&scans, options);
    let points: u64 = scans.iter().map(|s| s.records).sum();
    limits::unpacked(path, "E57", file.size(), columns.width().saturating_mul(points))?;
    let mut table = Table { columns: columns.empty(), ..Table::default() };
    table.reserve(points as usize)?;
    let mut index = Vec::new();
    memory::reserve(&mut index, points as usize, "the numbers of the scans")?;
    options.monitor.stage("read", points);
    for (number, cloud) in (0..).zip(&scans) {
        let reader = scan::Scan::new(path, number, cloud, &columns)?;
        file.guarded(path, &format!("scan {number}"), |e57| reader.read(e57, cloud, &mut table, &options.monitor))?;
        index.resize(table.len(), number);
    }
    if scans.len() > 1 && options.wants("ScanIndex") {
        table.columns.push(Column::new("ScanIndex", Values::U32(index)));
    }
    let mut cloud = table.cloud()?;
    (cloud.crs, cloud.metres_per_unit) = (file.crs(), Some(1.0));
    Ok(cloud)
}

/// Information from the XML section.
pub(super) fn inspect(path: &Path) -> Result<FileInfo> {
    let file = guard::open(path)?;
    let scans = file.scans(path)?;
    let mut info = FileInfo::new(path, "E57", scans.iter().map(|s| s.records).sum());
    info.version = Some("1.0".into());
    (info.crs, info.metres_per_unit) = (file.crs(), Some(1.0));
    info.dimensions = ScanColumns::of(&scans, &ReadOptions::default()).names();
    if scans.len() > 1 {
        info.dimensions.push("ScanIndex".into());
    }
    let name = |scan: &::e57::PointCloud| scan.name.clone().unwrap_or_default();
    info.vlrs = scans.iter().map(|s| format!("scan {} of {} points", name(s), s.records)).collect();
    Ok(info)
}

#[cfg(test)]
mod tests {
    use crate::cloud::Cloud;
    use crate::error::Result;
    use crate::io;
    use ::e57::{E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation};
    use std::path::Path;

    fn record(name: RecordName, data_type: RecordDataType) -> Record {
        Record { name, data_type }
    }

    const INTEGER: fn(i64, i64) -> RecordDataType = |min, max| RecordDataType::Integer { min, max };
    const SINGLE: RecordDataType = RecordDataType::Single { min: None, max: None };

    /// A scan of Cartesian points with a pose (a quarter turn about z), and one of spherical points.
    fn write(path: &Path) {
        let mut file = E57Writer::from_file(path, "file").unwrap();
        let scaled = RecordDataType::ScaledInteger { min: -10_000, max: 10_000, scale: 0.001, offset: 100.0 };
        let first = vec![
            record(RecordName::CartesianX, RecordDataType::F64),
            record(RecordName::CartesianY, RecordDataType::F64),
            record(RecordName::CartesianZ, scaled),
            record(RecordName::CartesianInvalidState, INTEGER(0, 2)),
            record(RecordName::Intensity, SINGLE),
            record(RecordName::IsIntensityInvalid, INTEGER(0, 1)),
        ];
        let mut scan = file.add_pointcloud("a", first).unwrap();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        scan.set_transform(Some(Transform {
            rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
            translation: Translation { x: 1000.0, y: 2000.0, z: 0.0 },
        }));
        for (x, state, invalid) in [(1.0, 0, 0), (2.0, 2, 0), (3.0, 1, 0), (4.0, 0, 1)] {
            let values = [RecordValue::Double(x), RecordValue::Double(0.5), RecordValue::ScaledInteger(-1500)];
            let rest = [RecordValue::Integer(state), RecordValue::Single(0.25), RecordValue::Integer(invalid)];
            scan.add_point(values.into_iter().chain(rest).collect()).unwrap();
        }
        scan.finalize().unwrap();
        let second = vec![
            record(RecordName::SphericalRange, SINGLE),
            record(RecordName::SphericalAzimuth, SINGLE),
            record(RecordName::SphericalElevation, SINGLE),
            record(RecordName::ColorRed, INTEGER(0, 255)),
            record(RecordName::ColorGreen, INTEGER(0, 255)),
            record(RecordName::ColorBlue, INTEGER(7, 7)),
        ];
        let mut scan = file.add_pointcloud("b", second).unwrap();
        let quarter = std::f32::consts::FRAC_PI_2;
        for (azimuth, elevation) in [(0.0, 0.0), (quarter, 0.0), (0.0, quarter)] {
            let values = [2.0, azimuth, elevation].map(RecordValue::Single).into_iter();
            scan.add_point(values.chain([200, 3, 7].map(RecordValue::Integer)).collect()).unwrap();
        }
        scan.finalize().unwrap();
        file.finalize().unwrap();
    }

    fn near(cloud: &Cloud, i: usize, expected: [f64; 3]) {
        let found = cloud.xyz(i);
        assert!((0..3).all(|a| (found[a] - expected[a]).abs() < 1e-6), "{i}: {found:?} {expected:?}");
    }

    #[test]
    fn scans_are_merged_with_poses_states_and_spherical_coordinates() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.e57");
        write(&path);
        let cloud = io::read(&path).unwrap();
        assert_eq!(cloud.len(), 5);
        // (x, 0.5, 98.5) rotated to (-0.5, x, 98.5) and shifted.
        near(&cloud, 0, [999.5, 2001.0, 98.5]);
        near(&cloud, 1, [999.5, 2004.0, 98.5]);
        near(&cloud, 2, [2.0, 0.0, 0.0]);
        near(&cloud, 3, [0.0, 2.0, 0.0]);
        near(&cloud, 4, [0.0, 0.0, 2.0]);
        let column = |name: &str| cloud.column(name).unwrap().values.to_f64();
        assert_eq!(column("ScanIndex"), [0.0, 0.0, 1.0, 1.0, 1.0]);
        assert_eq!(column("Intensity"), [0.25, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(column("Red"), [0.0, 0.0, 200.0, 200.0, 200.0]);
        assert_eq!(column("Blue"), [0.0, 0.0, 7.0, 7.0, 7.0]);
        assert_eq!(cloud.column("Red").unwrap().values.type_name(), "u1");
        let info = io::inspect(&path).unwrap();
        assert_eq!((info.points, &info.format[..], info.metres_per_unit), (7, "E57", Some(1.0)));
    }

    /// Replaces text in the XML section, keeping its length, and updates the checksums of the pages.
    fn patched(path: &Path, changes: &[(&str, &str)]) -> Result<Cloud> {
        let mut bytes: Vec<u8> =
            std::fs::read(path).unwrap().chunks_exact(1024).flat_map(|p| p[..1020].to_vec()).collect();
        let before = bytes.len();
        for (from, to) in changes {
            assert!(bytes.windows(from.len()).any(|w| w == from.as_bytes()), "{from}");
            while let Some(at) = bytes.windows(from.len()).position(|w| w == from.as_bytes()) {
                bytes.splice(at..at + from.len(), to.bytes());
            }
        }
        assert_eq!(bytes.len(), before);
        let sealed = |page: &[u8]| [page, &super::guard::tests::checksum(page).to_be_bytes()].concat();
        std::fs::write(path, bytes.chunks_exact(1020).flat_map(sealed).collect::<Vec<u8>>()).unwrap();
        io::read(path)
    }

    #[test]
    fn hostile_counts_sizes_and_poses_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.e57");
        write(&path);
        assert_eq!(patched(&path, &[]).unwrap().len(), 5);
        for (from, to, expected) in [
            ("recordCount=\"3\"", "recordCount=\"9\"", "scan 1, point 3"),
            ("fileOffset=\"48\"", "fileOffset=\"49\"", "scan 0"),
            ("sphericalRange", "sphericalRangf", "coordinates"),
        ] {
            write(&path);
            let message = patched(&path, &[(from, to)]).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        write(&path);
        let bytes = std::fs::read(&path).unwrap();
        for (at, expected) in [(16, "file length"), (24, "XML"), (33, "XML"), (40, "page size"), (100, "checksum")] {
            let mut mutant = bytes.clone();
            mutant[at] ^= 0x55;
            std::fs::write(&path, &mutant).unwrap();
            let message = io::read(&path).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(expected), "{at}: {message}");
        }
        for length in [8, 47, 48, 1023, 1024, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(io::read(&path).is_err(), "cut at {length}");
        }
    }

    #[test]
    fn identical_points_that_take_no_bytes_are_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.e57");
        let mut file = E57Writer::from_file(&path, "file").unwrap();
        let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
        let nearly = RecordDataType::ScaledInteger { min: 5, max: 6, scale: 0.5, offset: 1.0 };
        let mut scan = file.add_pointcloud("a", axes.map(|n| record(n, nearly.clone())).to_vec()).unwrap();
        scan.set_description(Some("0123456789".into()));
        for _ in 0..30 {
            scan.add_point(vec![RecordValue::ScaledInteger(5); 3]).unwrap();
        }
        scan.finalize().unwrap();
        file.finalize().unwrap();
        let constant = ("maximum=\"6\"", "maximum=\"5\"");
        let cloud = patched(&path, &[constant]).unwrap();
        assert_eq!((cloud.len(), cloud.xyz(29)), (30, [3.5; 3]));
        let more = patched(&path, &[("0123456789", "01234"), ("\"30\"", "\"1000000\"")]).unwrap();
        assert_eq!(more.len(), 1_000_000);
        let message = patched(&path, &[("\"1000000\"", "\"9000000\"")]).unwrap_err().to_string();
        assert!(message.contains("recordCount") && message.contains("1000000"), "{message}");
    }
}
