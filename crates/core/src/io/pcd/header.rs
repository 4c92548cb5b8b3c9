//! The header of PCD (Point Cloud Library, The PCD file format, versions .5 to .7).

use crate::error::{Error, Mismatch, Result};
use crate::io::open;
use crate::io::table::number::Kind;
use std::io::Read;
use std::path::Path;

/// Longest header that is accepted.
pub(super) const LONGEST: u64 = 64 << 10;
/// Largest number of values a point; the longest descriptor of the library has 1980.
pub(super) const MOST_NUMBERS: usize = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

/// `count` numbers of one type a point. Padding has the name `_`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) count: usize,
}

impl Field {
    /// Bytes of the field in a point.
    pub(super) fn width(&self) -> usize {
        self.kind.size() * self.count
    }

    pub(super) fn padding(&self) -> bool {
        self.name == "_"
    }
}

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) version: String,
    pub(super) fields: Vec<Field>,
    pub(super) points: u64,
    /// Number of rows of an organised cloud, else 1.
    pub(super) height: u64,
    /// Position and quaternion (w x y z) of the sensor.
    pub(super) viewpoint: [f64; 7],
    pub(super) encoding: Encoding,
    /// Offset of the first point, and the number of lines before it.
    pub(super) body: u64,
    pub(super) lines: usize,
    /// Number of bytes from `body` to the end of the file.
    pub(super) room: u64,
}

