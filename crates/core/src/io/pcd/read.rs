//! Reading PCD.

use super::header::{AT_ORIGIN, Encoding, Field, Header, bad};
use super::lzf;
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::{Error, Mismatch, Result};
use crate::io::lines::Lines;
use crate::io::lines::words::Words;
use crate::io::open;
use crate::io::reader::BlockReader;
use crate::io::table::number::{Kind, Slot};
use crate::io::table::packed::{Layout, Packed, PackedRecords, Target};
use crate::io::table::{known, limits};
use crate::io::{FileInfo, ReadOptions};
use crate::memory;
use crate::parallel::Monitor;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// The use of a number of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// Stored in an axis or a column.
    To(Target),
    /// Four bytes of blue, green, red and alpha, stored in the columns from this one on.
    Colour { first: usize, alpha: bool },
    /// Skipped.
    Skipped,
}

/// Reads a file block by block; the compressed kind is unpacked as a whole first.
#[derive(Debug)]
pub(in crate::io) struct Reader(Kept);

#[derive(Debug)]
enum Kept {
    Binary(Packed),
    Ascii(Box<Ascii>),
    Whole(Layout),
}

impl Reader {
    pub(in crate::io) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let header = Header::read(path)?;
        let fields = layout(path, &header, options)?;
        options.monitor.stage("read", header.points);
        Ok(Self(match header.encoding {
            Encoding::Binary => {
                let width = header.width();
                check_room(path, &header, width)?;
                let layout = slots(fields.layout, &header.fields, &fields.parts);
                Kept::Binary(Packed::open(
                    path,
                    PackedRecords { at: header.body, count: header.points, width },
                    layout,
                    &options.monitor,
                )?)
            }
            Encoding::Ascii => Kept::Ascii(Box::new(Ascii::open(path, &header, fields, &options.monitor)?)),
            Encoding::Compressed => Kept::Whole(compressed(path, &header, fields)?),
        }))
    }
}

impl BlockReader for Reader {
    fn take(&mut self, points: usize) -> Result<Cloud> {
        match &mut self.0 {
            Kept::Binary(packed) => packed.take(points),
            Kept::Ascii(ascii) => ascii.take(points),
            Kept::Whole(layout) => layout.table.take(points),
        }
    }
}

/// Reads all points.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    Reader::open(path, options)?.take(usize::MAX)
}

/// Information from the header.
pub(in crate::io) fn inspect(path: &Path) -> Result<FileInfo> {
    let header = Header::read(path)?;
    let FieldLayout { layout, .. } = layout(path, &header, &ReadOptions::default())?;
    let mut info = FileInfo::new(path, "PCD", header.points);
    info.version = Some(header.version);
    info.dimensions = layout.table.columns.into_iter().map(|c| c.name).collect();
    if header.height > 1 {
        info.warnings.push(format!("an organised cloud of {} rows; the rows are not kept", header.height));
    }
    if header.viewpoint.iter().zip(AT_ORIGIN).any(|(a, b)| a.to_bits() != b.to_bits()) {
        info.warnings.push(format!("a sensor pose that is not applied: VIEWPOINT {:?}", header.viewpoint));
    }
    Ok(info)
}

/// The columns of the selected fields, and the use of each number of a point.
struct FieldLayout {
    layout: Layout,
    parts: Vec<Part>,
}

fn layout(path: &Path, header: &Header, options: &ReadOptions) -> Result<FieldLayout> {
    let (mut layout, mut parts, mut axes) = (Layout::default(), Vec::new(), [false; 3]);
    for field in &header.fields {
        let axis = ["x", "y", "z"].iter().position(|a| field.name.eq_ignore_ascii_case(a));
        let part = match axis {
            Some(a) if field.count == 1 && !axes[a] => {
                axes[a] = true;
                Part::To(Target::Axis(a))
            }
            _ if field.padding() => Part::Skipped,
            _ => {
                columns(field, &mut layout, &mut parts, options);
                continue;
            }
        };
        parts.resize(parts.len() + field.count, part);
    }
    match axes.iter().position(|found| !found) {
        None => Ok(FieldLayout { layout, parts }),
        Some(a) => {
            let found = header.fields.iter().map(|f| &f.name[..]).collect::<Vec<_>>().join(" ");
            Err(bad(
                path,
                "FIELDS",
                "header".into(),
                Mismatch::new(found, format!("x, y and z; there is no {}", ["x", "y", "z"][a])),
            ))
        }
    }
}

