//! Checks of single parameters.

use crate::error::{Error, Result};

pub(in crate::contours) fn above_zero(name: &'static str, value: f64) -> Result<()> {
    match value.is_finite() && value > 0.0 {
        true => Ok(()),
        false => Err(Error::parameter(name, value, "a finite number above 0")),
    }
}

pub(in crate::contours) fn zero_or_more(name: &'static str, value: f64) -> Result<()> {
    match value.is_finite() && value >= 0.0 {
        true => Ok(()),
        false => Err(Error::parameter(name, value, "a finite number, 0 or more")),
    }
}

pub(in crate::contours) fn between(name: &'static str, value: f64, most: f64) -> Result<()> {
    match (0.0..=most).contains(&value) {
        true => Ok(()),
        false => Err(Error::parameter(name, value, format!("0 to {most}"))),
    }
}

pub(in crate::contours) fn at_least_one(name: &'static str, value: usize) -> Result<()> {
    match value {
        0 => Err(Error::parameter(name, 0, "1 or more")),
        _ => Ok(()),
    }
}
