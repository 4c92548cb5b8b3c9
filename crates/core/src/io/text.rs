//! Text: columns of numbers, with or without a row of names, and Semantic3D's `x y z i r g b` with `.labels` beside it.

use super::ReadOptions;
use super::atomic::AtomicFile;
use crate::cloud::{Cloud, Column, Coordinates, Values, names};
use crate::error::{Error, Result};
use std::io::Write;
use std::path::Path;

/// What a line's numbers are.
struct Layout {
    names: Vec<String>,
    /// Columns of x, y and z.
    axes: [usize; 3],
    /// Line at which the numbers begin, from 1.
    first: usize,
}

/// Reads columns of numbers.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let body = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let labels = labels_beside(path)?;
    if let Some((file, labels)) = &labels {
        let (lines, n) = (count_points(body), labels.len());
        if lines != n && lines != n + 1 {
            return Err(bad(
                file,
                ("number of labels", 0, 0),
                (n, format!("{lines} as {} has points", path.display())),
            ));
        }
    }
    let layout = layout(path, body)?;
    options.monitor.stage("read", body.len() as u64);
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); layout.names.len()];
    for (number, line) in lines(body) {
        if number >= layout.first {
            row(path, (number, line), &mut columns)?;
        }
        if number % 65_536 == 0 {
            options.monitor.check()?;
        }
    }
    let mut cloud = assemble(layout, columns, options)?;
    if let Some((file, labels)) = labels {
        if labels.len() != cloud.len() {
            return Err(bad(
                &file,
                ("number of labels", 0, 0),
                (labels.len(), format!("{} as {} has points", cloud.len(), path.display())),
            ));
        }
        cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(labels)))?;
    }
    Ok(cloud)
}

fn bad(
    path: &Path,
    (field, line, column): (&str, usize, usize),
    (found, allowed): (impl ToString, impl ToString),
) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "text",
        field: field.to_string(),
        place: if line == 0 { "the whole file".into() } else { format!("line {line}:{column}") },
        found: found.to_string(),
        allowed: allowed.to_string(),
    }
}

/// Lines that hold something, with their numbers from 1; comments (`#`, and `//` after the first line) are left out.
fn lines(body: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let holds = |line: &[u8]| !line.is_empty() && line[0] != b'#';
    (1..)
        .zip(body.split(|&b| b == b'\n'))
        .map(|(n, l)| (n, l.trim_ascii()))
        .filter(move |(n, l)| holds(l) && (*n == 1 || !l.starts_with(b"//")))
}

fn count_points(body: &[u8]) -> usize {
    lines(body).count()
}

fn separator(b: u8) -> bool {
    b.is_ascii_whitespace() || b == b',' || b == b';'
}

fn words(line: &[u8]) -> impl Iterator<Item = (usize, &str)> {
    let start = line.as_ptr() as usize;
    let parts = line.split(|&b| separator(b)).filter(|w| !w.is_empty());
    parts.map(move |w| (w.as_ptr() as usize - start + 1, std::str::from_utf8(w).unwrap_or("\u{fffd}")))
}

/// A number as people write it: `nan` and `inf` too, but nothing that overflows.
fn number(word: &str) -> Option<f64> {
    let value: f64 = word.parse().ok()?;
    let literal = word.bytes().any(|b| b.is_ascii_digit());
    (value.is_finite() || !literal).then_some(value)
}

fn layout(path: &Path, body: &[u8]) -> Result<Layout> {
    let Some((line, first)) = lines(body).next() else {
        let names = ["x", "y", "z"].map(String::from).to_vec();
        return Ok(Layout { names, axes: [0, 1, 2], first: 1 });
    };
    decimal_comma(path, (line, first))?;
    let head = first.strip_prefix(b"//").unwrap_or(first);
    let found: Vec<&str> = words(head).map(|w| w.1).collect();
    let is_name =
        |w: &&str| number(w).is_none() && w.bytes().next().is_some_and(|b| b.is_ascii_alphabetic() || b == b'_');
    if found.iter().any(is_name) {
        let names: Vec<String> = found.iter().map(|w| (*w).trim_matches('"').to_string()).collect();
        let axis = |a: &str| names.iter().position(|n| n.eq_ignore_ascii_case(a));
        let axes = match (axis("x"), axis("y"), axis("z")) {
            (Some(x), Some(y), Some(z)) => [x, y, z],
            _ => return Err(bad(path, ("header row", line, 1), (names.join(" "), "names with x, y and z among them"))),
        };
        let names = names.into_iter().map(|n| known_name(&n)).collect();
        return Ok(Layout { names, axes, first: line + 1 });
    }
    if found.len() < 3 {
        return Err(bad(path, ("number of columns", line, 1), (found.len(), "3 or more: x y z ...")));
    }
    Ok(Layout { names: usual_names(found.len()), axes: [0, 1, 2], first: line })
}

