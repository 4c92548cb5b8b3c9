//! Columns of clouds from other formats as LAS fields: which fit, which are scaled, which are stored as extra
//! dimensions.
//!
//! - Values within the range of a field are stored there.
//! - Fractional intensities and colours between 0 and 1 are scaled to 0 to 65535.
//! - All other values are stored unchanged in an extra dimension `NAME_raw`, and the field is 0: negative intensities
//!   of text and PTS, other fractions, values above 65535, and NaN.
//! - Class codes, return numbers and user data that do not fit are an error, because a wrong code could not be
//!   repaired.

use super::Field;
use crate::cloud::{Column, Values};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered, watched};
use std::borrow::Cow;

/// Largest value of fields of 16 bits.
const FULL: f64 = 65_535.0;

/// Number of values looked at by one thread at a time.
const PIECE: usize = 1 << 16;

/// The destination of each column.
#[derive(Debug, Default)]
pub(in crate::io::las) struct Fit<'a> {
    /// Field, column and the factor of its values.
    pub(in crate::io::las) fields: Vec<(Field, &'a Column, f64)>,
    pub(in crate::io::las) extras: Vec<Cow<'a, Column>>,
}

impl<'a> Fit<'a> {
    /// Chooses the destination of each column.
    ///
    /// # Errors
    /// If a code does not fit its field, or the work was cancelled.
    pub(in crate::io::las) fn new(columns: &'a [Column], format: u8, monitor: &Monitor) -> Result<Self> {
        let mut fit = Self::default();
        for column in columns {
            let Some(field) = Field::named(&column.name, format) else {
                fit.extras.push(Cow::Borrowed(column));
                continue;
            };
            match first_misfit(field, &column.values, monitor)? {
                None => fit.fields.push((field, column, 1.0)),
                Some(_) if is_share(field, &column.values, monitor)? => fit.fields.push((field, column, FULL)),
                Some(i) if is_code(field) => {
                    let (value, most) = (column.values.get(i), most(field));
                    return Err(Error::input(format!("{} of point {i} is {value}; LAS holds 0..={most}", column.name)));
                }
                Some(_) => fit.extras.push(Cow::Owned(raw(column))),
            }
        }
        Ok(fit)
    }
}

/// Fields in which a wrong value could not be repaired later.
fn is_code(field: Field) -> bool {
    matches!(field, Field::Classification | Field::UserData | Field::ReturnNumber | Field::NumberOfReturns)
}

fn wide(field: Field) -> bool {
    matches!(field, Field::Intensity | Field::Red | Field::Green | Field::Blue | Field::Infrared | Field::PointSourceId)
}

/// Largest value of an integer field.
fn most(field: Field) -> f64 {
    match field {
        Field::Classification | Field::UserData => 255.0,
        Field::ReturnNumber | Field::NumberOfReturns => 15.0,
        Field::ScanChannel => 3.0,
        _ if wide(field) => FULL,
        _ => 1.0,
    }
}

/// The first value that the field cannot hold.
fn first_misfit(field: Field, values: &Values, monitor: &Monitor) -> Result<Option<usize>> {
    let fits = |v: f64| match field {
        Field::GpsTime => true,
        // Steps of 0.006 degrees in 16 bits.
        Field::ScanAngle => v.abs() <= 196.6,
        _ => (0.0..=most(field)).contains(&v) && v.fract() == 0.0,
    };
    // These types always fit.
    match values {
        Values::U16(_) | Values::U8(_) if wide(field) => Ok(None),
        Values::U8(_) if most(field) >= 255.0 => Ok(None),
        values => {
            let piece = |at: usize| at * PIECE..((at + 1) * PIECE).min(values.len());
            let first = |at| Ok(piece(at).find(|&i| !fits(values.get(i))));
            let misfits = map_ordered(values.len().div_ceil(PIECE), monitor, first)?;
            Ok(misfits.into_iter().flatten().next())
        }
    }
}

