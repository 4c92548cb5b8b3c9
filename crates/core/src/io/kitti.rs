//! SemanticKITTI: a sweep of a Velodyne scanner as `NAME.bin` (records of x, y, z and remission, 4-byte floats), and its
//! labels as `NAME.label` beside it or in the folder `../labels` (4-byte integers: the class in the lower 16 bits, the
//! number of the instance in the upper).
//!
//! J. Behley et al., *SemanticKITTI: A dataset for semantic scene understanding of LiDAR sequences*, ICCV 2019,
//! doi:10.1109/ICCV.2019.00939.

use super::atomic::AtomicFile;
use super::open;
use super::table::number::{Kind, Slot};
use super::table::packed::{Layout, Packed, PackedRecords, Target};
use super::{FileInfo, ReadOptions, WriteOptions};
use crate::cloud::{Cloud, CodeScheme, Column, Values, names};
use crate::error::{Error, Mismatch, Result};
use std::path::{Path, PathBuf};

/// Bytes of a point, and of a label.
const POINT: u64 = 16;
const LABEL: u64 = 4;

/// Name of the column with the number of the instance.
pub(super) const INSTANCE: &str = "Instance";

fn bad(path: &Path, field: &str, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "SemanticKITTI",
        field: field.to_string(),
        place: "the whole file".into(),
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

/// Number of records of this width.
fn count(path: &Path, width: u64) -> Result<u64> {
    let length = std::fs::metadata(path).map_err(|e| Error::io(path, e))?.len();
    match length % width {
        0 => Ok(length / width),
        _ => Err(bad(path, "size", Mismatch::new(format!("{length} bytes"), format!("a multiple of {width}")))),
    }
}

/// The file with the labels of a sweep, if there is one.
fn labels_of(path: &Path) -> Option<PathBuf> {
    let beside = path.with_extension("label");
    let name = beside.file_name()?.to_os_string();
    let folder = path.parent()?.parent()?.join("labels").join(name);
    [beside, folder].into_iter().find(|file| file.is_file())
}

/// Reads the labels of so many points: class and instance.
fn labels(path: &Path, points: u64) -> Result<[Vec<u16>; 2]> {
    let found = count(path, LABEL)?;
    if found != points {
        return Err(bad(path, "number of labels", Mismatch::new(found, format!("{points}, as there are points"))));
    }
    let bytes = open::bytes(path, points * LABEL)?;
    let half = |at: usize| bytes.chunks_exact(LABEL as usize).map(|b| u16::from_le_bytes([b[at], b[at + 1]])).collect();
    Ok([half(0), half(2)])
}

/// Reads a sweep, and its labels if there are any.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let points = count(path, POINT)?;
    let mut layout = Layout::default();
    let mut slot = |target, at| layout.slots.push((target, Slot { kind: Kind::F32, at, width: 16, big: false }));
    (0..3).for_each(|axis| slot(Target::Axis(axis), 4 * axis));
    if options.wants(names::INTENSITY) {
        slot(Target::Column(0), 12);
        layout.table.columns.push(Column::new(names::INTENSITY, Values::F32(Vec::new())));
    }
    options.monitor.stage("read", points);
    let records = PackedRecords { at: 0, count: points, width: POINT as usize };
    let mut cloud = Packed::open(path, records, layout, &options.monitor)?.take(usize::MAX)?;
    if let Some(file) = labels_of(path) {
        let [classes, instances] = labels(&file, points)?;
        for (name, values) in [(names::CLASSIFICATION, classes), (INSTANCE, instances)] {
            if options.wants(name) {
                cloud.set_column(Column::new(name, Values::U16(values)))?;
            }
        }
        cloud.scheme = CodeScheme::SemanticKitti;
    }
    Ok(cloud)
}

/// Number of points and columns.
pub(super) fn inspect(path: &Path) -> Result<FileInfo> {
    let mut info = FileInfo::new(path, "SemanticKITTI", count(path, POINT)?);
    info.dimensions.push(names::INTENSITY.into());
    match labels_of(path) {
        Some(file) => {
            labels(&file, info.points)?;
            info.dimensions.extend([names::CLASSIFICATION, INSTANCE].map(String::from));
        }
        None => info.warnings.push("no labels: neither NAME.label beside it nor in ../labels".into()),
    }
    Ok(info)
}

