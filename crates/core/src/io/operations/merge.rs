//! Merges several files into one.

use super::select::{lost_system, moved_by_scale};
use crate::cloud::crs::{more_told, same_length};
use crate::cloud::{Cloud, CodeScheme, Column, Coordinates, Values};
use crate::error::{Error, Result};
use crate::io::atomic::check_place;
use crate::io::info::{NamedCrs, check_crs};
use crate::io::{ReadOptions, RewriteReport, WriteOptions, check_target, is_las_name, las, read_with, run, write};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Writes the points of all inputs, in the given order, into one file, atomically. The output may be one of the inputs.
///
/// LAS and LAZ are streamed: point source ids and all other fields are kept, coordinates are converted exactly to a
/// common grid, and the point format has all fields of the inputs. The header, and records that differ only in content,
/// are those of the first input. Other formats are read and written. A dimension that some inputs lack is 0 there,
/// which a note reports. A file that is an input more than once is warned of. Time linear in the points.
///
/// # Errors
/// If there are no inputs, reference systems or kinds of GPS time differ, no common grid represents all coordinates
/// exactly, or dimensions with the same name have different types.
pub fn merge(inputs: &[PathBuf], output: &Path, options: &WriteOptions) -> Result<RewriteReport> {
    if inputs.is_empty() {
        return Err(Error::input("nothing to merge: no input"));
    }
    check_target(output)?;
    run::joined(&options.monitor, || merge_any(inputs, output, options))
}

fn merge_any(inputs: &[PathBuf], output: &Path, options: &WriteOptions) -> Result<RewriteReport> {
    let mut all_las = is_las_name(output);
    for input in inputs {
        all_las &= las::is_las(input)?;
    }
    if all_las {
        options.keeps_steps()?;
        run::warn_of_twice(inputs, &options.monitor);
        return las::merge(inputs, output, options);
    }
    check_place(output)?;
    let (cloud, mut notes) = read_together(inputs, &options.reading())?;
    write(output, &cloud, options)?;
    notes.extend(lost_system(&cloud, output));
    notes.extend(moved_by_scale(&cloud, output, options)?);
    Ok(RewriteReport { points: cloud.len() as u64, notes })
}

/// Reads several files as one cloud, in the given order, and tells what some of them lack. A single one is read as it is.
/// A file that is an input more than once is warned of. Time linear in the points.
///
/// # Errors
/// As [`read_with`], and if there are no inputs, or their reference systems or units differ.
pub fn read_together(inputs: &[PathBuf], options: &ReadOptions) -> Result<(Cloud, Vec<String>)> {
    run::warn_of_twice(inputs, &options.monitor);
    let mut parts = Vec::with_capacity(inputs.len());
    for (number, input) in inputs.iter().enumerate() {
        options.monitor.file(number + 1, inputs.len());
        parts.push(read_with(input, options)?);
    }
    match parts.len() {
        0 => Err(Error::input("nothing to merge")),
        1 => Ok((parts.remove(0), Vec::new())),
        _ => joined(parts, inputs),
    }
}

/// The points of all parts; a column is 0 where a part lacks it.
fn joined(mut parts: Vec<Cloud>, paths: &[PathBuf]) -> Result<(Cloud, Vec<String>)> {
    let mut notes = Vec::new();
    let place = common_place(&parts, paths, &mut notes)?;
    let axes = [0, 1, 2].map(|a| parts.iter().flat_map(|part| (0..part.len()).map(move |i| part.xyz(i)[a])).collect());
    let mut whole = Cloud::new(Coordinates::Float(axes))?;
    (whole.crs, whole.metres_per_unit) = (place.crs, place.metres_per_unit);
    let scheme = parts[0].scheme;
    whole.scheme = if parts.iter().all(|part| part.scheme == scheme) { scheme } else { CodeScheme::Own };
    // Names of earlier parts replace those of later ones.
    whole.class_names = parts.iter().rev().flat_map(|part| part.class_names.clone()).collect();
    let mut seen = HashSet::new();
    let all = parts.iter().flat_map(Cloud::columns).map(|column| column.name.clone());
    let names: Vec<String> = all.filter(|name| seen.insert(name.clone())).collect();
    for name in names {
        if let Some(at) = parts.iter().position(|part| part.column(&name).is_none()) {
            notes.push(format!("{name} is not in all inputs (see {}); 0 where it lacks", paths[at].display()));
        }
        let own: Vec<(usize, Option<Values>)> =
            parts.iter_mut().map(|part| (part.len(), part.take_column(&name).map(|column| column.values))).collect();
        whole.set_column(Column::new(&name, concatenated(&own)))?;
    }
    Ok((whole, notes))
}

