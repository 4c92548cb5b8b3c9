//! Reading and writing rasters of heights as ESRI ASCII grids (`.asc`).
//!
//! Format: <https://desktop.arcgis.com/en/arcmap/latest/manage-data/raster-and-images/esri-ascii-raster-format.htm>.
//! Six keywords, each with a number (`ncols`, `nrows`, `xllcorner` or `xllcenter`, `yllcorner` or `yllcenter`,
//! `cellsize`, `nodata_value`), then the heights, the northernmost row first.

use super::{NODATA, row_from_north};
use crate::cloud::Raster;
use crate::error::{Error, Mismatch, Result};
use crate::io::atomic::AtomicFile;
use crate::io::open;
use crate::parallel::Monitor;
use std::fmt::Write;
use std::path::Path;

/// Writes the raster, one line per row. Numbers are the shortest that give the same `f32` when they are read.
pub(super) fn write(path: &Path, raster: &Raster, monitor: &Monitor) -> Result<()> {
    let ([west, south], cell) = (raster.origin(), raster.cell());
    let mut text = format!("ncols {}\nnrows {}\n", raster.columns(), raster.rows());
    let _ = writeln!(text, "xllcorner {west}\nyllcorner {south}\ncellsize {cell}\nNODATA_value {NODATA}");
    let mut file = AtomicFile::create(path)?;
    for row in 0..raster.rows() {
        monitor.check()?;
        for (column, height) in row_from_north(raster, row).enumerate() {
            let _ = write!(text, "{}{height}", if column == 0 { "" } else { " " });
        }
        text.push('\n');
        file.write_all(text.as_bytes())?;
        text.clear();
    }
    file.finish()
}

/// Reads an ESRI ASCII grid of heights; cells without data are holes. Where the header has no `nodata_value`, it is the
/// format's own: -9999.
///
/// # Errors
/// If the file cannot be read, a keyword of the header is missing, a number is malformed, or the number of heights is
/// not that of the header. Nothing is allocated from the header alone.
pub fn read_ascii_grid(path: &Path) -> Result<Raster> {
    let text = open::bytes(path, open::MOST_TABLE)?;
    let text = String::from_utf8_lossy(&text);
    let (header, body) = split(&text);
    let field = |names: [&'static str; 2]| {
        let found = header.iter().find(|(name, ..)| names.iter().any(|n| n.eq_ignore_ascii_case(name)));
        found.map(|&(name, value, line)| (name, number(path, name, value, line)))
    };
    let needed = |names: [&'static str; 2]| {
        let (name, value) = field(names).ok_or_else(|| {
            malformed(
                path,
                names[0],
                "line 1".into(),
                Mismatch::new("no such word", format!("one of {}", names.join(", "))),
            )
        })?;
        Ok::<_, Error>((name, value?))
    };
    let count = |names: [&'static str; 2]| {
        let (name, value) = needed(names)?;
        if value.fract() == 0.0 && (1.0..=1e9).contains(&value) {
            Ok(value as usize)
        } else {
            Err(malformed(path, name, "line 1".into(), Mismatch::new(value, "a whole number, 1 or more")))
        }
    };
    let (columns, rows) = (count(["ncols", "ncols"])?, count(["nrows", "nrows"])?);
    let cell = needed(["cellsize", "dx"])?.1;
    if let Some((name, height)) = field(["dy", "dy"]) {
        let height = height?;
        if (height - cell).abs() > 1e-9 * cell.abs() {
            let allowed = format!("{cell}, as dx: cells are square");
            return Err(malformed(path, name, "line 1".into(), Mismatch::new(height, allowed)));
        }
    }
    let nodata = field(["nodata_value", "nodata"]).map_or(Ok(f64::from(NODATA)), |(_, value)| value)?;
    let heights = heights(path, body, nodata)?;
    if columns.checked_mul(rows) != Some(heights.len()) {
        let place = format!("line {}", header.len() + 1);
        return Err(malformed(path, "heights", place, Mismatch::new(heights.len(), format!("{columns} x {rows}"))));
    }
    let corner = |names: [&'static str; 2]| {
        needed(names).map(|(name, v)| if name.eq_ignore_ascii_case(names[1]) { v - 0.5 * cell } else { v })
    };
    let origin = [corner(["xllcorner", "xllcenter"])?, corner(["yllcorner", "yllcenter"])?];
    let values = heights.chunks_exact(columns).rev().flatten().copied().collect();
    Raster::new(origin, cell, columns, values).map_err(|e| Error::input(format!("{}: {e}", path.display())))
}

