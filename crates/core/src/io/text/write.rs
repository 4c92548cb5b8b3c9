//! Writing text.

use super::labels;
use super::print::{self, Rounded};
use super::read::Reader;
use crate::cloud::{Cloud, Coordinates, Values, names};
use crate::error::{Error, Result};
use crate::io::atomic::AtomicFile;
use crate::io::{WriteOptions, verify};
use crate::parallel::map_ordered;
use std::path::Path;

/// Number of lines assembled and written at once.
const BATCH: usize = 16_384;

/// The content of the lines.
enum Lines<'a> {
    /// Coordinates and columns.
    Points { cloud: &'a Cloud, separator: u8, rounded: Option<[Rounded; 3]> },
    /// The class code.
    Labels(&'a Values),
}

/// Writes a header row and a line a point; `.labels` gets the class codes alone.
pub(in crate::io) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    let is = |extension| path.extension().is_some_and(|e| e == extension);
    let lines = match is("labels") {
        true => Lines::Labels(codes(cloud)?),
        false => Lines::Points { cloud, separator: if is("csv") { b',' } else { b' ' }, rounded: rounded(cloud) },
    };
    let mut file = AtomicFile::create(path)?;
    file.write_all(&lines.head())?;
    options.monitor.stage("write", cloud.len() as u64);
    let (batches, at_once) = (cloud.len().div_ceil(BATCH), 2 * rayon::current_num_threads());
    for first in (0..batches).step_by(at_once) {
        let texts = map_ordered(at_once.min(batches - first), &options.monitor, |batch| {
            let points = (first + batch) * BATCH..((first + batch + 1) * BATCH).min(cloud.len());
            options.monitor.advance(points.len() as u64);
            Ok(lines.text(points))
        })?;
        texts.iter().try_for_each(|text| file.write_all(text))?;
    }
    match lines {
        // A label file alone is not a cloud.
        Lines::Labels(_) => file.finish(),
        Lines::Points { .. } => {
            if cloud.column(names::CLASSIFICATION).is_none() {
                labels::tell_read(path, &options.monitor);
            }
            verify::finish(file, cloud, options, Reader::open)
        }
    }
}

fn codes(cloud: &Cloud) -> Result<&Values> {
    let column = cloud.column(names::CLASSIFICATION);
    column.map(|c| &c.values).ok_or_else(|| Error::input("no Classification to write as .labels"))
}

impl Lines<'_> {
    fn head(&self) -> Vec<u8> {
        let Self::Points { cloud, separator, .. } = self else { return Vec::new() };
        let names = ["x", "y", "z"].map(String::from).into_iter().chain(cloud.columns().iter().map(|c| word(&c.name)));
        (names.collect::<Vec<_>>().join(if *separator == b',' { "," } else { " " }) + "\n").into_bytes()
    }

    /// The lines of some points.
    fn text(&self, points: std::ops::Range<usize>) -> Vec<u8> {
        let mut text = Vec::new();
        match self {
            Self::Labels(codes) => {
                for i in points {
                    print::double(codes.get(i), &mut text);
                    text.push(b'\n');
                }
            }
            Self::Points { cloud, separator, rounded } => {
                for i in points {
                    for (axis, v) in cloud.xyz(i).into_iter().enumerate() {
                        match rounded {
                            Some(rounded) => rounded[axis].append(v, &mut text),
                            None => print::double(v, &mut text),
                        }
                        text.push(*separator);
                    }
                    for column in cloud.columns() {
                        print::value(&column.values, i, &mut text);
                        text.push(*separator);
                    }
                    text.pop();
                    text.push(b'\n');
                }
            }
        }
        text
    }
}

/// Coordinates are written exactly, except that tick times scale has rounding noise in its last digits: these are
/// rounded to a power of ten of at most a hundredth of a tick.
fn rounded(cloud: &Cloud) -> Option<[Rounded; 3]> {
    let Coordinates::Scaled { scale, .. } = cloud.coordinates() else { return None };
    Some(scale.map(|scale| Rounded::new((2.0 - scale.log10()).ceil().clamp(7.0, 15.0) as u32)))
}

/// A name as one word that readers cannot take for a number.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Column;
    use crate::parallel::Monitor;

    fn lines_of(cloud: &Cloud) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write(&path, cloud, &WriteOptions::default()).unwrap();
        std::fs::read_to_string(path).unwrap().lines().map(String::from).collect()
    }

    #[test]
    fn every_line_is_what_the_standard_library_writes() {
        let n = 2 * BATCH + 3;
        let at = |i: usize| [i as f64 * 0.37 - 5.0, 6_861_000.0 + i as f64 / 7.0, -(i as f64)];
        let mut cloud = Cloud::from_rows(&(0..n).map(at).collect::<Vec<_>>()).unwrap();
        let bytes: Vec<u8> = (0..n).map(|i| (i * 7) as u8).collect();
        let floats: Vec<f32> = (0..n).map(|i| i as f32 / 97.0).collect();
        let wide: Vec<u64> = (0..n as u64).map(|i| u64::MAX - i).collect();
        cloud.set_column(Column::new("a b", Values::U8(bytes.clone()))).unwrap();
        cloud.set_column(Column::new("F", Values::F32(floats.clone()))).unwrap();
        cloud.set_column(Column::new("W", Values::U64(wide.clone()))).unwrap();
        let lines = lines_of(&cloud);
        assert_eq!((lines.len(), &lines[0][..]), (n + 1, "x,y,z,a_b,F,W"));
        for (i, line) in lines[1..].iter().enumerate() {
            let [x, y, z] = at(i);
            assert_eq!(*line, format!("{x},{y},{z},{},{},{}", bytes[i], floats[i], wide[i]));
        }
    }

    #[test]
    fn ticks_times_a_scale_leave_no_noise() {
        let ticks = [vec![1, -7, 0], vec![652_000_123, 3, -1], vec![30_010, 1, 99]];
        let scaled = Coordinates::Scaled { ticks, scale: [0.001, 0.001, 0.01], offset: [0.1, 0.0, -0.25] };
        let lines = lines_of(&Cloud::new(scaled).unwrap());
        assert_eq!(lines[1..], ["0.101,652000.123,299.85", "0.093,0.003,-0.24", "0.1,-0.001,0.74"]);
    }

    #[test]
    fn a_cancelled_text_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let cloud = Cloud::from_rows(&vec![[1.0; 3]; 10]).unwrap();
        let monitor = Monitor::default();
        monitor.cancel();
        let options = WriteOptions { monitor, ..WriteOptions::default() };
        for name in ["a.xyz", "a.ply"] {
            let found = crate::io::write(&folder.path().join(name), &cloud, &options);
            assert!(matches!(found, Err(Error::Interrupted)));
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }

    #[test]
    fn a_writer_that_is_cancelled_on_its_way_stops_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let rows: Vec<[f64; 3]> = (0..400_000).map(|i| [f64::from(i), f64::from(i % 7), 0.5]).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        for name in ["a.las", "a.laz", "a.ply", "a.pcd", "a.xyz"] {
            let options = WriteOptions { monitor: Monitor::cancelled_after(1), ..WriteOptions::default() };
            let found = crate::io::write(&folder.path().join(name), &cloud, &options);
            assert!(matches!(found, Err(Error::Interrupted)), "{name}");
            assert!(options.monitor.progress().1 < 400_000, "{name}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }
}
