//! npz, the archive of numpy arrays: `xyz` (n, 3) or `x`, `y`, `z` (n), and an array of length n for each column.
//!
//! Arrays (n, k) become k columns `name_0`, ...; `rgb` and `colors` (n, 3) become Red, Green, Blue. The text `crs` and
//! the number `metres_per_unit` belong to the cloud. Arrays of other lengths are skipped, which `inspect` reports.

mod npy;
mod read;
mod zip;

use super::table::number;
use crate::cloud::{Cloud, Values};
use crate::error::Result;
use crate::io::reader::Whole;
use crate::io::{WriteOptions, verify};
use std::path::Path;

pub(super) use read::{inspect, read};

/// Number of rows assembled at once.
const SLAB: usize = 65_536;

/// Writes `xyz` as double (n, 3) and each column in its own type, as `numpy.savez` does (compressed: `savez_compressed`).
pub(super) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let mut archive = zip::Writer::create(path, options.compressed)?;
    let n = cloud.len();
    options.monitor.stage("write", n as u64);
    let mut slabs = slabs(npy::header("<f8", &[n, 3]), n, options, |i, bytes| {
        cloud.xyz(i).iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    });
    archive.add("xyz.npy", &mut slabs)?;
    for column in cloud.columns() {
        let order = if matches!(column.values, Values::U8(_) | Values::I8(_)) { '|' } else { '<' };
        let head = npy::header(&format!("{order}{}", column.values.type_name()), &[n]);
        let name = column.name.replace(['/', '\\'], "_");
        archive.add(&format!("{name}.npy"), slabs_of(&column.values, head, options))?;
    }
    if let Some(crs) = &cloud.crs {
        let text: Vec<u8> = crs.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
        let head = npy::header(&format!("<U{}", text.len() / 4), &[]);
        archive.add("crs.npy", once([head, text].concat()))?;
    }
    if let Some(metres) = cloud.metres_per_unit {
        archive.add("metres_per_unit.npy", once([npy::header("<f8", &[]), metres.to_le_bytes().to_vec()].concat()))?;
    }
    verify::finish(archive.close()?, cloud, options, |path, options| Ok(Whole::new(read(path, options)?)))
}

fn once(bytes: Vec<u8>) -> impl FnMut() -> Result<Option<Vec<u8>>> {
    let mut bytes = Some(bytes);
    move || Ok(bytes.take())
}

fn slabs_of<'a>(
    values: &'a Values,
    head: Vec<u8>,
    options: &'a WriteOptions,
) -> impl FnMut() -> Result<Option<Vec<u8>>> + 'a {
    slabs(head, values.len(), options, |i, bytes| number::put(values, i, bytes))
}

/// The header, then the rows slab by slab.
fn slabs<'a>(
    head: Vec<u8>,
    n: usize,
    options: &'a WriteOptions,
    row: impl Fn(usize, &mut Vec<u8>) + 'a,
) -> impl FnMut() -> Result<Option<Vec<u8>>> + 'a {
    let (mut head, mut first) = (Some(head), 0);
    move || {
        options.monitor.check()?;
        let mut bytes = head.take().unwrap_or_default();
        let end = (first + SLAB).min(n);
        (first..end).for_each(|i| row(i, &mut bytes));
        first = end;
        Ok((!bytes.is_empty()).then_some(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Column;
    use crate::io;

    fn cloud() -> Cloud {
        let mut cloud = Cloud::from_rows(&[[652_000.123, 6e6, f64::NAN], [1.0, -0.0, 3.0]]).unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(vec![2, 6]))).unwrap();
        cloud.set_column(Column::new("Wide", Values::U64(vec![u64::MAX, 0]))).unwrap();
        cloud.set_column(Column::new("Confidence", Values::F32(vec![0.5, -1.0]))).unwrap();
        cloud.crs = Some("EPSG:2154 é".into());
        cloud.metres_per_unit = Some(0.3048);
        cloud
    }

    #[test]
    fn bytes_that_become_numbers_of_eight_are_counted_as_such() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let mut archive = zip::Writer::create(&path, true).unwrap();
        let (mut head, mut left) = (Some(npy::header("|u1", &[20_000_000, 3])), 61);
        let zeros = || {
            left -= 1;
            Ok(head.take().or((left >= 0).then(|| vec![0; 1_000_000])))
        };
        archive.add("xyz.npy", zeros).unwrap();
        archive.close().unwrap().finish().unwrap();
        assert!(path.metadata().unwrap().len() < 100_000);
        assert_eq!(io::inspect(&path).unwrap().points, 20_000_000);
        let message = io::read(&path).unwrap_err().to_string();
        assert!(message.contains("unpacked size") && message.contains("found 480000000 bytes in memory"), "{message}");
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        for compressed in [false, true] {
            io::write(&path, &cloud(), &WriteOptions { compressed, ..Default::default() }).unwrap();
            let back = io::read(&path).unwrap();
            assert_eq!(back.columns(), cloud().columns());
            assert_eq!((&back.crs, back.metres_per_unit), (&cloud().crs, Some(0.3048)));
            assert!((0..2).all(|i| back.xyz(i).map(f64::to_bits) == cloud().xyz(i).map(f64::to_bits)));
            let info = io::inspect(&path).unwrap();
            assert_eq!(
                (info.points, &info.dimensions[..]),
                (2, &["Classification", "Wide", "Confidence"].map(String::from)[..])
            );
        }
    }

    #[test]
    fn cut_and_changed_archives_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        for compressed in [false, true] {
            io::write(&path, &cloud(), &WriteOptions { compressed, ..Default::default() }).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            for length in (4..bytes.len()).step_by(13) {
                std::fs::write(&path, &bytes[..length]).unwrap();
                assert!(io::read(&path).is_err(), "cut at {length}");
            }
            for at in (30..bytes.len()).step_by(7) {
                let mut mutant = bytes.clone();
                mutant[at] ^= 0x41;
                std::fs::write(&path, &mutant).unwrap();
                // A damaged byte may be in the unused part of a header; whatever is read must be complete.
                if let Ok(back) = io::read(&path) {
                    assert_eq!(back.len(), 2, "byte {at}");
                }
            }
        }
    }

    #[test]
    fn arrays_that_are_no_cloud_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let write = |arrays: &[(&str, &str, &[usize], usize)]| {
            let mut archive = zip::Writer::create(&path, false).unwrap();
            for (name, descr, shape, bytes) in arrays {
                archive.add(name, once([npy::header(descr, shape), vec![0; *bytes]].concat())).unwrap();
            }
            archive.close().unwrap().finish().unwrap();
            io::read(&path).map_err(|e| e.to_string())
        };
        assert!(write(&[("chair.npy", "<f4", &[2, 2], 16)]).unwrap_err().contains("chair"));
        assert!(write(&[("xyz.npy", "<f4", &[2, 3], 20)]).unwrap_err().contains("20"));
        assert!(write(&[("xyz.npy", "<f8", &[1 << 40, 1 << 40, 3], 24)]).is_err());
        assert!(write(&[("x.npy", "<f8", &[2], 16), ("y.npy", "<f8", &[2], 16), ("z.npy", "<f8", &[1], 8)]).is_err());
        let cloud =
            write(&[("xyz.npy", "<i2", &[2, 3], 12), ("note.npy", "|O", &[9], 3), ("rgb.npy", "|u1", &[2, 3], 6)]);
        assert_eq!(cloud.unwrap().columns().iter().map(|c| &c.name[..]).collect::<Vec<_>>(), ["Red", "Green", "Blue"]);
        assert!(io::inspect(&path).unwrap().warnings[0].contains("note"));
    }
}