/// The reference system and unit that all parts have.
#[derive(Default)]
struct CommonPlace {
    crs: Option<String>,
    metres_per_unit: Option<f64>,
}

/// The place of all parts; a note tells of a part that does not say its own.
fn common_place(parts: &[Cloud], paths: &[PathBuf], notes: &mut Vec<String>) -> Result<CommonPlace> {
    let mut common = CommonPlace::default();
    for (number, (part, path)) in parts.iter().zip(paths).enumerate() {
        if number > 0 {
            let first = NamedCrs::new(Path::new("the first input"), common.crs.as_deref());
            check_crs(first, NamedCrs::new(path, part.crs.as_deref()), notes)?;
        }
        if let (Some(a), Some(b)) = (common.metres_per_unit, part.metres_per_unit)
            && !same_length(a, b)
        {
            return Err(Error::input(format!(
                "{} has units of {b} m, an input before it of {a} m: write it in their unit, or give all the same --unit",
                path.display()
            )));
        }
        common.crs = match (common.crs, &part.crs) {
            (Some(known), Some(own)) => Some(more_told(known, own)),
            (known, own) => known.or_else(|| own.clone()),
        };
        common.metres_per_unit = common.metres_per_unit.or(part.metres_per_unit);
    }
    Ok(common)
}

