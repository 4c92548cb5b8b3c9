//! The header of PLY (G. Turk, *The PLY polygon file format*, 1994).

use crate::cloud::names;
use crate::error::{Error, Mismatch, Result};
use crate::io::open;
use crate::io::table::number::Kind;
use std::collections::BTreeSet;
use std::io::Read;
use std::path::Path;

/// Longest header that is accepted.
pub(super) const LONGEST: u64 = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Type of the count, if this is a list.
    pub(super) list: Option<Kind>,
}

impl Property {
    /// Least number of bytes of this property in a record.
    pub(super) fn least(&self) -> usize {
        self.list.unwrap_or(self.kind).size()
    }
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a record, if all records have the same size.
    pub(super) fn width(&self) -> Option<usize> {
        self.properties.iter().all(|p| p.list.is_none()).then(|| self.least())
    }

    /// Least number of bytes of a record.
    pub(super) fn least(&self) -> usize {
        self.properties.iter().map(Property::least).sum()
    }
}

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    /// Elements before the vertices.
    pub(super) before: Vec<Element>,
    pub(super) vertex: Element,
    /// Offset of the first byte after the header, the number of lines before it, and of bytes after it.
    pub(super) body: u64,
    pub(super) lines: usize,
    pub(super) room: u64,
}

pub(super) fn bad(path: &Path, field: &str, place: String, mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "PLY",
        field: field.to_string(),
        place,
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

fn kind(name: &str) -> Option<Kind> {
    match name {
        "uchar" | "uint8" => Some(Kind::U8),
        "char" | "int8" => Some(Kind::I8),
        "ushort" | "uint16" => Some(Kind::U16),
        "short" | "int16" => Some(Kind::I16),
        "uint" | "uint32" => Some(Kind::U32),
        "int" | "int32" => Some(Kind::I32),
        "uint64" => Some(Kind::U64),
        "int64" => Some(Kind::I64),
        "float" | "float32" => Some(Kind::F32),
        "double" | "float64" => Some(Kind::F64),
        _ => None,
    }
}

impl Header {
    /// Reads and checks the header.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let file = open::file(path)?;
        let size = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut bytes = Vec::new();
        file.take(LONGEST).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
        let (encoding, mut elements, body) = header(path, &bytes)?;
        let at = elements.iter().position(|e| e.name == "vertex");
        let at = at.ok_or_else(|| {
            bad(path, "element", "header".into(), Mismatch::new("no vertices", "an element `vertex`"))
        })?;
        elements.truncate(at + 1);
        let vertex = elements.remove(at);
        check_names(path, &vertex)?;
        let lines = crate::io::lines::count(&bytes[..body]);
        Ok(Self {
            encoding,
            before: elements,
            vertex,
            body: body as u64,
            lines,
            room: size.saturating_sub(body as u64),
        })
    }
}

/// CloudCompare's `scalar_NAME` becomes NAME; colours get PDAL's names.
pub(super) fn column_name(property: &str) -> String {
    match property {
        "red" | "diffuse_red" => names::COLOUR[0].into(),
        "green" | "diffuse_green" => names::COLOUR[1].into(),
        "blue" | "diffuse_blue" => names::COLOUR[2].into(),
        "intensity" => names::INTENSITY.into(),
        "classification" => names::CLASSIFICATION.into(),
        other => other.strip_prefix("scalar_").unwrap_or(other).to_string(),
    }
}

fn check_names(path: &Path, vertex: &Element) -> Result<()> {
    let count =
        |name: &str| vertex.properties.iter().filter(|p| p.name.eq_ignore_ascii_case(name) && p.list.is_none()).count();
    if let Some(missing) = ["x", "y", "z"].iter().find(|a| count(a) == 0) {
        return Err(bad(path, "property", "header".into(), Mismatch::new(format!("no `{missing}`"), "x, y and z")));
    }
    let mut names = BTreeSet::new();
    for property in &vertex.properties {
        if !names.insert(column_name(&property.name)) {
            return Err(bad(
                path,
                "property",
                "header".into(),
                Mismatch::new(format!("`{}` twice", property.name), "each name once"),
            ));
        }
    }
    let axis = |name: &str, a: &str| name.eq_ignore_ascii_case(a);
    for a in ["x", "y", "z"] {
        let same: Vec<&str> = vertex.properties.iter().map(|p| &p.name[..]).filter(|name| axis(name, a)).collect();
        if same.len() > 1 {
            let found = same.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" and ");
            return Err(bad(
                path,
                "properties",
                "header".into(),
                Mismatch::new(found, format!("one `{a}`; rename the others")),
            ));
        }
    }
    Ok(())
}

fn header(path: &Path, bytes: &[u8]) -> Result<(Encoding, Vec<Element>, usize)> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut at = 0;
    for number in 1..=10_000usize {
        let Some(length) = bytes[at..].iter().take(4096).position(|&b| b == b'\n') else { break };
        let line = String::from_utf8_lossy(&bytes[at..at + length]).trim().to_string();
        at += length + 1;
        let place = || format!("line {number}");
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] if number == 1 => {}
            ["format", form, "1.0"] => encoding = Some(encoding_of(path, form, place())?),
            ["comment" | "obj_info", ..] | [] => {}
            ["element", name, count] => {
                let count = count
                    .parse()
                    .map_err(|_| bad(path, "element count", place(), Mismatch::new(count, "a whole number")))?;
                elements.push(Element { name: name.into(), count, properties: Vec::new() });
            }
            ["property", ref rest @ ..] => {
                let property = property(rest).ok_or_else(|| {
                    bad(
                        path,
                        "property",
                        place(),
                        Mismatch::new(&line, "property TYPE NAME or property list TYPE TYPE NAME"),
                    )
                })?;
                let element = elements.last_mut().ok_or_else(|| {
                    bad(path, "property", place(), Mismatch::new("no element before it", "an element first"))
                })?;
                element.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| {
                    bad(
                        path,
                        "format",
                        "header".into(),
                        Mismatch::new("none", "format ascii, binary_little_endian or binary_big_endian 1.0"),
                    )
                })?;
                return Ok((encoding, elements, at));
            }
            _ => return Err(bad(path, "header", place(), Mismatch::new(&line, "a PLY keyword"))),
        }
    }
    Err(bad(path, "header", "its end".into(), Mismatch::new("no `end_header`", "end_header")))
}

fn encoding_of(path: &Path, name: &str, place: String) -> Result<Encoding> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        other => {
            Err(bad(path, "format", place, Mismatch::new(other, "ascii, binary_little_endian or binary_big_endian")))
        }
    }
}

fn property(words: &[&str]) -> Option<Property> {
    match words {
        ["list", count, kind, name] => {
            Some(Property { name: (*name).into(), kind: self::kind(kind)?, list: Some(self::kind(count)?) })
        }
        [kind, name] => Some(Property { name: (*name).into(), kind: self::kind(kind)?, list: None }),
        _ => None,
    }
}