/// Adds the columns of a field and the use of its numbers.
fn columns(field: &Field, layout: &mut Layout, parts: &mut Vec<Part>, options: &ReadOptions) {
    let table = &mut layout.table.columns;
    let alpha = field.name.eq_ignore_ascii_case("rgba");
    if field.width() == 4 && field.count == 1 && (alpha || field.name.eq_ignore_ascii_case("rgb")) {
        let wanted = names::COLOUR.into_iter().chain(alpha.then_some("Alpha"));
        if wanted.clone().any(|name| options.wants(name)) {
            parts.push(Part::Colour { first: table.len(), alpha });
            table.extend(wanted.map(|name| Column::new(name, Values::U8(Vec::new()))));
        } else {
            parts.push(Part::Skipped);
        }
        return;
    }
    for c in 0..field.count {
        let name = if field.count == 1 { known::name(&field.name) } else { format!("{}_{c}", field.name) };
        if options.wants(&name) {
            parts.push(Part::To(Target::Column(table.len())));
            table.push(Column::new(name, field.kind.values()));
        } else {
            parts.push(Part::Skipped);
        }
    }
}

/// The offsets of the numbers in a binary record.
fn slots(mut layout: Layout, fields: &[Field], parts: &[Part]) -> Layout {
    let width = fields.iter().map(Field::width).sum();
    let mut parts = parts.iter();
    let mut at = 0;
    for field in fields {
        for part in parts.by_ref().take(field.count) {
            add_slots(&mut layout, part, Slot { kind: field.kind, at, width, big: false });
            at += field.kind.size();
        }
    }
    layout
}

fn add_slots(layout: &mut Layout, part: &Part, slot: Slot) {
    match *part {
        Part::To(target) => layout.slots.push((target, slot)),
        Part::Colour { first, alpha } => {
            let bytes = [2, 1, 0, 3].into_iter().take(if alpha { 4 } else { 3 });
            let slot = |byte| Slot { kind: Kind::U8, at: slot.at + byte, ..slot };
            layout.slots.extend((first..).zip(bytes).map(|(c, byte)| (Target::Column(c), slot(byte))));
        }
        Part::Skipped => {}
    }
}

fn check_room(path: &Path, header: &Header, least: usize) -> Result<()> {
    match header.points.checked_mul(least as u64) {
        Some(bytes) if bytes <= header.room => Ok(()),
        _ => {
            let most = header.room / least.max(1) as u64;
            let allowed = format!("at most {most} in the {} bytes after the header", header.room);
            Err(bad(path, "POINTS", "header".into(), Mismatch::new(header.points, allowed)))
        }
    }
}

/// Unpacks all columns. Padding is not stored in files written by the library itself, but is in others.
fn compressed(path: &Path, header: &Header, fields: FieldLayout) -> Result<Layout> {
    let FieldLayout { mut layout, parts } = fields;
    if header.points == 0 {
        return Ok(layout);
    }
    let (packed, size) = packed_bytes(path, header)?;
    let place = || format!("byte {}", header.body + 4);
    let whole = header.points.checked_mul(header.width() as u64);
    let dense: usize = header.fields.iter().filter(|f| !f.padding()).map(Field::width).sum();
    let padded = match Some(size) {
        s if s == header.points.checked_mul(dense as u64) => false,
        s if s == whole => true,
        _ => {
            let allowed = format!("{} points of {dense} bytes", header.points);
            return Err(bad(path, "uncompressed size", place(), Mismatch::new(size, allowed)));
        }
    };
    if size > packed.len() as u64 * lzf::MOST_RATIO {
        let allowed = format!("at most {} from {} bytes", packed.len() as u64 * lzf::MOST_RATIO, packed.len());
        return Err(bad(path, "uncompressed size", place(), Mismatch::new(size, allowed)));
    }
    let failed = |at| {
        bad(
            path,
            "compressed points",
            format!("byte {}", header.body + 8 + at as u64),
            Mismatch::new("a wrong code", "LZF"),
        )
    };
    let width: u64 = layout.table.columns.iter().map(|c| Kind::of(&c.values).size() as u64).sum();
    let table = header.points.saturating_mul(24 + width);
    limits::unpacked(path, "PCD", header.body + header.room, size.saturating_add(table))?;
    let mut bytes = Vec::new();
    memory::reserve(&mut bytes, size as usize, "the unpacked points")?;
    let bytes = lzf::unpack(&packed, size as usize, bytes).map_err(failed)?;
    layout.table.reserve(header.points as usize)?;
    let (mut rest, mut parts) = (&bytes[..], parts.iter());
    for field in &header.fields {
        let room = if field.padding() && !padded { 0 } else { field.width() * header.points as usize };
        let (block, behind) = rest.split_at(room.min(rest.len()));
        rest = behind;
        let mut one = Layout::default();
        for (c, part) in parts.by_ref().take(field.count).enumerate() {
            let slot = Slot { kind: field.kind, at: c * field.kind.size(), width: field.width(), big: false };
            add_slots(&mut one, part, slot);
        }
        std::mem::swap(&mut one.table, &mut layout.table);
        one.append(block);
        std::mem::swap(&mut one.table, &mut layout.table);
    }
    Ok(layout)
}

