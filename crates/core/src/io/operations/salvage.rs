//! Damaged files: reads what is intact, counts and reports what is lost.

use super::added::check_kept;
use super::select::{apply, lost_system};
use crate::cloud::Cloud;
use crate::error::Result;
use crate::io::{
    Edit, ReadOptions, RewriteReport, Selection, WriteOptions, check_target, is_las_name, las, read_with, rewrite, run,
    write,
};
use crate::parallel::Monitor;
use std::path::Path;

pub use crate::io::info::Losses;

/// Determines what can be read of a LAS or LAZ file. Reads all points once; other formats are read normally and have no
/// losses.
///
/// # Errors
/// If there is no header, or the file is of another format and malformed.
pub fn examine(path: &Path, monitor: &Monitor) -> Result<Losses> {
    if las::is_las(path)? {
        return Ok(las::Records::salvage(path, monitor)?.1);
    }
    Ok(read(path, &ReadOptions { monitor: monitor.clone(), ..ReadOptions::default() })?.1)
}

/// Like [`read_with`], but reads the intact part of a damaged LAS or LAZ file: points up to the end of the file, chunks
/// that can be decoded (searched one after the other if their table is lost), records that fit.
///
/// # Errors
/// As [`examine`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<(Cloud, Losses)> {
    if las::is_las(path)? {
        let (records, losses) = las::Records::salvage(path, &options.monitor)?;
        return Ok((las::read_records(records, options)?, losses));
    }
    let cloud = read_with(path, options)?;
    let points = cloud.len() as u64;
    Ok((cloud, Losses { declared: points, read: points, notes: Vec::new() }))
}

/// The cloud of [`read`]; no points of a file that declares some are an error.
///
/// # Errors
/// As [`examine`], and [`Losses::check_some`].
pub fn read_some(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let (cloud, losses) = read(path, options)?;
    losses.check_some(path)?;
    Ok(cloud)
}

/// Like [`rewrite`](crate::io::rewrite()), for the intact part of a damaged LAS or LAZ file; the output is an intact file.
/// Edits have one value for each point that [`read`] returns.
///
/// # Errors
/// As [`examine`], [`Losses::check_some`], and those of writing.
pub fn copy(input: &Path, output: &Path, edits: &[Edit], options: &WriteOptions) -> Result<(RewriteReport, Losses)> {
    check_target(output)?;
    run::joined(&options.monitor, || copy_any(input, output, edits, options))
}