/// Writes the classes, and the instances if there are any, as `.label`.
pub(super) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let classes = cloud.column(names::CLASSIFICATION).map(|column| &column.values);
    let classes = classes.ok_or_else(|| Error::input("no Classification to write as .label"))?;
    let instances = cloud.column(INSTANCE).map(|column| &column.values);
    let half = |values: &Values, i: usize| {
        let value = values.get(i);
        let code = value as u16;
        let wrong = || Error::input(format!("point {i} has {value}; .label has room for 0..65535"));
        ((f64::from(code) - value).abs() == 0.0).then_some(code).ok_or_else(wrong)
    };
    let mut file = AtomicFile::create(path)?;
    options.monitor.stage("write", cloud.len() as u64);
    for points in crate::parallel::watched(cloud.len(), &options.monitor) {
        let mut bytes = Vec::new();
        for i in points? {
            let instance = instances.map_or(Ok(0), |values| half(values, i))?;
            bytes.extend(half(classes, i)?.to_le_bytes());
            bytes.extend(instance.to_le_bytes());
        }
        file.write_all(&bytes)?;
    }
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io;

    fn sweep(folder: &Path, points: usize) -> PathBuf {
        let path = folder.join("velodyne/000001.bin");
        std::fs::create_dir_all(folder.join("velodyne")).unwrap();
        let numbers = (0..4 * points).flat_map(|i| (i as f32 * 0.5).to_le_bytes());
        std::fs::write(&path, numbers.collect::<Vec<u8>>()).unwrap();
        path
    }

    fn label(path: &Path, codes: &[u32]) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, codes.iter().flat_map(|code| code.to_le_bytes()).collect::<Vec<u8>>()).unwrap();
    }

    #[test]
    fn a_sweep_is_read_with_the_labels_beside_it_or_in_the_folder_of_labels() {
        let folder = tempfile::tempdir().unwrap();
        let path = sweep(folder.path(), 3);
        let bare = io::read(&path).unwrap();
        assert_eq!((bare.len(), bare.xyz(1), bare.scheme), (3, [2.0, 2.5, 3.0], CodeScheme::Own));
        assert!(io::inspect(&path).unwrap().warnings[0].contains("no labels"));
        for place in ["labels/000001.label", "velodyne/000001.label"] {
            label(&folder.path().join(place), &[40, 7 << 16 | 10, 1 << 16 | 252]);
            let cloud = io::read(&path).unwrap();
            let values = |name: &str| cloud.column(name).unwrap().values.clone();
            assert_eq!(values("Classification"), Values::U16(vec![40, 10, 252]), "{place}");
            assert_eq!(values(INSTANCE), Values::U16(vec![0, 7, 1]));
            assert_eq!(values("Intensity"), Values::F32(vec![1.5, 3.5, 5.5]));
            assert_eq!(cloud.scheme, CodeScheme::SemanticKitti);
            let blocks: Vec<usize> =
                io::blocks(&path, 2, &ReadOptions::default()).unwrap().map(|b| b.unwrap().len()).collect();
            assert_eq!(blocks, [2, 1]);
            let written = folder.path().join("out.label");
            io::write(&written, &cloud, &WriteOptions::default()).unwrap();
            assert_eq!(std::fs::read(&written).unwrap(), std::fs::read(folder.path().join(place)).unwrap());
            std::fs::remove_file(folder.path().join(place)).unwrap();
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = sweep(folder.path(), 3);
        let message = || io::read(&path).unwrap_err().to_string();
        label(&path.with_extension("label"), &[1, 2]);
        assert!(message().contains("found 2") && message().contains("3, as there are points"), "{}", message());
        std::fs::write(path.with_extension("label"), [0; 13]).unwrap();
        assert!(message().contains("13 bytes"), "{}", message());
        std::fs::write(&path, [0; 33]).unwrap();
        assert!(message().contains("33 bytes") && message().contains("a multiple of 16"), "{}", message());
        let cloud = Cloud::from_rows(&[[0.0; 3]]).unwrap();
        let refused = io::write(&folder.path().join("a.label"), &cloud, &WriteOptions::default());
        assert!(refused.unwrap_err().to_string().contains("no Classification"));
    }
}
