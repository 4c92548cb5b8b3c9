//! Filters a file.

use super::{FilterParams, Filtered, Step, filter};
use crate::cloud::{Cloud, Column, Values, each_values, names};
use crate::error::Result;
use crate::io::{self, Columns, Edit, ReadOptions, Selection, WriteOptions};
use serde::Serialize;
use std::path::Path;

/// Class of noise in ASPRS codes (low point), as which PDAL marks outliers too.
const NOISE: u8 = 7;

/// What [`filter_file`] did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterReport {
    /// Points of the input.
    pub points: u64,
    /// What each filter removed or marked, in the order in which they were applied.
    pub steps: Vec<Step>,
    /// Points written.
    pub kept: u64,
    /// How the ground was found, and changes besides the filters, for the user.
    pub notes: Vec<String>,
}

/// Writes the points of a file that all filters keep, atomically. `output` may be `input`.
///
/// From LAS and LAZ to LAS and LAZ the records of these points are copied byte for byte, but for the class of those that
/// are marked; header (with counts and bounds of the points that are left), variable length records and all else are
/// kept. Between other formats the cloud is read and written. If no point is left, the output has none, which is warned
/// about.
///
/// # Errors
/// If a file cannot be read or written, and as [`filter`].
pub fn filter_file(input: &Path, output: &Path, params: &FilterParams, options: &WriteOptions) -> Result<FilterReport> {
    io::check_cloud_output(output)?;
    io::check_holds(output, "the points that are left")?;
    params.validate()?;
    let monitor = &options.monitor;
    let wanted = [names::CLASSIFICATION, names::WITHHELD, names::HEIGHT_ABOVE_GROUND].map(String::from).to_vec();
    let metres_per_unit = params.metres_per_unit;
    let read = ReadOptions { columns: Columns::Only(wanted), metres_per_unit, ..options.reading() };
    let cloud = io::read_with(input, &read)?;
    io::check_scale(input, output, &cloud, options)?;
    let Filtered { kept, noise, steps, mut notes } = filter(&cloud, params, monitor)?;
    let edits: Vec<Edit> = params.mark.then(|| marked(&cloud, &noise)).into_iter().collect();
    drop(cloud);
    // Without a removed point the header stays as it is.
    let part = Some(kept.as_slice()).filter(|kept| kept.contains(&false));
    let report = io::select(input, output, &Selection { kept: part, edits: &edits }, options)?;
    if report.points == 0 && !kept.is_empty() {
        monitor.warn(format!("{}: no point is left", output.display()));
    }
    notes.extend(report.notes);
    Ok(FilterReport { points: kept.len() as u64, steps, kept: report.points, notes })
}

/// The classes of a cloud, in their own type, with those of noise changed.
fn marked(cloud: &Cloud, noise: &[bool]) -> Edit {
    let none = || Values::U8(vec![0; cloud.len()]);
    let mut values = cloud.column(names::CLASSIFICATION).map_or_else(none, |column| column.values.clone());
    each_values!(&mut values, v => {
        v.iter_mut().zip(noise).filter(|(_, noise)| **noise).for_each(|(v, _)| *v = NOISE as _);
    });
    match values {
        Values::U8(codes) => Edit::Classification(codes),
        values => Edit::Dimension(Column::new(names::CLASSIFICATION, values)),
    }
}