fn copy_any(input: &Path, output: &Path, edits: &[Edit], options: &WriteOptions) -> Result<(RewriteReport, Losses)> {
    check_kept(output, edits)?;
    let to_las = is_las_name(output);
    if las::is_las(input)? && to_las {
        let (records, losses) = las::Records::salvage(input, &options.monitor)?;
        losses.check_some(input)?;
        return Ok((las::rewrite_records(records, output, &Selection { kept: None, edits }, options)?, losses));
    }
    if !las::is_las(input)? {
        let report = rewrite(input, output, edits, options)?;
        let losses = Losses { declared: report.points, read: report.points, notes: Vec::new() };
        return Ok((report, losses));
    }
    let (mut cloud, losses) = read(input, &ReadOptions { monitor: options.monitor.clone(), ..ReadOptions::default() })?;
    losses.check_some(input)?;
    apply(&mut cloud, edits)?;
    write(output, &cloud, options)?;
    Ok((RewriteReport { points: cloud.len() as u64, notes: lost_system(&cloud, output) }, losses))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};
    use crate::io;
    use crate::io::las::Records;
    use std::path::PathBuf;

    const POINTS: usize = 120_000;

    fn cloud() -> Cloud {
        let rows: Vec<[f64; 3]> =
            (0..POINTS).map(|i| [(i % 997) as f64 * 0.25, (i / 997) as f64, (i * 7 % 131) as f64 * 0.1]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud
            .set_column(Column::new("Intensity", Values::U16((0..POINTS).map(|i| (i * 31) as u16).collect())))
            .unwrap();
        cloud
    }

    /// A file with that name; `old` ones are LAZ of point format 1, whose chunks do not store their size.
    fn file(folder: &Path, name: &str, old: bool) -> PathBuf {
        let path = folder.join(name);
        if !old {
            io::write(&path, &cloud(), &WriteOptions::default()).unwrap();
            return path;
        }
        let mut builder = ::las::Builder::from((1, 2));
        builder.point_format = ::las::point::Format::new(1).unwrap();
        builder.point_format.is_compressed = name.ends_with("laz");
        let mut writer = ::las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
        let cloud = cloud();
        for i in 0..POINTS {
            let [x, y, z] = cloud.xyz(i);
            let point = ::las::Point { x, y, z, intensity: i as u16, gps_time: Some(i as f64), ..Default::default() };
            writer.write_point(point).unwrap();
        }
        writer.close().unwrap();
        path
    }

    fn salvaged(path: &Path) -> (Cloud, Losses) {
        read(path, &ReadOptions::default()).unwrap()
    }

    fn is_beginning_of(found: &Cloud, whole: &Cloud) {
        let first: Vec<u32> = (0..found.len() as u32).collect();
        assert!(*found == whole.select(&first), "{} points", found.len());
    }

    #[test]
    fn a_sound_file_has_no_losses() {
        let folder = tempfile::tempdir().unwrap();
        for (name, old) in [("a.las", false), ("a.laz", false), ("b.laz", true)] {
            let path = file(folder.path(), name, old);
            let (cloud, losses) = salvaged(&path);
            assert!(cloud == io::read(&path).unwrap());
            assert_eq!(losses, Losses { declared: POINTS as u64, read: POINTS as u64, notes: vec![] });
        }
    }

    #[test]
    fn a_cut_file_gives_the_points_before_the_cut() {
        let folder = tempfile::tempdir().unwrap();
        for (name, old) in [("a.las", false), ("a.laz", false), ("b.las", true), ("b.laz", true)] {
            let path = file(folder.path(), name, old);
            let whole = io::read(&path).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            bytes.truncate(bytes.len() * 7 / 10);
            std::fs::write(&path, bytes).unwrap();
            assert!(io::read(&path).is_err());
            let (cloud, losses) = salvaged(&path);
            is_beginning_of(&cloud, &whole);
            // Layered chunks (a.laz) are lost completely, others from the cut on.
            let least = if name == "a.laz" { 50_000 } else { POINTS * 6 / 10 };
            assert!((least..POINTS * 8 / 10).contains(&cloud.len()), "{name}: {losses:?}");
            assert_eq!((losses.lost(), losses.read), ((POINTS - cloud.len()) as u64, cloud.len() as u64));
            let target = folder.path().join("out.laz");
            let (report, _) = copy(&path, &target, &[], &WriteOptions::default()).unwrap();
            assert_eq!(report.points, losses.read);
            assert!(io::read(&target).unwrap() == cloud, "{name}");
        }
    }

    #[test]
    fn a_lost_chunk_table_loses_no_point() {
        let folder = tempfile::tempdir().unwrap();
        for (name, old) in [("a.laz", false), ("b.laz", true)] {
            let path = file(folder.path(), name, old);
            let whole = io::read(&path).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            let at = Records::open(&path).unwrap().header.points_at as usize;
            bytes[at..at + 8].copy_from_slice(&(-1i64).to_le_bytes());
            std::fs::write(&path, &bytes).unwrap();
            assert!(io::read(&path).is_err());
            let (cloud, losses) = salvaged(&path);
            assert!(cloud == whole, "{name}: {losses:?}");
            assert_eq!((losses.lost(), losses.notes.len()), (0, 1), "{losses:?}");
        }
    }

    #[test]
    fn a_damaged_chunk_is_left_out_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), "a.laz", false);
        let whole = io::read(&path).unwrap();
        let second = Records::open(&path).unwrap().chunks.unwrap().list[1];
        let mut bytes = std::fs::read(&path).unwrap();
        // Overwrites the sizes of the layers, so that the decoder cannot continue.
        bytes[second.at as usize + 34..second.at as usize + 50].fill(255);
        std::fs::write(&path, &bytes).unwrap();
        let message = io::read(&path).unwrap_err().to_string();
        assert!(message.contains("chunk 1"), "{message}");
        let (cloud, losses) = salvaged(&path);
        assert_eq!((losses.lost(), cloud.len()), (50_000, POINTS - 50_000), "{losses:?}");
        let kept: Vec<u32> = (0..50_000).chain(100_000..POINTS as u32).collect();
        assert!(cloud == whole.select(&kept));
    }

    #[test]
    fn points_outside_the_box_of_the_header_are_told() {
        let folder = tempfile::tempdir().unwrap();
        for (name, old) in [("a.las", false), ("a.laz", false), ("b.laz", true)] {
            let path = file(folder.path(), name, old);
            let whole = io::read(&path).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            // The header's largest x.
            bytes[179..187].copy_from_slice(&100.0f64.to_le_bytes());
            std::fs::write(&path, &bytes).unwrap();
            let (cloud, losses) = salvaged(&path);
            assert!(cloud == whole && losses.lost() == 0, "{name}");
            assert!(losses.notes.len() == 1 && losses.notes[0].contains("outside the box"), "{losses:?}");
            assert!(!losses.summary().contains("nothing"), "{}", losses.summary());
            assert_eq!(examine(&path, &Monitor::default()).unwrap(), losses);
        }
    }

    #[test]
    fn a_wrong_count_and_cut_records_are_put_right() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), "a.las", false);
        let whole = io::read(&path).unwrap();
        let sound = std::fs::read(&path).unwrap();
        for (count, read) in [(POINTS as u64 + 1, POINTS), (1 << 40, POINTS), (u64::MAX, POINTS), (0, POINTS)] {
            let mut bytes = sound.clone();
            bytes[247..255].copy_from_slice(&count.to_le_bytes());
            std::fs::write(&path, &bytes).unwrap();
            let (cloud, losses) = salvaged(&path);
            assert_eq!(cloud.len(), read, "{losses:?}");
            assert!(cloud == whole && losses.notes.len() == 1, "{losses:?}");
        }
        let mut bytes = sound.clone();
        bytes[100..104].copy_from_slice(&9u32.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let (cloud, losses) = salvaged(&path);
        assert!(cloud == whole && losses.notes[0].contains("0 of 9 VLRs"), "{losses:?}");
    }
}
