//! Copies of a file with some of its points, or with changes to them.

use super::added::{check_free, check_kept, lost_in_labels};
use super::convert::rounded;
use crate::cloud::{Cloud, Column, OwnClass, Values, names};
use crate::error::Result;
use crate::io::table::edits::check_distinct;
use crate::io::{
    Edit, RewriteReport, Selection, WriteOptions, atomic, check_target, extension, is_las_name, las, read_with, run,
    write,
};
use std::path::{Path, PathBuf};

/// Copies a file with the edits applied; everything else in a LAS or LAZ file is kept, byte for byte.
///
/// Between other formats the cloud is read and written. `output` may be `input`.
///
/// # Errors
/// If the input cannot be read, lengths of the edits do not fit, or the output cannot be written.
pub fn rewrite(input: &Path, output: &Path, edits: &[Edit], options: &WriteOptions) -> Result<RewriteReport> {
    select(input, output, &Selection { kept: None, edits }, options)
}

/// Copies some points of a file, with the edits applied, as [`rewrite`]; counts and bounds in a LAS header become those
/// of the points that are written.
///
/// # Errors
/// As [`rewrite`], and if there is not one mark for each point of the file.
pub fn select(input: &Path, output: &Path, selection: &Selection<'_>, options: &WriteOptions) -> Result<RewriteReport> {
    check_target(output)?;
    run::joined(&options.monitor, || select_any(input, output, selection, options))
}

fn select_any(input: &Path, output: &Path, selection: &Selection<'_>, options: &WriteOptions) -> Result<RewriteReport> {
    check_kept(output, selection.edits)?;
    let to_las = is_las_name(output);
    if to_las && las::is_las(input)? {
        options.keeps_steps()?;
        return las::select(input, output, selection, options);
    }
    let mut cloud = read_with(input, &options.reading())?;
    apply(&mut cloud, selection.edits)?;
    selection.check(cloud.len() as u64)?;
    if let Some(kept) = selection.kept {
        cloud = cloud.select(&(0..cloud.len() as u32).filter(|&i| kept[i as usize]).collect::<Vec<_>>());
    }
    write(output, &cloud, options)?;
    for edit in selection.edits {
        if let Edit::Provenance(text) = edit {
            // Of an output that is replaced or new; what is left there of an earlier one is replaced too.
            let rules = run::Rules { monitor: options.monitor.clone(), ..run::Rules::default() };
            run::run(rules, || atomic::write_bytes(&beside(output), text.as_bytes()))?;
        }
    }
    let notes = [lost_system(&cloud, output), moved_by_scale(&cloud, output, options)?].concat();
    Ok(RewriteReport { points: cloud.len() as u64, notes })
}

/// That a scale that was asked for moves points of a cloud, which is written as LAS.
pub(super) fn moved_by_scale(cloud: &Cloud, output: &Path, options: &WriteOptions) -> Result<Vec<String>> {
    if !is_las_name(output) {
        return Ok(Vec::new());
    }
    let axes = ["X", "Y", "Z"].into_iter().zip(las::moved_by_scale(cloud, options)?);
    let moved = axes.filter(|(_, moved)| moved.points > 0);
    Ok(moved.map(|(name, moved)| rounded(name, moved.points, moved.largest)).collect())
}

/// That the output has no room for the reference system or the unit of a cloud, or for all but the classes.
pub(super) fn lost_system(cloud: &Cloud, output: &Path) -> Vec<String> {
    if is_las_name(output) || extension(output) == "npz" {
        return Vec::new();
    }
    if let Some(note) = lost_in_labels(output) {
        return vec![note];
    }
    match (&cloud.crs, cloud.metres_per_unit) {
        (Some(_), _) => vec!["not kept: the coordinate reference system".into()],
        (None, Some(metres)) => vec![format!("not kept: the unit of {metres} m")],
        (None, None) => Vec::new(),
    }
}

/// The file beside a cloud that tells how its classes were made, for formats without a record for that: `NAME.EXT.json`.
pub(in crate::io) fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".json");
    path.with_file_name(name)
}