macro_rules! typed {
    ($($variant:ident),*) => {
        /// Concatenates a column of parts of so many points, 0 where a part has none; numbers of different types become `f64`.
        fn concatenated(parts: &[(usize, Option<Values>)]) -> Values {
            let kind = |values: &Values| std::mem::discriminant(values);
            let mut known = parts.iter().filter_map(|(_, values)| values.as_ref());
            let first = known.next();
            match first {
                $(Some(first @ Values::$variant(_)) if known.all(|values| kind(values) == kind(first)) => {
                    let mut all = Vec::new();
                    for (count, values) in parts {
                        match values {
                            Some(Values::$variant(values)) => all.extend_from_slice(values),
                            _ => all.resize(all.len() + count, Default::default()),
                        }
                    }
                    Values::$variant(all)
                })*
                _ => Values::F64(
                    parts
                        .iter()
                        .flat_map(|(count, values)| {
                            values.as_ref().map_or_else(|| vec![0.0; *count], Values::to_f64)
                        })
                        .collect(),
                ),
            }
        }
    };
}
typed!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::names;
    use crate::io::{inspect, read};

    /// A cloud on a grid: point i lies at `origin + i * 0.5`.
    fn file(path: &Path, (scale, offset, origin): (f64, f64, f64), extra: Option<&str>) {
        let ticks: Vec<i32> =
            (0..200).map(|i| ((origin + f64::from(i) * 0.5 - offset) / scale).round() as i32).collect();
        let coordinates = Coordinates::Scaled {
            ticks: [ticks.clone(), ticks.clone(), ticks],
            scale: [scale; 3],
            offset: [offset; 3],
        };
        let mut cloud = Cloud::new(coordinates).unwrap();
        cloud.set_column(Column::new("PointSourceId", Values::U16(vec![origin as u16; 200]))).unwrap();
        cloud.set_column(Column::new(names::RETURN_NUMBER, Values::U8(vec![1; 200]))).unwrap();
        if let Some(name) = extra {
            cloud.set_column(Column::new(name, Values::F32(vec![1.5; 200]))).unwrap();
        }
        write(path, &cloud, &WriteOptions::default()).unwrap();
    }

    #[test]
    fn grids_are_reconciled_exactly_and_fields_stay() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.laz", "b.las", "c.laz"].map(|n| folder.path().join(n));
        file(&paths[0], (0.01, 100.0, 100.0), None);
        file(&paths[1], (0.001, 7.5, 300.0), Some("Height"));
        file(&paths[2], (0.01, 100.0, 500.0), Some("Height"));
        let target = folder.path().join("all.laz");
        let report = merge(&paths, &target, &WriteOptions::default()).unwrap();
        assert_eq!(report.points, 600);
        assert!(report.notes.iter().any(|n| n.contains("Height")), "{:?}", report.notes);
        let cloud = read(&target).unwrap();
        for (i, origin) in [100.0, 300.0, 500.0].into_iter().enumerate() {
            for p in [0, 77, 199] {
                let found = cloud.xyz(i * 200 + p)[1];
                assert!((found - (origin + p as f64 * 0.5)).abs() < 1e-9, "{found}");
                assert_eq!(cloud.column("PointSourceId").unwrap().values.get(i * 200 + p), origin);
            }
        }
        assert_eq!(cloud.column("Height").unwrap().values.get(0), 0.0);
        assert_eq!(cloud.column("Height").unwrap().values.get(599), 1.5);
        let [low, high] = inspect(&target).unwrap().bounds.unwrap();
        assert_eq!((low[0], high[0]), (100.0, 599.5));
    }

    #[test]
    fn grids_that_do_not_meet_and_other_reference_systems_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.las", "b.las"].map(|n| folder.path().join(n));
        file(&paths[0], (0.01, 100.0, 100.0), None);
        file(&paths[1], (0.01, 100.003, 300.003), None);
        let target = folder.path().join("all.las");
        let message = merge(&paths, &target, &WriteOptions::default()).unwrap_err().to_string();
        assert!(message.contains("grid"), "{message}");
        for (path, crs) in [(&paths[0], "PROJCS[\"a\"]"), (&paths[1], "PROJCS[\"b\"]")] {
            let mut cloud = read(path).unwrap();
            cloud.crs = Some(crs.into());
            write(path, &cloud, &WriteOptions::default()).unwrap();
        }
        let message = merge(&paths, &target, &WriteOptions::default()).unwrap_err().to_string();
        assert!(message.contains("reference system"), "{message}");
        assert!(!target.exists());
    }

    #[cfg(unix)]
    #[test]
    fn an_input_that_stands_twice_is_warned_of() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.las", "b.las", "soft.las", "./a.las"].map(|n| folder.path().join(n));
        file(&paths[0], (0.01, 100.0, 100.0), None);
        file(&paths[1], (0.01, 100.0, 300.0), None);
        std::os::unix::fs::symlink(&paths[0], &paths[2]).unwrap();
        let twice = |chosen: &[usize], target: &str| {
            let inputs: Vec<PathBuf> = chosen.iter().map(|&i| paths[i].clone()).collect();
            let options = WriteOptions::default();
            merge(&inputs, &folder.path().join(target), &options).unwrap();
            options.monitor.take_warnings().iter().filter(|text| text.contains("input more than once")).count()
        };
        for target in ["all.las", "all.ply"] {
            assert_eq!(
                [&[0, 1][..], &[0, 0], &[1, 0, 2], &[0, 1, 3]].map(|chosen| twice(chosen, target)),
                [0, 1, 1, 1]
            );
        }
        let options = ReadOptions::default();
        read_together(&[paths[1].clone(), paths[1].clone()], &options).unwrap();
        assert!(options.monitor.take_warnings()[0].contains("b.las"));
    }

    #[test]
    fn feet_are_not_joined_with_metres() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.npz", "b.npz", "c.npz"].map(|n| folder.path().join(n));
        for (path, metres) in paths.iter().zip([None, Some(0.3048), Some(1.0)]) {
            let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3]]).unwrap();
            cloud.metres_per_unit = metres;
            write(path, &cloud, &WriteOptions::default()).unwrap();
        }
        let joined = |range: std::ops::Range<usize>| read_together(&paths[range], &ReadOptions::default());
        assert_eq!(joined(0..2).unwrap().0.metres_per_unit, Some(0.3048));
        assert!(joined(0..3).unwrap_err().to_string().contains("0.3048"));
    }

    #[test]
    fn other_formats_are_joined_by_their_columns() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.ply", "b.laz"].map(|n| folder.path().join(n));
        file(&paths[0], (0.01, 100.0, 100.0), Some("Height"));
        file(&paths[1], (0.01, 100.0, 300.0), None);
        let target = folder.path().join("all.ply");
        merge(&paths, &target, &WriteOptions::default()).unwrap();
        let cloud = read(&target).unwrap();
        assert_eq!((cloud.len(), cloud.xyz(399)), (400, [399.5; 3]));
        assert_eq!(cloud.column("PointSourceId").unwrap().values.get(200), 300.0);
    }

    #[test]
    fn counts_and_offsets_that_overflow_are_no_panic() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.las", "b.las"].map(|n| folder.path().join(n));
        let target = folder.path().join("all.las");
        file(&paths[0], (0.01, 0.0, 100.0), None);
        let sound = std::fs::read(&paths[0]).unwrap();
        let with = |at: usize, value: [u8; 8]| {
            let mut bytes = sound.clone();
            bytes[at..at + 8].copy_from_slice(&value);
            std::fs::write(&paths[1], bytes).unwrap();
        };
        // Points of the second return.
        with(263, u64::MAX.to_le_bytes());
        let twice = [paths[1].clone(), paths[1].clone()];
        assert_eq!(merge(&twice, &target, &WriteOptions::default()).unwrap().points, 400);
        for offset in [1e15, 9.223_372e16, 1e17, -1e17, 1e300] {
            with(155, f64::to_le_bytes(offset));
            assert!(merge(&paths, &target, &WriteOptions::default()).is_err(), "{offset}");
        }
    }
}