/// The compressed bytes and the size that they unpack to.
fn packed_bytes(path: &Path, header: &Header) -> Result<(Vec<u8>, u64)> {
    let mut file = open::file(path)?;
    let mut sizes = [0; 8];
    let start = file.seek(SeekFrom::Start(header.body)).and_then(|_| file.read_exact(&mut sizes));
    start.map_err(|_| {
        bad(path, "compressed size", format!("byte {}", header.body), Mismatch::new("the end of the file", "8 bytes"))
    })?;
    let [packed, size] = [0, 4].map(|at| u64::from(u32::from_le_bytes(crate::io::table::number::array(&sizes, at))));
    if packed > header.room - 8 {
        let place = format!("byte {}", header.body);
        return Err(bad(path, "compressed size", place, Mismatch::new(packed, format!("at most {}", header.room - 8))));
    }
    let mut bytes = Vec::new();
    file.take(packed).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    Ok((bytes, size))
}

/// Reads ascii points line by line.
#[derive(Debug)]
struct Ascii {
    path: PathBuf,
    monitor: Monitor,
    points: u64,
    layout: Layout,
    parts: Vec<Part>,
    lines: Lines,
    read: u64,
}

impl Ascii {
    fn open(path: &Path, header: &Header, fields: FieldLayout, monitor: &Monitor) -> Result<Self> {
        let FieldLayout { layout, parts } = fields;
        // Each number takes at least a digit and a separator.
        check_room(path, &Header { room: header.room + 1, ..header.clone() }, 2 * parts.len().max(1))?;
        let lines = Lines::open(path, "PCD", header.body, header.lines)?;
        let (path, monitor) = (path.to_path_buf(), monitor.clone());
        Ok(Self { path, monitor, points: header.points, layout, parts, lines, read: 0 })
    }

    fn take(&mut self, points: usize) -> Result<Cloud> {
        let wanted = points.min(usize::try_from(self.points - self.read).unwrap_or(usize::MAX));
        self.layout.table.reserve(wanted)?;
        for i in 0..wanted {
            if i % 4096 == 4095 {
                self.monitor.check()?;
                self.monitor.advance(4096);
            }
            let Some((number, line)) = self.lines.next()? else {
                let allowed = format!("{} points", self.points);
                return Err(bad(
                    &self.path,
                    "points",
                    format!("point {}", self.read),
                    Mismatch::new("the end of the file", allowed),
                ));
            };
            row(&self.parts, line, &mut self.layout)
                .map_err(|(field, at, fault)| bad(&self.path, field, format!("line {number}:{at}"), fault))?;
            self.read += 1;
        }
        self.layout.table.take(usize::MAX)
    }
}

/// Field, position in the line, and what is wrong there.
type Fault = (&'static str, usize, Mismatch);

/// Reads the numbers of a line.
fn row(parts: &[Part], line: &[u8], layout: &mut Layout) -> std::result::Result<(), Fault> {
    let mut words = Words::new(line);
    let table = &mut layout.table;
    for (i, part) in parts.iter().enumerate() {
        let short = || ("values", line.len() + 1, Mismatch::new(i, format!("{} a point", parts.len())));
        let word = words.next().ok_or_else(short)?;
        let wrong = || ("value", word.at, Mismatch::new(word.string(), "a number that fits the field"));
        let value = word.value.ok_or_else(wrong)?;
        match *part {
            Part::To(Target::Axis(a)) => table.axes[a].push(value),
            Part::To(Target::Column(c)) if !word.push(&mut table.columns[c].values) => return Err(wrong()),
            Part::Colour { first, alpha } => {
                let bytes = colour_bytes(word.text, value);
                for (c, byte) in (first..).zip([2, 1, 0, 3].into_iter().take(if alpha { 4 } else { 3 })) {
                    if let Values::U8(v) = &mut table.columns[c].values {
                        v.push(bytes[byte]);
                    }
                }
            }
            _ => {}
        }
    }
    match words.next() {
        None => Ok(()),
        Some(word) => Err(("values", word.at, Mismatch::new(word.string(), format!("{} a point", parts.len())))),
    }
}

/// Blue, green, red and alpha: an integer is the four bytes themselves, other numbers are floats with these bytes.
fn colour_bytes(text: &[u8], value: f64) -> [u8; 4] {
    let whole = text.iter().all(|b| b.is_ascii_digit() || *b == b'-');
    match whole {
        true => (value as i64 as u32).to_le_bytes(),
        false => (value as f32).to_le_bytes(),
    }
}
