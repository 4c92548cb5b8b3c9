//! Writing text.

use crate::cloud::{Cloud, Coordinates, Values, names};
use crate::error::{Error, Result};
use crate::io::atomic::AtomicFile;
use crate::io::format::Format;
use crate::io::{WriteOptions, verify};
use std::io::Write;
use std::path::Path;

/// Lines between two looks at the monitor.
const STEP: usize = 4096;

/// Writes a header row and a line a point; `.labels` gets the class codes alone.
pub(in crate::io) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let labels = path.extension().is_some_and(|e| e == "labels");
    let mut file = AtomicFile::create(path)?;
    let comma = path.extension().is_some_and(|e| e == "csv");
    let separator = if comma { "," } else { " " };
    let classes = match labels {
        true => Some(
            cloud.column(names::CLASSIFICATION).ok_or_else(|| Error::input("no Classification to write as .labels"))?,
        ),
        false => None,
    };
    let mut text = Vec::new();
    if classes.is_none() {
        let names = ["x", "y", "z"].map(String::from).into_iter().chain(cloud.columns().iter().map(|c| word(&c.name)));
        text = (names.collect::<Vec<_>>().join(separator) + "\n").into_bytes();
    }
    options.monitor.stage("write", cloud.len() as u64);
    for first in (0..cloud.len().max(1)).step_by(STEP) {
        options.monitor.check()?;
        let points = first..(first + STEP).min(cloud.len());
        options.monitor.advance(points.len() as u64);
        for i in points {
            match classes {
                Some(classes) => writeln!(text, "{}", classes.values.get(i)),
                None => line(cloud, i, separator, &mut text),
            }
            .map_err(|e| Error::io(path, e))?;
        }
        file.write_all(&text)?;
        text.clear();
    }
    match labels {
        // Not a cloud by itself.
        true => file.finish(),
        false => verify::finish(file, Format::Text, cloud, options),
    }
}

/// A name as one word that no reader takes for a number.
fn word(name: &str) -> String {
    let plain: String = name
        .chars()
        .map(|c| if c.is_whitespace() || c.is_control() || ",;\"#/".contains(c) { '_' } else { c })
        .collect();
    match plain.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        true => plain,
        false => format!("_{plain}"),
    }
}

fn line(cloud: &Cloud, i: usize, separator: &str, text: &mut Vec<u8>) -> std::io::Result<()> {
    let [x, y, z] = shown_at(cloud, i);
    write!(text, "{x}{separator}{y}{separator}{z}")?;
    cloud.columns().iter().try_for_each(|c| write!(text, "{separator}{}", shown(&c.values, i)))?;
    writeln!(text)
}

/// Coordinates as they are; but a tick times a scale leaves noise in the last digits, which is rounded away.
fn shown_at(cloud: &Cloud, i: usize) -> [f64; 3] {
    let Coordinates::Scaled { scale, .. } = cloud.coordinates() else { return cloud.xyz(i) };
    let mut point = cloud.xyz(i);
    for (v, scale) in point.iter_mut().zip(scale) {
        // A power of ten, a hundredth of a tick or finer.
        let steps = 10f64.powi((2.0 - scale.log10()).ceil().clamp(7.0, 15.0) as i32);
        if (*v * steps).abs() < 1e15 {
            *v = (*v * steps).round() / steps;
        }
    }
    point
}

fn shown(values: &Values, i: usize) -> String {
    match values {
        Values::F32(v) => v[i].to_string(),
        Values::U64(v) => v[i].to_string(),
        Values::I64(v) => v[i].to_string(),
        other => other.get(i).to_string(),
    }
}