/// `1,5 2,5 3,5` would be six columns: commas inside the numbers of a line that something else separates.
fn decimal_comma(path: &Path, (number, line): (usize, &[u8])) -> Result<()> {
    let parts = line.split(|&b| b.is_ascii_whitespace() || b == b';').filter(|w| !w.is_empty());
    let inside = |w: &[u8]| {
        let commas = w.iter().filter(|&&b| b == b',').count();
        let digits = w.iter().all(|b| b.is_ascii_digit() || b",+-".contains(b));
        commas == 1 && digits && w.windows(3).any(|t| t[0].is_ascii_digit() && t[1] == b',' && t[2].is_ascii_digit())
    };
    let mut parts = parts.peekable();
    let first = parts.peek().map(|w| String::from_utf8_lossy(w).into_owned()).unwrap_or_default();
    match parts.filter(|w| inside(w)).count() {
        0 | 1 => Ok(()),
        _ => Err(bad(path, ("value", number, 1), (first, "a number; write decimals with a point, not a comma"))),
    }
}

/// Names of columns without a header row, by their number; 7 are Semantic3D's.
fn usual_names(columns: usize) -> Vec<String> {
    let rest: &[&str] = match columns {
        4 => &[names::INTENSITY],
        6 => &names::COLOUR,
        7 => &[names::INTENSITY, names::COLOUR[0], names::COLOUR[1], names::COLOUR[2]],
        _ => &[],
    };
    let named = ["x", "y", "z"].iter().chain(rest).map(ToString::to_string);
    let named: Vec<String> = named.collect();
    (0..columns).map(|c| named.get(c).cloned().unwrap_or_else(|| format!("C{}", c + 1))).collect()
}

fn known_name(name: &str) -> String {
    match name.to_ascii_lowercase().as_str() {
        "intensity" | "i" => names::INTENSITY.into(),
        "red" | "r" => names::COLOUR[0].into(),
        "green" | "g" => names::COLOUR[1].into(),
        "blue" | "b" => names::COLOUR[2].into(),
        "class" | "classification" | "label" => names::CLASSIFICATION.into(),
        _ => name.into(),
    }
}

fn row(path: &Path, (number_of_line, line): (usize, &[u8]), columns: &mut [Vec<f64>]) -> Result<()> {
    let mut read = 0;
    for (at, word) in words(line) {
        let value = number(word).ok_or_else(|| bad(path, ("value", number_of_line, at), (word, "a number")))?;
        if let Some(column) = columns.get_mut(read) {
            column.push(value);
        }
        read += 1;
    }
    let comma = line.contains(&b',')
        && line.iter().any(|&b| b.is_ascii_whitespace() || b == b';')
        && !line.windows(2).any(|w| w == b", ");
    match read == columns.len() {
        true => Ok(()),
        false if comma => Err(bad(
            path,
            ("columns", number_of_line, 1),
            (read, format!("{}; write decimals with a point, not a comma", columns.len())),
        )),
        false => {
            Err(bad(path, ("columns", number_of_line, 1), (read, format!("{} as in the first line", columns.len()))))
        }
    }
}

fn assemble(layout: Layout, mut columns: Vec<Vec<f64>>, options: &ReadOptions) -> Result<Cloud> {
    let axes = layout.axes.map(|a| std::mem::take(&mut columns[a]));
    let mut cloud = Cloud::new(Coordinates::Float(axes))?;
    for (c, (name, numbers)) in layout.names.into_iter().zip(columns).enumerate() {
        if !layout.axes.contains(&c) && options.wants(&name) {
            let values = typed(&name, numbers);
            cloud.set_column(Column::new(name, values))?;
        }
    }
    Ok(cloud)
}

/// Codes and colours are kept as integers where they are; everything else as it was read.
fn typed(name: &str, numbers: Vec<f64>) -> Values {
    let whole = |most: f64| numbers.iter().all(|v| (0.0..=most).contains(v) && v.fract().to_bits() << 1 == 0);
    match name {
        n if n == names::CLASSIFICATION && whole(255.0) => Values::U8(numbers.into_iter().map(|v| v as u8).collect()),
        n if names::COLOUR.contains(&n) && whole(255.0) => Values::U8(numbers.into_iter().map(|v| v as u8).collect()),
        n if names::COLOUR.contains(&n) && whole(65_535.0) => {
            Values::U16(numbers.into_iter().map(|v| v as u16).collect())
        }
        _ => Values::F64(numbers),
    }
}

/// The labels of Semantic3D: NAME.labels beside NAME.txt, one whole number 0..=255 a line.
fn labels_beside(path: &Path) -> Result<Option<(std::path::PathBuf, Vec<u8>)>> {
    let file = path.with_extension("labels");
    if file == path || !file.is_file() {
        return Ok(None);
    }
    let bytes = std::fs::read(&file).map_err(|e| Error::io(&file, e))?;
    let body = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut labels = Vec::new();
    for (n, line) in lines(body) {
        let word = std::str::from_utf8(line).unwrap_or("\u{fffd}");
        labels.push(word.parse().map_err(|_| bad(&file, ("label", n, 1), (word, "a whole number 0..255")))?);
    }
    Ok(Some((file, labels)))
}

