//! PLY: ascii and binary of both byte orders; any property types in any order; lists and other elements are skipped.

mod write;

pub(super) use write::write;

use super::ReadOptions;
use crate::cloud::{Cloud, Column, Coordinates, Values, names};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
    F64,
}

#[derive(Clone, Debug)]
struct Property {
    name: String,
    kind: Kind,
    /// Type of the count, if this is a list.
    list: Option<Kind>,
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// First byte after the header.
    body: usize,
}

/// The file that is read: makes errors about it and counts what is done.
struct Source<'a> {
    path: &'a Path,
    monitor: &'a Monitor,
}

impl Source<'_> {
    /// Called for every record: looks at the monitor now and then.
    fn pass(&self, i: u64) -> Result<()> {
        const STEP: u64 = 65_536;
        if i % STEP == STEP - 1 {
            self.monitor.advance(STEP);
            self.monitor.check()?;
        }
        Ok(())
    }

    fn bad(&self, field: &str, place: String, (found, allowed): (impl ToString, impl ToString)) -> Error {
        Error::Malformed {
            path: self.path.to_path_buf(),
            format: "PLY",
            field: field.to_string(),
            place,
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

impl Kind {
    fn parse(name: &str) -> Option<Self> {
        match name {
            "uchar" | "uint8" => Some(Self::U8),
            "char" | "int8" => Some(Self::I8),
            "ushort" | "uint16" => Some(Self::U16),
            "short" | "int16" => Some(Self::I16),
            "uint" | "uint32" => Some(Self::U32),
            "int" | "int32" => Some(Self::I32),
            "float" | "float32" => Some(Self::F32),
            "double" | "float64" => Some(Self::F64),
            _ => None,
        }
    }

    fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn number(self, bytes: &[u8], big: bool) -> f64 {
        let mut b = [0u8; 8];
        let n = self.size().min(bytes.len());
        b[..n].copy_from_slice(&bytes[..n]);
        if big {
            b[..n].reverse();
        }
        match self {
            Self::U8 => f64::from(b[0]),
            Self::I8 => f64::from(b[0] as i8),
            Self::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            Self::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            Self::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Self::I32 => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Self::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Self::F64 => f64::from_le_bytes(b),
        }
    }

    fn values(self, numbers: Vec<f64>) -> Values {
        match self {
            Self::U8 => Values::U8(numbers.into_iter().map(|v| v as u8).collect()),
            Self::I8 => Values::I8(numbers.into_iter().map(|v| v as i8).collect()),
            Self::U16 => Values::U16(numbers.into_iter().map(|v| v as u16).collect()),
            Self::I16 => Values::I16(numbers.into_iter().map(|v| v as i16).collect()),
            Self::U32 => Values::U32(numbers.into_iter().map(|v| v as u32).collect()),
            Self::I32 => Values::I32(numbers.into_iter().map(|v| v as i32).collect()),
            Self::F32 => Values::F32(numbers.into_iter().map(|v| v as f32).collect()),
            Self::F64 => Values::F64(numbers),
        }
    }
}

/// Reads the vertices.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let source = Source { path, monitor: &options.monitor };
    let header = header(&source, &bytes)?;
    let at = header.elements.iter().position(|e| e.name == "vertex");
    let at = at.ok_or_else(|| source.bad("element", "header".into(), ("no vertices", "an element `vertex`")))?;
    let vertex = &header.elements[at];
    check_names(&source, vertex)?;
    let kept: Vec<usize> = (0..vertex.properties.len())
        .filter(|&p| {
            vertex.properties[p].list.is_none()
                && (axis(vertex, p).is_some() || options.wants(&column_name(&vertex.properties[p].name)))
        })
        .collect();
    options.monitor.stage("read", vertex.count);
    let columns = match header.encoding {
        Encoding::Ascii => ascii(&source, &bytes, &header, (at, &kept))?,
        _ => binary(&source, &bytes, &header, (at, &kept))?,
    };
    assemble(vertex, &kept, columns)
}

fn axis(vertex: &Element, p: usize) -> Option<usize> {
    ["x", "y", "z"].iter().position(|a| *a == vertex.properties[p].name.to_ascii_lowercase())
}

fn assemble(vertex: &Element, kept: &[usize], columns: Vec<Vec<f64>>) -> Result<Cloud> {
    let mut axes: [Vec<f64>; 3] = Default::default();
    let mut rest = Vec::new();
    for (&p, numbers) in kept.iter().zip(columns) {
        match axis(vertex, p) {
            Some(a) => axes[a] = numbers,
            None => rest
                .push(Column::new(column_name(&vertex.properties[p].name), vertex.properties[p].kind.values(numbers))),
        }
    }
    let mut cloud = Cloud::new(Coordinates::Float(axes))?;
    rest.into_iter().try_for_each(|column| cloud.set_column(column))?;
    Ok(cloud)
}

/// CloudCompare's `scalar_NAME` is NAME; colours get PDAL's names.
fn column_name(property: &str) -> String {
    match property {
        "red" | "diffuse_red" => names::COLOUR[0].into(),
        "green" | "diffuse_green" => names::COLOUR[1].into(),
        "blue" | "diffuse_blue" => names::COLOUR[2].into(),
        "intensity" => names::INTENSITY.into(),
        "classification" => names::CLASSIFICATION.into(),
        other => other.strip_prefix("scalar_").unwrap_or(other).to_string(),
    }
}

fn check_names(source: &Source<'_>, vertex: &Element) -> Result<()> {
    let count =
        |name: &str| vertex.properties.iter().filter(|p| p.name.eq_ignore_ascii_case(name) && p.list.is_none()).count();
    if let Some(missing) = ["x", "y", "z"].iter().find(|a| count(a) == 0) {
        return Err(source.bad("property", "header".into(), (format!("no `{missing}`"), "x, y and z")));
    }
    for property in &vertex.properties {
        let same = vertex.properties.iter().filter(|p| column_name(&p.name) == column_name(&property.name)).count();
        if same > 1 {
            return Err(source.bad(
                "property",
                "header".into(),
                (format!("`{}` twice", property.name), "each name once"),
            ));
        }
    }
    Ok(())
}

fn header(source: &Source<'_>, bytes: &[u8]) -> Result<Header> {
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
            ["format", form, "1.0"] => encoding = Some(encoding_of(source, form, place())?),
            ["comment" | "obj_info", ..] | [] => {}
            ["element", name, count] => {
                let count =
                    count.parse().map_err(|_| source.bad("element count", place(), (count, "a whole number")))?;
                elements.push(Element { name: name.into(), count, properties: Vec::new() });
            }
            ["property", ref rest @ ..] => {
                let property = property(rest).ok_or_else(|| {
                    source.bad("property", place(), (&line, "property TYPE NAME or property list TYPE TYPE NAME"))
                })?;
                let element = elements
                    .last_mut()
                    .ok_or_else(|| source.bad("property", place(), ("no element before it", "an element first")))?;
                element.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| {
                    source.bad(
                        "format",
                        "header".into(),
                        ("none", "format ascii, binary_little_endian or binary_big_endian 1.0"),
                    )
                })?;
                return Ok(Header { encoding, elements, body: at });
            }
            _ => return Err(source.bad("header", place(), (&line, "a PLY keyword"))),
        }
    }
    Err(source.bad("header", "its end".into(), ("no `end_header`", "end_header")))
}

