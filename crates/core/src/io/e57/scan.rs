//! The points of one scan.

use super::columns::{self, ScanColumns};
use super::guard::{Reader, bad};
use super::pose::Pose;
use crate::error::{Mismatch, Result};
use crate::io::table::{Table, pad};
use crate::parallel::{Monitor, watched};
use ::e57::{PointCloud, Record, RecordDataType, RecordName, RecordValue};
use std::path::{Path, PathBuf};

/// A field of the points: its position in a record, and the conversion to a number.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: usize,
    scale: f64,
    offset: f64,
}

/// A field that is stored in a column, and the field with its validity flag.
#[derive(Clone, Copy, Debug)]
struct Value {
    place: Place,
    column: usize,
    invalid: Option<usize>,
    first: i64,
}

/// How the points of a scan are decoded.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    path: PathBuf,
    number: u32,
    axes: [Place; 3],
    spherical: bool,
    /// Field with the validity flag of the coordinates.
    state: Option<usize>,
    values: Vec<Value>,
    pose: Option<Pose>,
}

impl Scan {
    /// # Errors
    /// If there are no coordinates, or the pose is invalid.
    pub(super) fn new(path: &Path, number: u32, scan: &PointCloud, columns: &ScanColumns) -> Result<Self> {
        let find = |name: &RecordName| scan.prototype.iter().position(|r| r.name == *name);
        let places = |names: [RecordName; 3]| {
            let found = names.map(|name| find(&name).map(|at| place(&scan.prototype[at], at)));
            match found {
                [Some(a), Some(b), Some(c)] => Some([a, b, c]),
                _ => None,
            }
        };
        use RecordName::{CartesianX, CartesianY, CartesianZ, SphericalAzimuth, SphericalElevation, SphericalRange};
        let cartesian = places([CartesianX, CartesianY, CartesianZ]);
        let spherical = cartesian.is_none();
        let axes = cartesian.or_else(|| places([SphericalRange, SphericalAzimuth, SphericalElevation]));
        let axes = axes.ok_or_else(|| {
            let found = scan.prototype.iter().map(|r| format!("{:?}", r.name)).collect::<Vec<_>>().join(" ");
            bad(path, "coordinates", "prototype".into(), Mismatch::new(found, "Cartesian or spherical coordinates"))
        })?;
        let state = match spherical {
            true => find(&RecordName::SphericalInvalidState),
            false => find(&RecordName::CartesianInvalidState),
        };
        let mut values: Vec<Value> = Vec::new();
        for (at, record) in scan.prototype.iter().enumerate() {
            let Some(column) = columns::name(&record.name).and_then(|name| columns.position(&name)) else { continue };
            // A field that occurs twice is read once.
            if values.iter().all(|v| v.column != column) {
                let invalid = marks(&record.name).and_then(|mark| find(&mark));
                values.push(Value { place: place(record, at), column, invalid, first: columns::first(&record.name) });
            }
        }
        let pose = Pose::new(path, scan.transform.as_ref())?;
        Ok(Self { path: path.to_path_buf(), number, axes, spherical, state, values, pose })
    }

    /// Appends the valid points.
    pub(super) fn read(&self, e57: &mut Reader, scan: &PointCloud, table: &mut Table, monitor: &Monitor) -> Result<()> {
        let wrong = |i: u64, e: &::e57::Error| {
            bad(
                &self.path,
                "points",
                format!("scan {}, point {i}", self.number),
                Mismatch::new(e, "what an E57 writer writes"),
            )
        };
        let constant: Option<Vec<RecordValue>> = scan.prototype.iter().map(constant).collect();
        if let Some(record) = constant {
            // The decoder would return such points endlessly.
            for points in watched(scan.records as usize, monitor) {
                points?.for_each(|_| self.point(&record, table));
            }
            return self.fill(table);
        }
        for (i, record) in (0..).zip(e57.pointcloud_raw(scan).map_err(|e| wrong(0, &e))?) {
            self.point(&record.map_err(|e| wrong(i, &e))?, table);
            if i % 8192 == 8191 {
                monitor.check()?;
                monitor.advance(8192);
            }
        }
        self.fill(table)
    }

    fn point(&self, record: &[RecordValue], table: &mut Table) {
        if self.state.is_some_and(|at| integer(record, at) != 0) {
            return;
        }
        let [a, b, c] = self.axes.map(|place| place.value(record));
        let point = match self.spherical {
            true => [a * c.cos() * b.cos(), a * c.cos() * b.sin(), a * c.sin()],
            false => [a, b, c],
        };
        let point = self.pose.map_or(point, |pose| pose.apply(point));
        table.axes.iter_mut().zip(point).for_each(|(axis, v)| axis.push(v));
        for value in &self.values {
            let valid = value.invalid.is_none_or(|at| integer(record, at) == 0);
            let whole = if valid { integer(record, value.place.at).saturating_add(value.first) } else { 0 };
            let float = if valid { value.place.value(record) + value.first as f64 } else { 0.0 };
            if let Some(column) = table.columns.get_mut(value.column) {
                columns::push(&mut column.values, whole, float);
            }
        }
    }

    /// Appends zeros to the columns that this scan lacks.
    fn fill(&self, table: &mut Table) -> Result<()> {
        let n = table.len();
        for column in &mut table.columns {
            let missing = n - column.values.len();
            pad(&mut column.values, missing);
        }
        Ok(())
    }
}

impl Place {
    fn value(self, record: &[RecordValue]) -> f64 {
        match record.get(self.at) {
            Some(RecordValue::Single(v)) => f64::from(*v),
            Some(RecordValue::Double(v)) => *v,
            Some(RecordValue::ScaledInteger(v) | RecordValue::Integer(v)) => *v as f64 * self.scale + self.offset,
            None => 0.0,
        }
    }
}

fn place(record: &Record, at: usize) -> Place {
    match record.data_type {
        RecordDataType::ScaledInteger { scale, offset, .. } => Place { at, scale, offset },
        _ => Place { at, scale: 1.0, offset: 0.0 },
    }
}

/// The field with the validity flag of another field.
fn marks(name: &RecordName) -> Option<RecordName> {
    match name {
        RecordName::Intensity => Some(RecordName::IsIntensityInvalid),
        RecordName::ColorRed | RecordName::ColorGreen | RecordName::ColorBlue => Some(RecordName::IsColorInvalid),
        RecordName::TimeStamp => Some(RecordName::IsTimeStampInvalid),
        _ => None,
    }
}

/// A value as an integer; 0 for floating-point values.
fn integer(record: &[RecordValue], at: usize) -> i64 {
    match record.get(at) {
        Some(RecordValue::Integer(v) | RecordValue::ScaledInteger(v)) => *v,
        _ => 0,
    }
}

/// The constant value of a field that takes no bits.
fn constant(record: &Record) -> Option<RecordValue> {
    match record.data_type {
        RecordDataType::Integer { min, max } if min == max => Some(RecordValue::Integer(min)),
        RecordDataType::ScaledInteger { min, max, .. } if min == max => Some(RecordValue::ScaledInteger(min)),
        _ => None,
    }
}
