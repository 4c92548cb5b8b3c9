//! PTX, the exchange format of Leica Cyclone: scans one after the other, each with its grid and pose.
//!
//! A scan starts with the columns and rows of its grid, the scanner's position and axes, and a 4 x 4 matrix that
//! transforms its points: p' = (x y z 1) M. Then follow `x y z i` or `x y z i r g b`, and `0 0 0` for missing returns,
//! which are skipped. If there are several scans, the column `ScanIndex` has the index of each point's scan, from 0.

use super::lines::Lines;
use super::lines::words::Words;
use super::{FileInfo, ReadOptions};
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::{Error, Mismatch, Result};
use crate::io::table::Table;
use std::path::Path;

/// Numbers before the points of a scan: 2 of the grid, 12 of the scanner, 16 of the matrix, line by line.
const HEAD: [usize; 10] = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4];

fn bad(path: &Path, field: &str, line: usize, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "PTX",
        field: field.to_string(),
        place: format!("line {line}"),
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

/// The grid and the matrix of a scan.
struct Scan {
    points: u64,
    matrix: [f64; 16],
}

/// The numbers of the next line; `None` at the end.
fn numbers(path: &Path, lines: &mut Lines) -> Result<Option<(usize, Vec<f64>)>> {
    let Some((number, line)) = lines.next()? else { return Ok(None) };
    let words = Words::new(line)
        .map(|w| w.value.ok_or_else(|| bad(path, "value", number, Mismatch::new(w.string(), "a number"))));
    words.collect::<Result<_>>().map(|numbers| Some((number, numbers)))
}

/// The header of the next scan; `None` at the end.
fn head(path: &Path, lines: &mut Lines) -> Result<Option<Scan>> {
    let mut all = Vec::new();
    for (i, count) in HEAD.into_iter().enumerate() {
        match numbers(path, lines)? {
            None if i == 0 => return Ok(None),
            None => return Err(bad(path, "head of a scan", i, Mismatch::new("the end of the file", "10 lines"))),
            Some((line, numbers)) if numbers.len() != count => {
                return Err(bad(
                    path,
                    "head of a scan",
                    line,
                    Mismatch::new(format!("{} numbers", numbers.len()), count),
                ));
            }
            Some((line, numbers)) => {
                if numbers.iter().any(|v| !v.is_finite() || (i < 2 && (v.fract() != 0.0 || !(0.0..1e9).contains(v)))) {
                    let allowed = if i < 2 { "a whole number below 10^9" } else { "finite numbers" };
                    return Err(bad(path, "head of a scan", line, Mismatch::new(format!("{numbers:?}"), allowed)));
                }
                all.extend(numbers);
            }
        }
    }
    let mut matrix = [0.0; 16];
    matrix.copy_from_slice(&all[14..30]);
    Ok(Some(Scan { points: all[0] as u64 * all[1] as u64, matrix }))
}

/// Reads all scans.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let mut lines = Lines::open(path, "PTX", 0, 0)?;
    let mut table = Table::default();
    let (mut values, mut scans): ([Vec<f64>; 4], Vec<u32>) = Default::default();
    let mut number = 0;
    while let Some(scan) = head(path, &mut lines)? {
        for i in 0..scan.points {
            if i % 4096 == 4095 {
                options.monitor.check()?;
            }
            let Some((line, row)) = numbers(path, &mut lines)? else {
                return Err(bad(
                    path,
                    "points",
                    0,
                    Mismatch::new("the end of the file", format!("{} in scan {number}", scan.points)),
                ));
            };
            if row.len() != 4 && row.len() != 7 {
                return Err(bad(
                    path,
                    "point",
                    line,
                    Mismatch::new(format!("{} numbers", row.len()), "4 or 7: x y z i (r g b)"),
                ));
            }
            if row[..3].iter().any(|v| v.abs() > 0.0 || v.is_nan()) {
                let m = &scan.matrix;
                for (a, axis) in table.axes.iter_mut().enumerate() {
                    axis.push(row[0] * m[a] + row[1] * m[4 + a] + row[2] * m[8 + a] + m[12 + a]);
                }
                values.iter_mut().enumerate().for_each(|(v, list)| list.push(row.get(3 + v).copied().unwrap_or(0.0)));
                scans.push(number);
            }
        }
        number += 1;
    }
    let coloured = values[1..].iter().flatten().any(|v| v.abs() > 0.0);
    let [intensity, red, green, blue] = values;
    let mut columns = vec![Column::new(names::INTENSITY, Values::F64(intensity))];
    if coloured {
        let bytes = |v: Vec<f64>| Values::U8(v.into_iter().map(|v| v.round() as u8).collect());
        columns.extend(names::COLOUR.into_iter().zip([red, green, blue]).map(|(n, v)| Column::new(n, bytes(v))));
    }
    if number > 1 {
        columns.push(Column::new("ScanIndex", Values::U32(scans)));
    }
    table.columns = columns.into_iter().filter(|c| options.wants(&c.name)).collect();
    table.cloud()
}

