//! Statistics that need all points of a file: anomalies, and the number of points of each class.

use crate::cloud::crs::{Unit, unit_of};
use crate::cloud::{Cloud, Column, Coordinates, StrayParams, Strays, Values, names};
use crate::error::Result;
use crate::io::{Bounds, FileInfo, ReadOptions, inspect_with, read_with};
use crate::parallel::{Monitor, map_ordered, sort_watched, watched};
use serde::Serialize;
use std::path::Path;

/// Number of points counted at a time.
const PIECE: usize = 1 << 16;

/// Counts over all points of a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Points with a coordinate that is not finite.
    pub not_finite: u64,
    /// Points at exactly the position of an earlier one.
    pub duplicates: u64,
    /// Points more than one tick outside the bounds in the header.
    pub outside_bounds: u64,
    /// Columns with NaN or infinite values, and their number.
    pub nan_values: Vec<(String, u64)>,
    /// Number of points of each class code, ascending; empty without classes.
    pub classes: Vec<(u8, u64)>,
    /// Warnings, one sentence each, except those of [`inspect`](crate::io::inspect()).
    pub warnings: Vec<String>,
}

/// Reads and counts all points of a file; also returns the cloud. Time O(n log n) (duplicates are found by sorting);
/// memory: the cloud and 24 bytes a point.
///
/// # Errors
/// Those of [`read_with`](crate::io::read_with()).
pub fn statistics(path: &Path, options: &ReadOptions) -> Result<(Statistics, Cloud)> {
    crate::io::run::joined(&options.monitor, || {
        let info = inspect_with(path, &options.text_columns)?;
        let cloud = read_with(path, options)?;
        Ok((of_cloud(&cloud, &info, &options.monitor)?, cloud))
    })
}

/// The statistics of a cloud that was read from the file described by `info`.
///
/// # Errors
/// If the work was cancelled.
pub fn of_cloud(cloud: &Cloud, info: &FileInfo, monitor: &Monitor) -> Result<Statistics> {
    let finite = |i: usize| cloud.xyz(i).iter().all(|v| v.is_finite());
    let mut statistics = Statistics {
        not_finite: count(cloud.len(), |i| !finite(i), monitor)?,
        duplicates: duplicates(cloud, monitor)?,
        outside_bounds: outside(cloud, info, monitor)?,
        nan_values: nan_values(cloud, monitor)?,
        classes: classes(cloud, monitor)?,
        warnings: Vec::new(),
    };
    statistics.warnings = warnings(&statistics, cloud, info, monitor)?;
    Ok(statistics)
}

/// Number of indices below `len` for which `is_so` is true.
fn count(len: usize, is_so: impl Fn(usize) -> bool + Sync, monitor: &Monitor) -> Result<u64> {
    let parts = map_ordered(len.div_ceil(PIECE), monitor, |piece| {
        let items = piece * PIECE..((piece + 1) * PIECE).min(len);
        Ok(items.filter(|&i| is_so(i)).count() as u64)
    })?;
    Ok(parts.into_iter().sum())
}

fn duplicates(cloud: &Cloud, monitor: &Monitor) -> Result<u64> {
    match cloud.coordinates() {
        Coordinates::Scaled { ticks: [x, y, z], .. } => repeated(x.len(), |i| Some([x[i], y[i], z[i]]), monitor),
        // Adding zero unifies the two zeros; NaN counts as nowhere.
        Coordinates::Float(axes) => {
            let place = |i: usize| [0, 1, 2].map(|a| axes[a][i] + 0.0);
            let finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
            repeated(axes[0].len(), |i| Some(place(i)).filter(finite).map(|p| p.map(f64::to_bits)), monitor)
        }
    }
}

/// Number of points at the position of an earlier one; points whose `place` is `None` are not counted.
fn repeated<T: Ord + Send + Sync>(
    len: usize,
    place: impl Fn(usize) -> Option<[T; 3]>,
    monitor: &Monitor,
) -> Result<u64> {
    let mut places: Vec<[T; 3]> = Vec::with_capacity(len);
    for piece in watched(len, monitor) {
        places.extend(piece?.filter_map(&place));
    }
    sort_watched(&mut places, monitor)?;
    count(places.len().saturating_sub(1), |i| places[i] == places[i + 1], monitor)
}

fn outside(cloud: &Cloud, info: &FileInfo, monitor: &Monitor) -> Result<u64> {
    let Some([low, high]) = info.bounds else { return Ok(0) };
    let slack = info.scale.unwrap_or([0.0; 3]);
    let out = |i: usize| {
        let p = cloud.xyz(i);
        (0..3).any(|a| p[a] < low[a] - slack[a] || p[a] > high[a] + slack[a])
    };
    count(cloud.len(), out, monitor)
}

fn nan_values(cloud: &Cloud, monitor: &Monitor) -> Result<Vec<(String, u64)>> {
    let mut counted = Vec::new();
    for column in cloud.columns() {
        let found = match &column.values {
            Values::F32(v) => count(v.len(), |i| !v[i].is_finite(), monitor)?,
            Values::F64(v) => count(v.len(), |i| !v[i].is_finite(), monitor)?,
            _ => 0,
        };
        counted.extend((found > 0).then(|| (column.name.clone(), found)));
    }
    Ok(counted)
}