/// Writes a header row and a line a point; `.labels` gets the class codes alone.
pub(super) fn write(path: &Path, cloud: &Cloud) -> Result<()> {
    let labels = path.extension().is_some_and(|e| e == "labels");
    let mut file = AtomicFile::create(path)?;
    let target = path.to_path_buf();
    let comma = path.extension().is_some_and(|e| e == "csv");
    let separator = if comma { "," } else { " " };
    let classes = match labels {
        true => Some(
            cloud.column(names::CLASSIFICATION).ok_or_else(|| Error::input("no Classification to write as .labels"))?,
        ),
        false => None,
    };
    let out = file.writer()?;
    let mut lines = || -> std::io::Result<()> {
        if classes.is_none() {
            let names = ["x", "y", "z"].into_iter().chain(cloud.columns().iter().map(|c| c.name.as_str()));
            writeln!(out, "{}", names.collect::<Vec<_>>().join(separator))?;
        }
        for i in 0..cloud.len() {
            match classes {
                Some(classes) => writeln!(out, "{}", classes.values.get(i))?,
                None => {
                    let [x, y, z] = shown_at(cloud, i);
                    write!(out, "{x}{separator}{y}{separator}{z}")?;
                    cloud.columns().iter().try_for_each(|c| write!(out, "{separator}{}", shown(&c.values, i)))?;
                    writeln!(out)?;
                }
            }
        }
        Ok(())
    };
    lines().map_err(|e| Error::io(&target, e))?;
    file.finish()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io;

    fn read_text(name: &str, files: &[(&str, &str)]) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
        io::read(&folder.path().join(name))
    }

    #[test]
    fn semantic3d_text_with_labels_is_read() {
        let text = "\u{feff}1.5 2 3 -900 10 20 30\r\n\r\n4 5 nan 7 255 0 1\r\n";
        let cloud = read_text("a.txt", &[("a.txt", text), ("a.labels", "1\n8\n")]).unwrap();
        assert_eq!(cloud.len(), 2);
        assert!(cloud.xyz(1)[2].is_nan());
        assert_eq!(cloud.column("Classification").unwrap().values, Values::U8(vec![1, 8]));
        assert_eq!(cloud.column("Red").unwrap().values, Values::U8(vec![10, 255]));
        assert_eq!(cloud.column("Intensity").unwrap().values, Values::F64(vec![-900.0, 7.0]));
    }

    #[test]
    fn header_rows_in_the_usual_forms_are_understood() {
        for head in ["//X Y Z class\n", "x,y,z,Classification\n", "# a comment\nx;y;z;label\n"] {
            let cloud = read_text("a.csv", &[("a.csv", &(head.to_string() + "1 2 3 6\n"))]).unwrap();
            assert_eq!(cloud.column("Classification").unwrap().values, Values::U8(vec![6]), "{head}");
        }
        let plain = read_text("a.xyz", &[("a.xyz", "1 2 3 4 5\n")]).unwrap();
        assert_eq!(plain.columns().iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["C4", "C5"]);
    }

    #[test]
    fn malformed_text_is_an_error_with_line_and_column() {
        for (text, expected) in [
            ("1 2 3\n4 5\n", "line 2:1"),
            ("1 2 3\n4 x5 6\n", "line 2:3"),
            ("1 2 3\n4 1e400 6\n", "line 2:3"),
            ("1.0 2.0 3.0\n1,5 2,5 3,5\n", "not a comma"),
            ("1,5 2,5 3,5\n4,5 5,5 6,5\n", "not a comma"),
            ("1,5;2,5;-3,5\n", "not a comma"),
            ("x;y;z\n1,5;2,5;-3,5\n", "not a comma"),
            ("a b c\n1 2 3\n", "x, y and z"),
            ("1 2\n", "3 or more"),
        ] {
            let message = read_text("a.txt", &[("a.txt", text)]).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        for labels in ["1\n2\n3\n4\n", "1\n", "1\n256\n", "1\ncar\n"] {
            let message =
                read_text("a.txt", &[("a.txt", "1 2 3\n4 5 6\n"), ("a.labels", labels)]).unwrap_err().to_string();
            assert!(message.contains("a.labels"), "{message}");
        }
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = Cloud::from_rows(&[[652_000.123, 6e6, 1.0], [1.25, -2.5, 3.0]]).unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(vec![2, 6]))).unwrap();
        for name in ["a.txt", "a.csv"] {
            let path = folder.path().join(name);
            write(&path, &cloud).unwrap();
            assert_eq!(io::read(&path).unwrap(), cloud);
        }
        let path = folder.path().join("b.labels");
        write(&path, &cloud).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "2\n6\n");
    }

    #[test]
    fn fine_coordinates_are_not_rounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let cloud = Cloud::from_rows(&[[5.123_456_789_012, 52.000_000_000_1, 1e-9]]).unwrap();
        write(&path, &cloud).unwrap();
        assert_eq!(io::read(&path).unwrap(), cloud);
        let scaled = Coordinates::Scaled {
            ticks: [vec![512_345_678], vec![65_200_012], vec![-1]],
            scale: [1e-8, 0.01, 0.001],
            offset: [0.0; 3],
        };
        write(&path, &Cloud::new(scaled).unwrap()).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "x y z\n5.12345678 652000.12 -0.001\n");
    }
}