pub(super) const AT_ORIGIN: [f64; 7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

pub(super) fn bad(path: &Path, field: &str, place: String, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "PCD",
        field: field.to_string(),
        place,
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

/// The entries of a header: the words after each keyword, and the line number.
#[derive(Default)]
struct Entries<'a>(Vec<(&'a str, Vec<&'a str>, usize)>);

impl<'a> Entries<'a> {
    fn words(&self, key: &str) -> Option<(&[&'a str], usize)> {
        self.0.iter().find(|(k, ..)| *k == key).map(|(_, words, line)| (&words[..], *line))
    }

    /// The integer after a keyword.
    fn number(&self, path: &Path, key: &str) -> Result<Option<u64>> {
        let Some((words, line)) = self.words(key) else { return Ok(None) };
        let number = words.first().and_then(|w| w.parse().ok());
        let found = || bad(path, key, format!("line {line}"), Mismatch::new(words.join(" "), "a whole number"));
        number.map(Some).ok_or_else(found)
    }
}

impl Header {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let file = open::file(path)?;
        let size = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut bytes = Vec::new();
        file.take(LONGEST).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
        let end = data_line(&bytes).ok_or_else(|| {
            bad(
                path,
                "header",
                "its end".into(),
                Mismatch::new("no line `DATA`", "DATA ascii, binary or binary_compressed"),
            )
        })?;
        let text = String::from_utf8_lossy(&bytes[..end]);
        let mut entries = Entries::default();
        for (n, line) in (1..).zip(text.lines()) {
            let mut words = line.split([' ', '\t', '\r', ',']).filter(|w| !w.is_empty());
            match words.next() {
                Some("COLUMNS") => entries.0.push(("FIELDS", words.collect(), n)),
                Some(key) if !key.starts_with('#') => entries.0.push((key, words.collect(), n)),
                _ => {}
            }
        }
        let (points, height) = size_of(path, &entries)?;
        Ok(Self {
            version: entries.words("VERSION").and_then(|v| v.0.first()).map_or("unknown", |v| v).to_string(),
            fields: fields(path, &entries)?,
            points,
            height,
            viewpoint: viewpoint(path, &entries)?,
            encoding: encoding(path, &entries)?,
            body: end as u64,
            lines: text.lines().count(),
            room: size.saturating_sub(end as u64),
        })
    }

    /// Bytes of a point, including padding.
    pub(super) fn width(&self) -> usize {
        self.fields.iter().map(Field::width).sum()
    }
}

/// Offset of the first byte after the line that starts with `DATA`.
fn data_line(bytes: &[u8]) -> Option<usize> {
    let mut at = 0;
    for line in bytes.split_inclusive(|&b| b == b'\n') {
        at += line.len();
        if line.trim_ascii_start().starts_with(b"DATA") {
            return line.ends_with(b"\n").then_some(at);
        }
    }
    None
}

/// Number of points and rows; redundant entries must agree.
fn size_of(path: &Path, entries: &Entries<'_>) -> Result<(u64, u64)> {
    let [width, height, points] = ["WIDTH", "HEIGHT", "POINTS"].map(|key| entries.number(path, key));
    let (width, height, points) = (width?, height?, points?);
    let product = width.map(|w| w.checked_mul(height.unwrap_or(1)));
    let place = || format!("line {}", entries.words("POINTS").map_or(0, |p| p.1));
    match (product, points) {
        (Some(Some(product)), None) => Ok((product, height.unwrap_or(1))),
        (Some(Some(product)), Some(points)) if product == points => Ok((points, height.unwrap_or(1))),
        (None, Some(points)) => Ok((points, 1)),
        (None, None) => Err(bad(path, "POINTS", "header".into(), Mismatch::new("none", "POINTS, or WIDTH and HEIGHT"))),
        (Some(product), points) => Err(bad(
            path,
            "POINTS",
            place(),
            Mismatch::new(
                points.map_or("none".into(), |p| p.to_string()),
                product.map_or("WIDTH times HEIGHT below 2^64".into(), |p| format!("{p} as WIDTH times HEIGHT")),
            ),
        )),
    }
}

fn fields(path: &Path, entries: &Entries<'_>) -> Result<Vec<Field>> {
    let needed = |key: &str| {
        entries
            .words(key)
            .ok_or_else(|| bad(path, key, "header".into(), Mismatch::new("none", "a line of this keyword")))
    };
    let (names, _) = needed("FIELDS")?;
    let (sizes, line) = needed("SIZE")?;
    let (types, type_line) = needed("TYPE")?;
    let (counts, count_line) = entries.words("COUNT").unwrap_or((&[], line));
    for (key, found, line) in [("SIZE", sizes.len(), line), ("TYPE", types.len(), type_line)] {
        if found != names.len() {
            return Err(bad(
                path,
                key,
                format!("line {line}"),
                Mismatch::new(found, format!("{} as there are FIELDS", names.len())),
            ));
        }
    }
    if !counts.is_empty() && counts.len() != names.len() {
        let allowed = format!("{} as there are FIELDS", names.len());
        return Err(bad(path, "COUNT", format!("line {count_line}"), Mismatch::new(counts.len(), allowed)));
    }
    let mut list = Vec::with_capacity(names.len());
    for (i, name) in names.iter().enumerate() {
        let allowed = "I or U of 1, 2, 4 or 8 bytes, F of 4 or 8";
        let kind = kind(types[i], sizes[i]).ok_or_else(|| {
            bad(path, name, format!("line {line}"), Mismatch::new(format!("{} of {}", types[i], sizes[i]), allowed))
        })?;
        let count = counts.get(i).map_or(Ok(1), |c| c.parse());
        let count = count.ok().filter(|c| (1..=MOST_NUMBERS).contains(c)).ok_or_else(|| {
            bad(path, "COUNT", format!("line {count_line}"), Mismatch::new(counts[i], format!("1 to {MOST_NUMBERS}")))
        })?;
        list.push(Field { name: (*name).to_string(), kind, count });
    }
    match list.iter().map(|f| f.count).sum::<usize>() {
        0..=MOST_NUMBERS => Ok(list),
        sum => Err(bad(
            path,
            "COUNT",
            format!("line {count_line}"),
            Mismatch::new(sum, format!("{MOST_NUMBERS} numbers a point")),
        )),
    }
}

fn kind(letter: &str, size: &str) -> Option<Kind> {
    match (letter, size) {
        ("U", "1") => Some(Kind::U8),
        ("U", "2") => Some(Kind::U16),
        ("U", "4") => Some(Kind::U32),
        ("U", "8") => Some(Kind::U64),
        ("I", "1") => Some(Kind::I8),
        ("I", "2") => Some(Kind::I16),
        ("I", "4") => Some(Kind::I32),
        ("I", "8") => Some(Kind::I64),
        ("F", "4") => Some(Kind::F32),
        ("F", "8") => Some(Kind::F64),
        _ => None,
    }
}

fn viewpoint(path: &Path, entries: &Entries<'_>) -> Result<[f64; 7]> {
    let Some((words, line)) = entries.words("VIEWPOINT") else { return Ok(AT_ORIGIN) };
    let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).filter(|v: &f64| v.is_finite()).collect();
    <[f64; 7]>::try_from(numbers)
        .map_err(|_| bad(path, "VIEWPOINT", format!("line {line}"), Mismatch::new(words.join(" "), "7 numbers")))
}

fn encoding(path: &Path, entries: &Entries<'_>) -> Result<Encoding> {
    let (words, line) = entries.words("DATA").unwrap_or((&[], 0));
    match words {
        ["ascii"] => Ok(Encoding::Ascii),
        ["binary"] => Ok(Encoding::Binary),
        ["binary_compressed"] => Ok(Encoding::Compressed),
        _ => Err(bad(
            path,
            "DATA",
            format!("line {line}"),
            Mismatch::new(words.join(" "), "ascii, binary or binary_compressed"),
        )),
    }
}
