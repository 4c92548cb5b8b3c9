//! Conversion between formats: keeps everything that the target format can store and reports the rest.

use super::added::lost_in_labels;
use super::diff::compare;
use crate::cloud::{Cloud, crs};
use crate::error::{Error, Result};
use crate::io::atomic::check_place;
use crate::io::table::number::Kind;
use crate::io::{
    Bounds, ReadOptions, RewriteReport, WriteOptions, check_target, inspect, is_las_name, las, read_with, run, write,
};
use crate::memory;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Parameters of [`convert`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConvertParams {
    /// Point format of a LAS or LAZ output made from LAS or LAZ, 0..=10; `None`: that of the input. It must have all
    /// fields of the input's format. From 6 on the output is LAS 1.4.
    pub point_format: Option<u8>,
    /// Only points in this box, in the unit of the file; `None`: all.
    pub bounds: Option<Bounds>,
    /// Thin to points about this far apart, in the unit of the file, above 0; `None`: all. For COPC inputs only.
    pub resolution: Option<f64>,
}

impl ConvertParams {
    /// Fails if the point format does not exist, the box is not ordered, or the resolution is not above 0.
    pub fn validate(&self) -> Result<()> {
        self.part(&WriteOptions::default()).validate()?;
        match (self.point_format, self.bounds.is_some() || self.resolution.is_some()) {
            (Some(format), _) if format > 10 => Err(Error::parameter("point_format", format, "0 to 10")),
            (Some(format), true) => {
                Err(Error::parameter("point_format", format, "none together with bounds or resolution; convert twice"))
            }
            _ => Ok(()),
        }
    }

    /// The options for reading the input.
    fn part(&self, options: &WriteOptions) -> ReadOptions {
        let (bounds, resolution) = (self.bounds, self.resolution);
        ReadOptions { bounds, resolution, ..options.reading() }
    }
}

/// Copies a file into the format of the output's extension, atomically. `output` may be `input`.
///
/// Between LAS and LAZ the records are streamed and every byte is kept. Otherwise the cloud is read, written, read back
/// and compared, and the notes of the report say what the target could not store. Time linear in the points.
///
/// # Errors
/// If the input cannot be read, the output cannot be written, or the point format lacks fields of the input.
pub fn convert(input: &Path, output: &Path, params: &ConvertParams, options: &WriteOptions) -> Result<RewriteReport> {
    params.validate()?;
    check_target(output)?;
    run::joined(&options.monitor, || convert_any(input, output, params, options))
}

fn convert_any(input: &Path, output: &Path, params: &ConvertParams, options: &WriteOptions) -> Result<RewriteReport> {
    let to_las = is_las_name(output);
    let from_las = las::is_las(input)?;
    let part = params.part(options);
    if from_las && to_las {
        options.keeps_steps()?;
        if part.bounds.is_some() || part.resolution.is_some() {
            return las::crop(input, output, &part, options);
        }
        return las::convert(input, output, params.point_format, options);
    }
    if params.point_format.is_some() {
        let reason = "a point format can be chosen from LAS or LAZ to LAS or LAZ only".to_string();
        return Err(Error::Unsupported { path: input.to_path_buf(), reason });
    }
    check_place(output)?;
    let cloud = read_with(input, &part)?;
    let records = if from_las { lost_records(input)? } else { Vec::new() };
    write(output, &cloud, options)?;
    options.monitor.stage("check", cloud.len() as u64);
    if let Some(note) = lost_in_labels(output) {
        return Ok(RewriteReport { points: cloud.len() as u64, notes: vec![note] });
    }
    let again = || read_with(output, &ReadOptions { monitor: options.monitor.clone(), ..ReadOptions::default() });
    let room = memory::spare(2 * bytes(&cloud), "the cloud that was written");
    let mut notes = match room.and_then(|()| again()).and_then(|back| losses(&cloud, &back, options)) {
        // The output is complete; only the comparison needs the cloud in memory twice.
        Err(e @ Error::Memory { .. }) => vec![format!("not compared with the input: {e}")],
        found => found?,
    };
    if !records.is_empty() {
        notes.push(format!("not kept: {}", records.join(", ")));
    }
    Ok(RewriteReport { points: cloud.len() as u64, notes })
}

/// Memory of a cloud, with coordinates as floating-point numbers.
fn bytes(cloud: &Cloud) -> u64 {
    let width = cloud.columns().iter().fold(24, |sum, column| sum + Kind::of(&column.values).size());
    cloud.len() as u64 * width as u64
}

/// Variable length records of a LAS file with information beyond columns and reference system.
fn lost_records(input: &Path) -> Result<Vec<String>> {
    let carried = ["laszip encoded", "LASF_Projection", "LASF_Spec 4", "copc"];
    let records = inspect(input)?.vlrs.into_iter();
    Ok(records
        .filter(|name| !carried.iter().any(|c| name.starts_with(c)))
        .map(|name| format!("record {name}"))
        .collect())
}

/// That a field is rounded.
pub(super) fn rounded(name: &str, points: u64, largest: f64) -> String {
    format!("{name}: rounded in {points} points, by {largest:.3e} at most")
}

/// Differences between the cloud and what was written.
fn losses(cloud: &Cloud, back: &Cloud, options: &WriteOptions) -> Result<Vec<String>> {
    let found = compare(cloud, back, &options.monitor)?;
    let mut notes = Vec::new();
    if found.points[0] != found.points[1] {
        notes.push(format!("{} points became {}", found.points[0], found.points[1]));
    }
    let same = |(a, b): (&String, &String)| crs::same(a, b);
    if cloud.crs.is_some() && !cloud.crs.as_ref().zip(back.crs.as_ref()).is_some_and(same) {
        notes.push("not kept: the coordinate reference system".into());
    }
    if let (Some(metres), None) = (cloud.metres_per_unit, back.metres_per_unit) {
        notes.push(format!("not kept: the unit of {metres} m"));
    }
    if !found.only_in[0].is_empty() {
        notes.push(format!("not kept: {}", found.only_in[0].join(" ")));
    }
    for field in &found.fields {
        let (name, points) = (&field.name, field.differing - field.one_sided);
        if points > 0 {
            notes.push(match field.largest.is_nan() {
                true => format!("{name}: changed in {points} points"),
                false => rounded(name, points, field.largest),
            });
        }
        if field.one_sided > 0 {
            notes.push(format!("{name}: a number became none, or none a number, in {} points", field.one_sided));
        }
    }
    Ok(notes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Column, Values};
    use crate::io::{self, diff};
    use std::path::PathBuf;

    fn file(folder: &Path, name: &str) -> PathBuf {
        let rows: Vec<[f64; 3]> = (0..500).map(|i| [f64::from(i) * 0.5, f64::from(i % 7), 1.25]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud
            .set_column(Column::new("GpsTime", Values::F64((0..500).map(|i| 1e9 + f64::from(i) * 1e-6).collect())))
            .unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(vec![6; 500]))).unwrap();
        cloud.set_column(Column::new("Id", Values::U64((0..500).map(|i| (1 << 60) + i).collect()))).unwrap();
        cloud.crs = Some("PROJCS[\"a\",UNIT[\"metre\",1]]".into());
        let path = folder.join(name);
        io::write(&path, &cloud, &WriteOptions::default()).unwrap();
        path
    }

    #[test]
    fn what_the_target_cannot_hold_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let source = file(folder.path(), "a.laz");
        let (las, ply) = (folder.path().join("b.las"), folder.path().join("b.ply"));
        let (params, options) = (ConvertParams::default(), WriteOptions::default());
        assert!(convert(&source, &las, &params, &options).unwrap().notes.is_empty());
        assert!(diff(&source, &las, &ReadOptions::default()).unwrap().is_empty());
        let notes = convert(&source, &ply, &params, &options).unwrap().notes.join("; ");
        assert!(notes.contains("Id: rounded in") && notes.contains("reference system"), "{notes}");
        assert!(!notes.contains("Classification") && !notes.contains("GpsTime"), "{notes}");
    }

    #[test]
    fn every_kind_of_loss_has_its_words() {
        let cloud = |times: [f64; 3]| {
            let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3], [2.0; 3]]).unwrap();
            cloud.set_column(Column::new("GpsTime", Values::F64(times.to_vec()))).unwrap();
            cloud
        };
        let notes = |a: &Cloud, b: &Cloud| losses(a, b, &WriteOptions::default()).unwrap();
        let (whole, nan) = (cloud([1.0, 2.0, 3.0]), f64::NAN);
        assert!(notes(&whole, &whole).is_empty() && notes(&cloud([1.0, nan, 3.0]), &cloud([1.0, nan, 3.0])).is_empty());
        assert_eq!(notes(&whole, &cloud([1.5, 2.0, 3.0])), ["GpsTime: rounded in 1 points, by 5.000e-1 at most"]);
        let none = |n| format!("GpsTime: a number became none, or none a number, in {n} points");
        assert_eq!(notes(&whole, &cloud([nan, 2.0, 3.0])), [none(1)]);
        assert_eq!(notes(&cloud([nan, 2.0, 3.0]), &cloud([1.0, nan, 3.0])), [none(2)]);
        let both = notes(&whole, &cloud([1.25, nan, nan]));
        assert_eq!(both, ["GpsTime: rounded in 1 points, by 2.500e-1 at most".into(), none(2)]);
        let mut placed = whole.clone();
        (placed.crs, placed.metres_per_unit) = (Some("EPSG:26910+6360".into()), Some(1.0));
        let lost = ["not kept: the coordinate reference system", "not kept: the unit of 1 m"];
        assert_eq!(notes(&placed, &whole), lost);
        // The same system in another form, then with other heights.
        let as_text = |code: &str| {
            let mut cloud = placed.clone();
            cloud.crs = crs::wkt(code);
            cloud
        };
        assert!(notes(&placed, &as_text("EPSG:26910+6360")).is_empty());
        assert_eq!(notes(&placed, &as_text("EPSG:26910+5703")), lost[..1]);
        let mut fewer = whole.select(&[0, 1]);
        fewer.take_column("GpsTime").unwrap();
        assert_eq!(notes(&whole, &fewer)[..2], ["3 points became 2", "not kept: GpsTime"]);
    }

    #[test]
    fn another_point_format_holds_every_field_or_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let source = file(folder.path(), "a.las");
        let target = folder.path().join("b.laz");
        let to = |format| ConvertParams { point_format: Some(format), ..Default::default() };
        convert(&source, &target, &to(8), &WriteOptions::default()).unwrap();
        assert_eq!(inspect(&target).unwrap().point_format, Some(8));
        let found = diff(&source, &target, &ReadOptions::default()).unwrap();
        assert!(found.fields.is_empty(), "{found:?}");
        assert_eq!(found.only_in, [vec![], ["Red", "Green", "Blue", "Infrared"].map(String::from).to_vec()]);
        let message = convert(&target, &source, &to(1), &WriteOptions::default()).unwrap_err().to_string();
        assert!(message.contains("Infrared"), "{message}");
        assert!(convert(&source, &target, &to(11), &WriteOptions::default()).is_err());
    }

    #[test]
    fn a_box_keeps_its_records_and_recounts_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let bounds = Some([[10.0, 0.0, 0.0], [49.75, 4.0, 9.0]]);
        let params = ConvertParams { bounds, ..Default::default() };
        for (from, to) in [("a.las", "b.laz"), ("a.laz", "b.las"), ("a.laz", "b.ply"), ("a.ply", "b.laz")] {
            let (source, target) = (file(folder.path(), from), folder.path().join(to));
            let report = convert(&source, &target, &params, &WriteOptions::default()).unwrap();
            let part = io::read_with(&source, &ReadOptions { bounds, ..Default::default() }).unwrap();
            // 80 points have x in the box, and 5 of 7 of these y as well.
            assert_eq!((report.points, part.len()), (57, 57), "{from} {to}");
            let (back, info) = (io::read(&target).unwrap(), inspect(&target).unwrap());
            assert_eq!((back.len(), info.points, back.bounds()), (57, 57, part.bounds()));
            if to.contains(".la") {
                assert_eq!(info.bounds, part.bounds());
                let times = |c: &Cloud| c.column("GpsTime").unwrap().values.to_f64();
                assert_eq!(times(&back), times(&part));
            }
        }
        let nothing = ConvertParams { bounds: Some([[-9.0; 3], [-8.0; 3]]), ..Default::default() };
        let target = folder.path().join("none.laz");
        assert_eq!(
            convert(&folder.path().join("a.laz"), &target, &nothing, &WriteOptions::default()).unwrap().points,
            0
        );
        assert!(io::read(&target).unwrap().is_empty());
        for wrong in [
            ConvertParams { bounds: Some([[1.0; 3], [0.0; 3]]), ..Default::default() },
            ConvertParams { resolution: Some(0.0), ..Default::default() },
            ConvertParams { resolution: Some(1.0), ..Default::default() },
            ConvertParams { point_format: Some(6), ..params.clone() },
        ] {
            assert!(convert(&folder.path().join("a.laz"), &target, &wrong, &WriteOptions::default()).is_err());
        }
    }
}