/// A keyword, its value, and its line number.
type Field<'a> = (&'a str, &'a str, usize);

/// The header's keywords and values, and the remaining lines with their numbers.
fn split(text: &str) -> (Vec<Field<'_>>, impl Iterator<Item = (usize, &str)>) {
    let is_header = |line: &str| line.trim_start().starts_with(|c: char| c.is_ascii_alphabetic());
    let lines = || text.lines().enumerate().map(|(i, line)| (i + 1, line));
    let words = lines().take_while(move |(_, line)| is_header(line)).filter_map(|(i, line)| {
        let mut words = line.split_whitespace();
        Some((words.next()?, words.next().unwrap_or_default(), i))
    });
    (words.collect(), lines().skip_while(move |(_, line)| is_header(line)))
}

fn heights<'a>(path: &Path, body: impl Iterator<Item = (usize, &'a str)>, nodata: f64) -> Result<Vec<f64>> {
    let mut heights = Vec::new();
    for (line, text) in body {
        for word in text.split_whitespace() {
            let value = number(path, "height", word, line)?;
            heights.push(if (value - nodata).abs() > 0.0 { value } else { f64::NAN });
        }
    }
    Ok(heights)
}

fn number(path: &Path, field: &str, word: &str, line: usize) -> Result<f64> {
    let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
    value.ok_or_else(|| malformed(path, field, format!("line {line}"), Mismatch::new(word, "a finite number")))
}

fn malformed(path: &Path, field: &str, place: String, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "ASCII grid",
        field: field.to_owned(),
        place,
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Raster> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dtm.asc");
        std::fs::write(&path, text).unwrap();
        read_ascii_grid(&path)
    }

    const GRID: &str =
        "ncols 3\nnrows 2\nxllcorner 100.0\nyllcorner 50\ncellsize 2\nNODATA_value -9999\n4 5 6\n1 -9999 3\n";

    #[test]
    fn the_last_row_of_the_file_is_the_southernmost() {
        let raster = read(GRID).unwrap();
        assert_eq!((raster.origin(), raster.cell(), raster.columns(), raster.rows()), ([100.0, 50.0], 2.0, 3, 2));
        assert!(raster.values()[1].is_nan() && raster.values()[0] == 1.0 && raster.values()[3..] == [4.0, 5.0, 6.0]);
        let centre = GRID.replace("xllcorner 100.0", "XLLCENTER 101.0").replace("\nNODATA_value -9999", "");
        let raster = read(&centre).unwrap();
        assert!(raster.origin() == [100.0, 50.0] && raster.values()[1].is_nan());
        let other = GRID.replace("_value -9999", "_value -1");
        assert_eq!(read(&other).unwrap().values()[1], -9999.0);
    }

    #[test]
    fn what_was_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dtm.asc");
        let values = vec![1.0, f64::NAN, 3.25, 4.0, 5.0, -6.5];
        let raster = Raster::new([652_000.25, -50.5], 0.5, 3, values).unwrap();
        write(&path, &raster, &Monitor::default()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.ends_with("NODATA_value -9999\n4 5 -6.5\n1 -9999 3.25\n"), "{text}");
        let read = read_ascii_grid(&path).unwrap();
        assert_eq!((read.origin(), read.cell(), read.columns()), (raster.origin(), 0.5, 3));
        assert!(read.values()[1].is_nan() && read.values()[2..] == raster.values()[2..]);
    }

    #[test]
    fn malformed_grids_are_refused_with_their_place() {
        for (old, new, said) in [
            ("4 5 6", "4 5 x", "line 7"),
            ("4 5 6", "4 5", "3 x 2"),
            ("ncols 3", "ncols 999999999", "999999999 x 2"),
            ("ncols 3", "ncols -3", "ncols"),
            ("ncols 3\n", "", "ncols"),
            ("cellsize 2", "cellsize", "cellsize"),
            ("cellsize 2", "cellsize 0", "above 0"),
            ("cellsize 2", "dx 2\ndy 4", "as dx"),
            ("1 -9999 3", "1 nan 3", "line 8"),
        ] {
            let error = read(&GRID.replace(old, new)).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
        assert!(read("").is_err());
    }
}