/// Points and scans according to the headers; the lines between them are skipped.
pub(super) fn inspect(path: &Path) -> Result<FileInfo> {
    let mut lines = Lines::open(path, "PTX", 0, 0)?;
    let mut info = FileInfo::new(path, "PTX", 0);
    info.dimensions.push(names::INTENSITY.into());
    let mut scans = 0;
    while let Some(scan) = head(path, &mut lines)? {
        for i in 0..scan.points {
            let Some((_, line)) = lines.next()? else {
                return Err(bad(
                    path,
                    "points",
                    0,
                    Mismatch::new("the end of the file", format!("{} in scan {scans}", scan.points)),
                ));
            };
            if scans == 0 && i == 0 && Words::new(line).count() == 7 {
                info.dimensions.extend(names::COLOUR.map(String::from));
            }
        }
        info.points += scan.points;
        scans += 1;
    }
    if scans > 1 {
        info.dimensions.push("ScanIndex".into());
    }
    info.warnings.push(format!("grids of {scans} scans; points that hit nothing are left out when the file is read"));
    Ok(info)
}

#[cfg(test)]
mod tests {
    use crate::cloud::{Cloud, Values};
    use crate::error::Result;
    use crate::io;

    fn read(text: &str) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ptx");
        std::fs::write(&path, text).unwrap();
        io::inspect(&path)?;
        io::read(&path)
    }

    const AXES: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

    #[test]
    fn scans_are_turned_and_moved_and_what_hit_nothing_is_left_out() {
        let text = format!(
            "2\n1\n{AXES}0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n1 2 3 0.5 10 20 30\n0 0 0 0.5 0 0 0\n1\n1\n{AXES}1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n4 5 6 0.25 40 50 60\n"
        );
        let cloud = read(&text).unwrap();
        assert_eq!((cloud.len(), cloud.xyz(0), cloud.xyz(1)), (2, [8.0, 21.0, 33.0], [4.0, 5.0, 6.0]));
        let values = |name: &str| cloud.column(name).unwrap().values.clone();
        assert_eq!(values("Intensity"), Values::F64(vec![0.5, 0.25]));
        assert_eq!(values("Blue"), Values::U8(vec![30, 60]));
        assert_eq!(values("ScanIndex"), Values::U32(vec![0, 1]));
        for (from, to, expected) in [
            ("2\n1\n", "2\n2\n", "numbers"),
            ("2\n1\n", "-2\n1\n", "whole number"),
            ("0.25 40 50 60", "0.25 40", "4 or 7"),
            ("4 5 6", "4 q 6", "found q"),
            ("10 20 30 1\n", "10 20 nan 1\n", "finite"),
        ] {
            let message = read(&text.replacen(from, to, 1)).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        assert!(read(text.trim_end().rsplit_once('\n').unwrap().0).is_err(), "a point is missing");
    }
}
