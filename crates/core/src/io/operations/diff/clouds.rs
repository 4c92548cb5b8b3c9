//! Comparison of two files of any format by their columns.

use super::points::{class_changes, count_classes};
use super::tally::Tally;
use super::{Changed, Difference, grid_tolerance};
use crate::cloud::crs::same_length;
use crate::cloud::{Cloud, Column, Coordinates, Values, names};
use crate::error::Result;
use crate::io::{ReadOptions, read_with};
use crate::parallel::Monitor;
use std::path::Path;

pub(super) fn diff(a: &Path, b: &Path, options: &ReadOptions) -> Result<Difference> {
    let read = |path| read_with(path, options);
    compare(&read(a)?, &read(b)?, &options.monitor)
}

/// Compares two clouds column by column.
pub(in crate::io) fn compare(a: &Cloud, b: &Cloud, monitor: &Monitor) -> Result<Difference> {
    monitor.check()?;
    let points = [a.len() as u64, b.len() as u64];
    let mut found = Difference { points, compared: points[0].min(points[1]), ..Difference::default() };
    if a.crs != b.crs {
        let text = |crs: &Option<String>| crs.clone().unwrap_or_else(|| "absent".into());
        found.header.push(Changed::new("coordinate reference system", text(&a.crs), text(&b.crs)));
    }
    if let (Some(one), Some(two)) = (a.metres_per_unit, b.metres_per_unit)
        && !same_length(one, two)
    {
        found.header.push(Changed::new("metres per unit", one, two));
    }
    found.fields = (0..3).filter_map(|axis| axis_tally(a, b, axis).finish()).collect();
    for column in a.columns() {
        monitor.check()?;
        let Some(other) = b.column(&column.name) else {
            found.only_in[0].push(column.name.clone());
            continue;
        };
        let (one, two) = (column.values.type_name(), other.values.type_name());
        if one != two {
            found.types.push(Changed::new(&column.name, one, two));
        }
        let mut tally = Tally::new(&column.name);
        tally.compare(&column.values, &other.values, 0);
        found.fields.extend(tally.finish());
    }
    let only_b = b.columns().iter().filter(|c| a.column(&c.name).is_none());
    found.only_in[1] = only_b.map(|c| c.name.clone()).collect();
    if found.fields.iter().any(|f| f.name == names::CLASSIFICATION) {
        found.classes = classes(a, b);
    }
    Ok(found)
}

fn axis_tally(a: &Cloud, b: &Cloud, axis: usize) -> Tally {
    let mut tally = Tally::new(["X", "Y", "Z"][axis]);
    let step = |cloud: &Cloud| match cloud.coordinates() {
        Coordinates::Scaled { scale, .. } => scale[axis],
        Coordinates::Float(_) => f64::INFINITY,
    };
    let offset = |cloud: &Cloud| match cloud.coordinates() {
        Coordinates::Scaled { offset, .. } => offset[axis].abs(),
        Coordinates::Float(_) => 0.0,
    };
    let values = |cloud: &Cloud| (0..cloud.len()).map(|i| cloud.xyz(i)[axis]).collect::<Vec<f64>>();
    let [one, two] = [values(a), values(b)];
    let finest = step(a).min(step(b));
    if finest.is_finite() {
        let finite = one.iter().chain(&two).map(|v| v.abs()).filter(|v| v.is_finite());
        tally.tolerance = grid_tolerance(finest, finite.fold(offset(a).max(offset(b)), f64::max));
    }
    tally.compare(&Values::F64(one), &Values::F64(two), 0);
    tally
}

fn classes(a: &Cloud, b: &Cloud) -> Vec<super::ClassChange> {
    let mut counts = vec![0; 1 << 16];
    if let (Some(Column { values: one, .. }), Some(Column { values: two, .. })) =
        (a.column(names::CLASSIFICATION), b.column(names::CLASSIFICATION))
    {
        count_classes(&mut counts, one, two);
    }
    class_changes(&counts)
}