/// Applies the edits to a cloud.
pub(super) fn apply(cloud: &mut Cloud, edits: &[Edit]) -> Result<()> {
    check_distinct(edits)?;
    check_free(edits)?;
    for edit in edits {
        if let Edit::Colour(colours) = edit {
            for (channel, name) in names::COLOUR.into_iter().enumerate() {
                let values = Values::U8(colours.iter().map(|colour| colour[channel]).collect());
                cloud.set_column(Column::new(name, values))?;
            }
            continue;
        }
        if let Edit::OtherClassNames(names) = edit {
            for (code, name) in names {
                cloud.class_names.insert(*code, OwnClass { name: name.clone(), colour: None });
            }
            continue;
        }
        if let Edit::ClassNames(names) = edit {
            for (code, name) in names {
                let own = || OwnClass { name: name.clone(), colour: None };
                cloud.class_names.entry(*code).or_insert_with(own);
            }
            continue;
        }
        cloud.set_column(match edit {
            Edit::Classification(codes) => Column::new(names::CLASSIFICATION, Values::U8(codes.clone())),
            Edit::Dimension(column) => column.clone(),
            Edit::ClassNames(_) | Edit::OtherClassNames(_) | Edit::Colour(_) | Edit::Provenance(_) => continue,
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::ReadOptions;
    use crate::io::{diff, inspect, read};

    fn cloud() -> Cloud {
        let rows: Vec<[f64; 3]> =
            (0..70_000).map(|i| [f64::from(i % 300), f64::from(i / 300), f64::from(i % 7)]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud
            .set_column(Column::new(names::RETURN_NUMBER, Values::U8((0..70_000).map(|i| (i % 3) as u8 + 1).collect())))
            .unwrap();
        cloud.set_column(Column::new("Own", Values::F64((0..70_000).map(f64::from).collect()))).unwrap();
        cloud
    }

    #[test]
    fn a_scale_that_moves_points_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b, c] = ["a.csv", "b.csv", "c.las"].map(|name| folder.path().join(name));
        for (path, shift) in [(&a, 0.0), (&b, 0.25)] {
            let rows: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i) + shift, f64::from(i), 5e6]).collect();
            write(path, &Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
        }
        let options = WriteOptions { scale: Some([1.0; 3]), ..WriteOptions::default() };
        let told = ["X: rounded in 9 points, by 2.500e-1 at most"];
        assert_eq!(rewrite(&b, &c, &[], &options).unwrap().notes, told);
        assert_eq!(crate::io::merge(&[a.clone(), b.clone()], &c, &options).unwrap().notes, told);
        assert!(rewrite(&a, &c, &[], &options).unwrap().notes.is_empty(), "its coordinates are whole");
        assert!(rewrite(&b, &c, &[], &WriteOptions::default()).unwrap().notes.is_empty());
    }

    #[test]
    fn the_points_that_are_kept_are_as_they_were_and_the_header_counts_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (from, to) in [("a.laz", "b.las"), ("a.las", "b.laz"), ("a.ply", "b.ply"), ("a.las", "b.npz")] {
            write(&path(from), &cloud(), &WriteOptions::default()).unwrap();
            let whole = read(&path(from)).unwrap();
            let kept: Vec<bool> = (0..70_000).map(|i| i % 5 == 3 && i < 60_000).collect();
            let indices: Vec<u32> = (0..70_000).filter(|&i| kept[i as usize]).collect();
            let edits = [Edit::Classification((0..70_000).map(|i| (i % 31) as u8).collect())];
            let selection = Selection { kept: Some(&kept), edits: &edits };
            let report = select(&path(from), &path(to), &selection, &WriteOptions::default()).unwrap();
            assert_eq!(report.points, 12_000);
            let mut expected = whole.select(&indices);
            let codes = indices.iter().map(|i| (i % 31) as u8).collect();
            expected.set_column(Column::new(names::CLASSIFICATION, Values::U8(codes))).unwrap();
            write(&path("c.las"), &expected, &WriteOptions::default()).unwrap();
            assert_eq!(diff(&path("c.las"), &path(to), &ReadOptions::default()).unwrap().fields, [], "{from} {to}");
            let (expected, found) = (inspect(&path("c.las")).unwrap(), inspect(&path(to)).unwrap());
            assert_eq!((found.points, found.bounds.is_none()), (12_000, to.ends_with("ply") || to.ends_with("npz")));
            if to.contains(".la") {
                assert_eq!((found.bounds, found.scale), (expected.bounds, expected.scale));
            }
            let message = select(
                &path(from),
                &path(to),
                &Selection { kept: Some(&kept[1..]), edits: &[] },
                &WriteOptions::default(),
            );
            assert!(message.unwrap_err().to_string().contains("69999 marks"));
        }
    }

    #[test]
    fn classes_that_need_another_point_format_are_counted_in_its_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let mut builder = ::las::Builder::from((1, 2));
        builder.point_format = ::las::point::Format::new(1).unwrap();
        let mut writer = ::las::Writer::from_path(path("a.las"), builder.into_header().unwrap()).unwrap();
        for i in 0..100 {
            let (x, return_number) = (f64::from(i), 1 + (i % 2) as u8);
            writer.write_point(::las::Point { x, return_number, gps_time: Some(x), ..Default::default() }).unwrap();
        }
        writer.close().unwrap();
        let kept: Vec<bool> = (0..100).map(|i| i < 40).collect();
        let edits = [Edit::Classification(vec![64; 100])];
        let selection = Selection { kept: Some(&kept), edits: &edits };
        let report = select(&path("a.las"), &path("b.las"), &selection, &WriteOptions::default()).unwrap();
        assert!(report.points == 40 && report.notes[0].contains("64"), "{report:?}");
        let found = ::las::Reader::from_path(path("b.las")).unwrap();
        let header = found.header();
        assert_eq!((header.number_of_points(), header.number_of_points_by_return(1)), (40, Some(20)));
        assert_eq!((header.bounds().max.x, header.version().minor), (39.0, 4));
    }
}