fn encoding_of(source: &Source<'_>, name: &str, place: String) -> Result<Encoding> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        other => Err(source.bad("format", place, (other, "ascii, binary_little_endian or binary_big_endian"))),
    }
}

fn property(words: &[&str]) -> Option<Property> {
    match words {
        ["list", count, kind, name] => {
            Some(Property { name: (*name).into(), kind: Kind::parse(kind)?, list: Some(Kind::parse(count)?) })
        }
        [kind, name] => Some(Property { name: (*name).into(), kind: Kind::parse(kind)?, list: None }),
        _ => None,
    }
}

/// Room for the vertices, after their smallest possible size was compared with what is left of the file.
fn room(source: &Source<'_>, element: &Element, least: usize, left: usize, kept: usize) -> Result<Vec<Vec<f64>>> {
    let needed = element.count.checked_mul(least as u64);
    if needed.is_none_or(|n| n > left as u64 + 1) {
        let most = left / least.max(1);
        return Err(source.bad(
            "number of vertices",
            "header".into(),
            (element.count, format!("at most {most} in the {left} bytes after the header")),
        ));
    }
    Ok((0..kept).map(|_| Vec::with_capacity(element.count as usize)).collect())
}

fn binary(
    source: &Source<'_>,
    bytes: &[u8],
    header: &Header,
    (vertex, kept): (usize, &[usize]),
) -> Result<Vec<Vec<f64>>> {
    let big = header.encoding == Encoding::Big;
    let mut at = header.body;
    for (e, element) in header.elements.iter().enumerate().take(vertex + 1) {
        let least: usize = element.properties.iter().map(|p| p.list.unwrap_or(p.kind).size()).sum();
        let mut columns = room(source, element, least, bytes.len() - at, if e == vertex { kept.len() } else { 0 })?;
        if least == 0 {
            continue;
        }
        for i in 0..element.count {
            source.pass(i)?;
            let mut column = 0;
            for (p, property) in element.properties.iter().enumerate() {
                let kind = property.list.unwrap_or(property.kind);
                let short = || {
                    source.bad(
                        &element.name,
                        format!("{i}"),
                        ("the end of the file", format!("{} records", element.count)),
                    )
                };
                let slot = bytes.get(at..at + kind.size()).ok_or_else(short)?;
                let number = kind.number(slot, big);
                at += kind.size();
                if property.list.is_some() {
                    let items = if number >= 0.0 { number as usize } else { usize::MAX };
                    let skip = items.checked_mul(property.kind.size()).filter(|s| *s <= bytes.len() - at);
                    let allowed = format!("0 to {}", (bytes.len() - at) / property.kind.size());
                    at += skip.ok_or_else(|| source.bad("list length", format!("byte {at}"), (number, allowed)))?;
                } else if e == vertex && kept.get(column) == Some(&p) {
                    columns[column].push(number);
                    column += 1;
                }
            }
        }
        if e == vertex {
            return Ok(columns);
        }
    }
    Ok(vec![Vec::new(); kept.len()])
}