fn classes(cloud: &Cloud, monitor: &Monitor) -> Result<Vec<(u8, u64)>> {
    let mut counts = [0u64; 256];
    if let Some(column) = cloud.column(names::CLASSIFICATION) {
        for piece in watched(cloud.len(), monitor) {
            let codes = piece?.map(|i| column.values.get(i)).filter(|code| (0.0..=255.0).contains(code));
            codes.for_each(|code| counts[usize::from(code as u8)] += 1);
        }
    }
    Ok((0..=255u8).map(|c| (c, counts[usize::from(c)])).filter(|(_, n)| *n > 0).collect())
}

fn warnings(statistics: &Statistics, cloud: &Cloud, info: &FileInfo, monitor: &Monitor) -> Result<Vec<String>> {
    let mut warnings = Vec::new();
    let mut say = |count: u64, what: &str| {
        if count > 0 {
            warnings.push(format!("{count} {what}"));
        }
    };
    if let Some(Column { values, .. }) = cloud.column(names::CLASSIFICATION) {
        let large = count(cloud.len(), |i| values.get(i) > 255.0, monitor)?;
        say(large, "points have classes above 255, which are not counted; train, evaluate and others map them (--map)");
        let negative = count(cloud.len(), |i| values.get(i) < 0.0, monitor)?;
        say(negative, "points have negative classes, which mean that there is no label");
    }
    say(statistics.not_finite, "points have coordinates that are not finite; they are left unclassified");
    say(statistics.duplicates, "points lie exactly where another one lies");
    say(statistics.outside_bounds, "points lie outside the bounds in the header");
    statistics.nan_values.iter().for_each(|(name, n)| say(*n, &format!("values of {name} are NaN or infinite")));
    let strays = Strays::find(cloud, &StrayParams::default(), monitor)?;
    warnings.extend(strays.warning(cloud).map(|text| format!("{text}; recipes set such points aside")));
    warnings.extend(strays.bounds.and_then(|bounds| unit_warning(info, bounds)));
    Ok(warnings)
}

/// A warning if the coordinates do not look like their unit.
fn unit_warning(info: &FileInfo, [low, high]: Bounds) -> Option<String> {
    let size = [0, 1, 2].map(|a| high[a] - low[a]);
    let plan = size[0].max(size[1]);
    let degrees = low[0] >= -180.0 && high[0] <= 180.0 && low[1] >= -90.0 && high[1] <= 90.0;
    let fine = info.scale.is_some_and(|s| s[0] < 1e-5 && s[1] < 1e-5);
    let geographic = matches!(info.crs.as_deref().and_then(unit_of), Some(Unit::Angle(_)));
    if degrees && (geographic || fine || plan > 0.0 && plan < 1.0 && size[2] > 20.0 * plan) {
        return Some("x and y look like degrees; features need metres: project the cloud first".into());
    }
    let known = info.metres_per_unit.is_some();
    if !known && plan > 0.0 && size[2] > 3.0 * plan {
        return Some(format!(
            "the cloud is {:.1} high and {plan:.1} wide: are all axes in one unit? (--unit)",
            size[2]
        ));
    }
    if !known && plan > 100_000.0 {
        return Some(format!("the cloud is {plan:.0} units wide and has no unit; millimetres? (--unit 0.001)"));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{self, WriteOptions};

    #[test]
    fn oddities_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let nan = f64::NAN;
        let rows =
            [[0.0, 0.0, 1.0], [-0.0, 0.0, 1.0], [5.0, 1.0, 0.5], [nan, 0.0, 0.0], [5.0, 1.0, 0.5], [5.0, 1.0, 0.5]];
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(vec![2, 2, 6, 6, 6, 6]))).unwrap();
        cloud
            .set_column(Column::new("Height", Values::F32(vec![1.0, f32::NAN, 0.0, f32::INFINITY, 0.0, 0.0])))
            .unwrap();
        io::write(&path, &cloud, &WriteOptions::default()).unwrap();
        let (found, _) = statistics(&path, &ReadOptions::default()).unwrap();
        assert_eq!((found.not_finite, found.duplicates), (1, 3));
        assert_eq!(found.classes, [(2, 2), (6, 4)]);
        assert_eq!(found.nan_values, [("scalar_Height".to_string(), 2)].map(|(n, c)| (n.replace("scalar_", ""), c)));
        assert_eq!(found.warnings.len(), 3, "{:?}", found.warnings);
    }

    #[test]
    fn points_outside_the_header_and_degrees_are_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.las");
        let rows: Vec<[f64; 3]> = (0..100).map(|i| [8.5 + f64::from(i) * 1e-5, 47.0, f64::from(i)]).collect();
        io::write(&path, &Cloud::from_rows(&rows).unwrap(), &WriteOptions::default()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[211..219].copy_from_slice(&90.0f64.to_le_bytes());
        std::fs::write(&path, bytes).unwrap();
        let (found, _) = statistics(&path, &ReadOptions::default()).unwrap();
        assert_eq!(found.outside_bounds, 9);
        assert!(found.warnings.iter().any(|w| w.contains("degrees")), "{:?}", found.warnings);
    }
}