/// Whether the values are fractions: floating-point numbers from 0 to 1.
fn is_share(field: Field, values: &Values, monitor: &Monitor) -> Result<bool> {
    let float = matches!(values, Values::F32(_) | Values::F64(_));
    let share = |i| (0.0..=1.0).contains(&values.get(i));
    if !(float && wide(field) && field != Field::PointSourceId) {
        return Ok(false);
    }
    for piece in watched(values.len(), monitor) {
        if !piece?.all(share) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The column under another name; `f64` becomes `f32` if that is exact.
#[expect(clippy::float_cmp, reason = "whether nothing is lost is an exact question")]
fn raw(column: &Column) -> Column {
    let values = match &column.values {
        Values::F64(v) if v.iter().all(|&x| x.is_nan() || f64::from(x as f32) == x) => {
            Values::F32(v.iter().map(|&x| x as f32).collect())
        }
        values => values.clone(),
    };
    Column::new(format!("{}_raw", column.name), values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::io;

    fn written(name: &str, values: Values) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.las");
        let mut cloud = Cloud::from_rows(&vec![[1.0, 2.0, 3.0]; values.len()]).unwrap();
        cloud.set_column(Column::new(name, values)).unwrap();
        io::write(&path, &cloud, &Default::default())?;
        io::read(&path)
    }

    fn column(cloud: &Cloud, name: &str) -> Vec<f64> {
        cloud.column(name).unwrap().values.to_f64()
    }

    #[test]
    fn whole_numbers_in_range_go_to_their_field() {
        let cloud = written("Intensity", Values::F64(vec![0.0, 1.0, 65_535.0])).unwrap();
        assert_eq!(column(&cloud, "Intensity"), [0.0, 1.0, 65_535.0]);
        assert!(cloud.column("Intensity_raw").is_none());
        let cloud = written("ScanAngle", Values::F32(vec![-90.0, 12.0])).unwrap();
        assert!((column(&cloud, "ScanAngle")[0] + 90.0).abs() < 0.004);
    }

    #[test]
    fn shares_of_one_fill_the_sixteen_bits() {
        for name in ["Intensity", "Green", "Infrared"] {
            let cloud = written(name, Values::F32(vec![0.0, 0.5, 1.0])).unwrap();
            assert_eq!(column(&cloud, name), [0.0, 32_768.0, 65_535.0]);
        }
    }

    #[test]
    fn values_that_do_not_fit_are_kept_beside_the_field() {
        let cases = [
            Values::I16(vec![-900, 7]),
            Values::F64(vec![-2047.0, 12.5]),
            Values::U32(vec![65_536, 0]),
            Values::F64(vec![1e300, 0.1]),
            Values::F32(vec![2.5, 0.25]),
        ];
        for values in cases {
            let cloud = written("Intensity", values.clone()).unwrap();
            assert_eq!(column(&cloud, "Intensity"), [0.0, 0.0], "{values:?}");
            assert_eq!(column(&cloud, "Intensity_raw"), values.to_f64());
        }
        let cloud = written("Withheld", Values::U8(vec![0, 2])).unwrap();
        assert_eq!(column(&cloud, "Withheld_raw"), [0.0, 2.0]);
        let cloud = written("Intensity", Values::F32(vec![f32::NAN, 0.5])).unwrap();
        assert!(column(&cloud, "Intensity_raw")[0].is_nan());
        let cloud = written("ScanAngle", Values::F64(vec![200.0])).unwrap();
        assert_eq!(column(&cloud, "ScanAngle_raw"), [200.0]);
    }

    #[test]
    fn codes_that_do_not_fit_are_errors() {
        for (name, values) in [
            ("Classification", Values::U16(vec![2, 256])),
            ("Classification", Values::F64(vec![2.5])),
            ("Classification", Values::F32(vec![f32::NAN])),
            ("ReturnNumber", Values::U8(vec![16])),
        ] {
            let message = written(name, values).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains("LAS holds"), "{message}");
        }
    }
}