fn ascii(
    source: &Source<'_>,
    bytes: &[u8],
    header: &Header,
    (vertex, kept): (usize, &[usize]),
) -> Result<Vec<Vec<f64>>> {
    let first = bytes[..header.body].iter().filter(|&&b| b == b'\n').count() + 1;
    let mut lines = bytes[header.body..].split(|&b| b == b'\n').zip(first..);
    let before: u64 = header.elements[..vertex].iter().map(|e| e.count).fold(0, u64::saturating_add);
    let element = &header.elements[vertex];
    let mut columns =
        room(source, element, 2 * element.properties.len().max(1), bytes.len() - header.body, kept.len())?;
    let mut skipped = 0;
    let mut read = 0;
    while read < element.count {
        let (line, number) = lines.next().ok_or_else(|| {
            source.bad("vertex", format!("{read}"), ("the end of the file", format!("{} vertices", element.count)))
        })?;
        let line = String::from_utf8_lossy(line);
        if line.trim().is_empty() {
            continue;
        }
        if skipped < before {
            skipped += 1;
            continue;
        }
        vertex_line(source, element, (&line, number), kept, &mut columns)?;
        source.pass(read)?;
        read += 1;
    }
    Ok(columns)
}

fn vertex_line(
    source: &Source<'_>,
    element: &Element,
    (line, number): (&str, usize),
    kept: &[usize],
    columns: &mut [Vec<f64>],
) -> Result<()> {
    let mut words = line.split_ascii_whitespace();
    let mut column = 0;
    for (p, property) in element.properties.iter().enumerate() {
        let short = || source.bad(&property.name, format!("line {number}"), ("the end of the line", "a number"));
        let word = words.next().ok_or_else(short)?;
        let value: f64 =
            word.parse().map_err(|_| source.bad(&property.name, format!("line {number}"), (word, "a number")))?;
        if property.list.is_some() {
            for _ in 0..value as u64 {
                words.next().ok_or_else(short)?;
            }
        } else if kept.get(column) == Some(&p) {
            columns[column].push(value);
            column += 1;
        }
    }
    match words.next() {
        Some(extra) => {
            Err(source.bad("vertex", format!("line {number}"), (extra, format!("{} values", element.properties.len()))))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io;

    fn read_bytes(bytes: &[u8]) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        std::fs::write(&path, bytes).unwrap();
        io::read(&path)
    }

    #[test]
    fn ascii_and_both_binary_orders_give_the_same_cloud() {
        let head = |f: &str| {
            format!(
                "ply\r\nformat {f} 1.0\r\ncomment c\r\nelement vertex 2\r\nproperty list uchar int n\r\nproperty float x\r\nproperty double y\r\nproperty short z\r\nproperty uchar red\r\nproperty int scalar_Classification\r\nelement face 1\r\nproperty list uchar int v\r\nend_header\r\n"
            )
        };
        let ascii =
            read_bytes((head("ascii") + "2 7 8 1.5 2.25 -3 200 6\r\n0 4 5 6 1 2\r\n3 0 1 1\r\n").as_bytes()).unwrap();
        let body = |big: bool| {
            let mut b = Vec::new();
            let put = |b: &mut Vec<u8>, le: &[u8]| if big { b.extend(le.iter().rev()) } else { b.extend(le) };
            for (list, x, y, z, red, class) in
                [(&[7i32, 8][..], 1.5f32, 2.25f64, -3i16, 200u8, 6i32), (&[], 4.0, 5.0, 6, 1, 2)]
            {
                b.push(list.len() as u8);
                list.iter().for_each(|v| put(&mut b, &v.to_le_bytes()));
                put(&mut b, &x.to_le_bytes());
                put(&mut b, &y.to_le_bytes());
                put(&mut b, &z.to_le_bytes());
                b.push(red);
                put(&mut b, &class.to_le_bytes());
            }
            b
        };
        let little = read_bytes(&[head("binary_little_endian").as_bytes(), &body(false)].concat()).unwrap();
        let big = read_bytes(&[head("binary_big_endian").as_bytes(), &body(true)].concat()).unwrap();
        assert_eq!(ascii, little);
        assert_eq!(ascii, big);
        assert_eq!(ascii.xyz(0), [1.5, 2.25, -3.0]);
        assert_eq!(ascii.column("Classification").unwrap().values, Values::I32(vec![6, 2]));
    }

    #[test]
    fn malformed_files_are_errors_that_name_the_place() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        let cases = [
            (head.replace("vertex 2", "vertex 99999999999999"), "number of vertices"),
            (head.to_string() + "1 2 3\n", "at most 1"),
            (head.to_string() + "1.5 2.5 3.5\n1 2\n", "line 9"),
            (head.to_string() + "1.5 2.5 3.5\n1 2 q\n", "line 9"),
            (head.replace("property float z\n", ""), "no `z`"),
            (head.replace("float z\n", "float z\nproperty float x\n"), "twice"),
            ("ply\nformat ascii 1.0\n".into(), "end_header"),
        ];
        for (text, expected) in cases {
            let message = read_bytes(text.as_bytes()).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}\nfor\n{text}");
        }
        let negative = [b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty list char int v\nproperty float x\nproperty float y\nproperty float z\nend_header\n".as_slice(), &[0xff; 40]].concat();
        assert!(read_bytes(&negative).unwrap_err().to_string().contains("list length"));
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let mut cloud = Cloud::from_rows(&[[652_000.123, 6e6, 1.0], [652_001.0, 6e6 + 0.5, f64::NAN]]).unwrap();
        cloud.set_column(Column::new("Red", Values::U8(vec![1, 255]))).unwrap();
        cloud.set_column(Column::new("Confidence", Values::F32(vec![0.5, 0.25]))).unwrap();
        write(&path, &cloud).unwrap();
        let back = io::read(&path).unwrap();
        assert_eq!(back.columns(), cloud.columns());
        assert_eq!(back.xyz(0), cloud.xyz(0));
        assert!(back.xyz(1)[2].is_nan());
        write(&path, &Cloud::from_rows(&[]).unwrap()).unwrap();
        assert!(io::read(&path).unwrap().is_empty());
    }
}
