//! Reading PLY.

use super::header::{Element, Encoding, Header, bad, column_name};
use crate::cloud::{Cloud, Column};
use crate::error::{Mismatch, Result};
use crate::io::lines::Lines;
use crate::io::lines::words::Words;
use crate::io::open;
use crate::io::reader::BlockReader;
use crate::io::table::number::Slot;
use crate::io::table::packed::{Layout, Packed, PackedRecords, Target};
use crate::io::{FileInfo, ReadOptions};
use crate::parallel::Monitor;
use std::path::{Path, PathBuf};

/// Number of records between two checks for cancellation.
const STEP: u64 = 4096;

/// Reads a file block by block; binary vertices that contain lists are read as a whole first.
#[derive(Debug)]
pub(in crate::io) struct Reader(Kept);

#[derive(Debug)]
enum Kept {
    Packed(Packed),
    Ascii(Box<Ascii>),
    Whole(Layout),
}

impl Reader {
    pub(in crate::io) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let header = Header::read(path)?;
        let vertices = layout(&header, options);
        let monitor = &options.monitor;
        monitor.stage("read", header.vertex.count);
        let skipped = header.before.iter().try_fold(0u64, |sum, e| {
            e.width().and_then(|w| e.count.checked_mul(w as u64)).and_then(|bytes| sum.checked_add(bytes))
        });
        Ok(Self(match (header.encoding, header.vertex.width(), skipped) {
            (Encoding::Ascii, ..) => Kept::Ascii(Box::new(Ascii::open(path, header, vertices, monitor)?)),
            (_, Some(width), Some(skipped)) => {
                let left = header.room.saturating_sub(skipped);
                check_room(path, &header.vertex, width, left)?;
                let at = header.body + skipped.min(header.room);
                let records = PackedRecords { at, count: header.vertex.count, width };
                Kept::Packed(Packed::open(path, records, vertices.layout, monitor)?)
            }
            _ => Kept::Whole(whole(path, &header, vertices, monitor)?),
        }))
    }
}

impl BlockReader for Reader {
    fn take(&mut self, points: usize) -> Result<Cloud> {
        match &mut self.0 {
            Kept::Packed(packed) => packed.take(points),
            Kept::Ascii(ascii) => ascii.take(points),
            Kept::Whole(layout) => layout.table.take(points),
        }
    }
}

/// Reads the vertices.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    Reader::open(path, options)?.take(usize::MAX)
}

/// Information from the header.
pub(in crate::io) fn inspect(path: &Path) -> Result<FileInfo> {
    let header = Header::read(path)?;
    let VertexLayout { layout, .. } = layout(&header, &ReadOptions::default());
    let mut info = FileInfo::new(path, "PLY", header.vertex.count);
    info.version = Some("1.0".into());
    info.dimensions = layout.table.columns.into_iter().map(|c| c.name).collect();
    if let Some(list) = header.vertex.properties.iter().find(|p| p.list.is_some()) {
        info.warnings.push(format!("the list `{}` of the vertices is not read", list.name));
    }
    Ok(info)
}

/// The columns of the selected properties, their offsets in a record without lists, and the destination of each
/// property.
struct VertexLayout {
    layout: Layout,
    targets: Vec<Option<Target>>,
}

fn layout(header: &Header, options: &ReadOptions) -> VertexLayout {
    let (mut layout, mut targets) = (Layout::default(), Vec::new());
    let (mut at, width) = (0, header.vertex.least().max(1));
    for property in &header.vertex.properties {
        let name = column_name(&property.name);
        let axis = ["x", "y", "z"].iter().position(|a| property.name.eq_ignore_ascii_case(a));
        let target = match axis {
            _ if property.list.is_some() => None,
            Some(a) => Some(Target::Axis(a)),
            None if options.wants(&name) => {
                layout.table.columns.push(Column::new(name, property.kind.values()));
                Some(Target::Column(layout.table.columns.len() - 1))
            }
            None => None,
        };
        let slot = Slot { kind: property.kind, at, width, big: header.encoding == Encoding::Big };
        layout.slots.extend(target.map(|target| (target, slot)));
        targets.push(target);
        at += property.least();
    }
    VertexLayout { layout, targets }
}

/// Compares the smallest possible size of an element with the remaining bytes of the file.
fn check_room(path: &Path, element: &Element, least: usize, left: u64) -> Result<()> {
    match element.count.checked_mul(least as u64) {
        Some(bytes) if bytes <= left => Ok(()),
        _ => {
            let field = if element.name == "vertex" { "number of vertices" } else { &element.name };
            let allowed = format!("at most {} in the {left} bytes after the header", left / least.max(1) as u64);
            Err(bad(path, field, "header".into(), Mismatch::new(element.count, allowed)))
        }
    }
}

/// Reads binary elements up to the vertices, including lists, number by number.
fn whole(path: &Path, header: &Header, vertices: VertexLayout, monitor: &Monitor) -> Result<Layout> {
    let VertexLayout { mut layout, targets } = vertices;
    let bytes = open::whole(path)?;
    let mut cursor = Cursor { path, bytes: &bytes, at: header.body as usize, big: header.encoding == Encoding::Big };
    for element in &header.before {
        cursor.element(element, monitor, |_, _| {})?;
    }
    cursor.element(&header.vertex, monitor, |p, (slot, number)| match targets.get(p) {
        Some(Some(Target::Axis(a))) => slot.append_f64(number, &mut layout.table.axes[*a]),
        Some(Some(Target::Column(c))) => slot.append(number, &mut layout.table.columns[*c].values),
        _ => {}
    })?;
    Ok(layout)
}

struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

impl Cursor<'_> {
    /// Passes each number outside lists to `work`, with the index of the property.
    fn element(
        &mut self,
        element: &Element,
        monitor: &Monitor,
        mut work: impl FnMut(usize, (Slot, &[u8])),
    ) -> Result<()> {
        check_room(self.path, element, element.least(), (self.bytes.len() - self.at) as u64)?;
        // Elements without properties take no bytes and are skipped at once.
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for i in 0..count {
            if i % STEP == STEP - 1 {
                monitor.check()?;
            }
            for (p, property) in element.properties.iter().enumerate() {
                let kind = property.list.unwrap_or(property.kind);
                let slot = Slot { kind, at: 0, width: kind.size(), big: self.big };
                let number = self.bytes.get(self.at..self.at + kind.size()).ok_or_else(|| {
                    let fault = Mismatch::new("the end of the file", format!("{} records", element.count));
                    bad(self.path, &element.name, format!("record {i}"), fault)
                })?;
                self.at += kind.size();
                match property.list {
                    None => work(p, (slot, number)),
                    Some(_) => self.pass_list(slot, number, property.kind.size())?,
                }
            }
        }
        Ok(())
    }

    /// Skips the items of a list.
    fn pass_list(&mut self, slot: Slot, number: &[u8], size: usize) -> Result<()> {
        let mut length = Vec::new();
        slot.append_f64(number, &mut length);
        let length = length.first().copied().unwrap_or_default();
        let most = (self.bytes.len() - self.at) / size;
        if !(0.0..=most as f64).contains(&length) {
            let place = format!("byte {}", self.at);
            return Err(bad(self.path, "list length", place, Mismatch::new(length, format!("0 to {most}"))));
        }
        self.at += length as usize * size;
        Ok(())
    }
}

/// Reads ascii vertices line by line.
#[derive(Debug)]
struct Ascii {
    path: PathBuf,
    monitor: Monitor,
    vertex: Element,
    layout: Layout,
    targets: Vec<Option<Target>>,
    lines: Lines,
    read: u64,
}

impl Ascii {
    fn open(path: &Path, header: Header, vertices: VertexLayout, monitor: &Monitor) -> Result<Self> {
        let VertexLayout { layout, targets } = vertices;
        // Each number takes at least a digit and a separator.
        check_room(path, &header.vertex, 2 * targets.len().max(1), header.room + 1)?;
        let mut lines = Lines::open(path, "PLY", header.body, header.lines)?;
        let before = header.before.iter().fold(0u64, |sum, e| sum.saturating_add(e.count));
        for i in 0..before {
            if i % STEP == STEP - 1 {
                monitor.check()?;
            }
            if lines.next()?.is_none() {
                break;
            }
        }
        let (path, monitor) = (path.to_path_buf(), monitor.clone());
        Ok(Self { path, monitor, vertex: header.vertex, layout, targets, lines, read: 0 })
    }

    fn take(&mut self, points: usize) -> Result<Cloud> {
        let wanted = points.min(usize::try_from(self.vertex.count - self.read).unwrap_or(usize::MAX));
        self.layout.table.reserve(wanted)?;
        for _ in 0..wanted {
            if self.read % STEP == STEP - 1 {
                self.monitor.check()?;
                self.monitor.advance(STEP);
            }
            let Some((number, line)) = self.lines.next()? else {
                let fault = Mismatch::new("the end of the file", format!("{} vertices", self.vertex.count));
                return Err(bad(&self.path, "vertex", format!("{}", self.read), fault));
            };
            row(&self.vertex, &self.targets, line, &mut self.layout)
                .map_err(|(field, at, fault)| bad(&self.path, field, format!("line {number}:{at}"), fault))?;
            self.read += 1;
        }
        self.layout.table.take(usize::MAX)
    }
}

/// Property, position in the line, and what is wrong there.
type Fault<'a> = (&'a str, usize, Mismatch);

/// Reads the numbers of a line.
fn row<'a>(
    vertex: &'a Element,
    targets: &[Option<Target>],
    line: &[u8],
    layout: &mut Layout,
) -> std::result::Result<(), Fault<'a>> {
    let mut words = Words::new(line);
    let table = &mut layout.table;
    for (property, target) in vertex.properties.iter().zip(targets) {
        let short = || (&property.name[..], line.len() + 1, Mismatch::new("the end of the line", "a number"));
        let word = words.next().ok_or_else(short)?;
        let wrong = || (&property.name[..], word.at, Mismatch::new(word.string(), "a number of the property's type"));
        let value = word.value.ok_or_else(wrong)?;
        match target {
            _ if property.list.is_some() => {
                for _ in 0..value as u64 {
                    words.next().ok_or_else(short)?;
                }
            }
            Some(Target::Axis(a)) => table.axes[*a].push(value),
            Some(Target::Column(c)) if !word.push(&mut table.columns[*c].values) => return Err(wrong()),
            _ => {}
        }
    }
    match words.next() {
        None => Ok(()),
        Some(word) => {
            Err(("vertex", word.at, Mismatch::new(word.string(), format!("{} values", vertex.properties.len()))))
        }
    }
}
