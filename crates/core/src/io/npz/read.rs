//! Reading npz.

use super::npy::{Element, LONGEST, Npy, half};
use super::zip::{Archive, Entry, bad};
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::{Mismatch, Result};
use crate::io::table::Table;
use crate::io::table::number::{Kind, Slot, array};
use crate::io::table::{known, limits};
use crate::io::{FileInfo, ReadOptions};
use crate::memory;
use std::path::Path;

/// An array of the archive.
struct Array {
    name: String,
    entry: Entry,
    npy: Npy,
}

impl Array {
    fn is(&self, names: &[&str]) -> bool {
        names.contains(&&self.name.to_ascii_lowercase()[..])
    }

    /// Bytes of its numbers in memory; 16-bit numbers become 32-bit ones.
    fn unpacked(&self) -> u64 {
        match self.npy.element {
            Element::Half { .. } => self.entry.size.saturating_mul(2),
            _ => self.entry.size,
        }
    }

    /// Whether it contains text.
    fn text(&self) -> bool {
        matches!(self.npy.element, Element::Text { .. })
    }
}

/// The role of each array in the cloud.
struct ArrayRoles {
    points: u64,
    /// One array (n, 3), or three (n).
    axes: Vec<Array>,
    columns: Vec<Array>,
    about: Vec<Array>,
    left_out: Vec<String>,
}

impl ArrayRoles {
    /// Bytes of the cloud with the selected columns, and those of the largest array, which exists beside it while its
    /// numbers are converted.
    fn bytes(&self, options: &ReadOptions) -> (u64, u64) {
        let wanted = |array: &&Array| column_names(array).iter().any(|name| options.wants(name));
        let columns = self.columns.iter().filter(wanted);
        let largest = self.axes.iter().chain(columns.clone()).map(Array::unpacked).max().unwrap_or(0);
        let columns = columns.fold(0, |sum: u64, array| sum.saturating_add(array.unpacked()));
        (self.points.saturating_mul(24).saturating_add(columns), largest)
    }
}

const XYZ: [&str; 5] = ["xyz", "points", "coordinates", "coords", "pos"];
const COLOURS: [&str; 4] = ["rgb", "color", "colors", "colours"];
const ABOUT: [&str; 2] = ["crs", "metres_per_unit"];
/// Largest number of columns of one array.
const MOST_COLUMNS: u64 = 4096;

/// Reads the cloud of an archive.
pub(in crate::io) fn read(path: &Path, options: &ReadOptions) -> Result<Cloud> {
    let (mut archive, plan) = plan(path)?;
    let (cloud, largest) = plan.bytes(options);
    limits::unpacked(path, "npz", archive.length, cloud)?;
    memory::require(cloud.saturating_add(largest), &format!("the points of {}", path.display()))?;
    options.monitor.stage("read", plan.points);
    let mut table = Table::default();
    match &plan.axes[..] {
        [xyz] => {
            let content = numbers(path, &mut archive, xyz)?;
            for (a, axis) in table.axes.iter_mut().enumerate() {
                content.append_f64(a, axis);
            }
        }
        axes => {
            for (array, axis) in axes.iter().zip(&mut table.axes) {
                numbers(path, &mut archive, array)?.append_f64(0, axis);
            }
        }
    }
    for array in &plan.columns {
        options.monitor.check()?;
        let names = column_names(array);
        if names.iter().any(|name| options.wants(name)) {
            let content = numbers(path, &mut archive, array)?;
            for (c, name) in names.into_iter().enumerate().filter(|(_, name)| options.wants(name)) {
                table.columns.push(Column::new(name, content.values(c)));
            }
        }
    }
    let mut cloud = table.cloud()?;
    for array in &plan.about {
        about(path, &mut archive, array, &mut cloud)?;
    }
    Ok(cloud)
}

/// Information from the headers of the arrays.
pub(in crate::io) fn inspect(path: &Path) -> Result<FileInfo> {
    let (mut archive, plan) = plan(path)?;
    let mut info = FileInfo::new(path, "npz", plan.points);
    info.dimensions = plan.columns.iter().flat_map(column_names).collect();
    let mut cloud = Cloud::from_rows(&[])?;
    for array in &plan.about {
        about(path, &mut archive, array, &mut cloud)?;
    }
    (info.crs, info.metres_per_unit) = (cloud.crs, cloud.metres_per_unit);
    if !plan.left_out.is_empty() {
        let names = plan.left_out.join(", ");
        info.warnings.push(format!("arrays without one number a point are left out: {names}"));
    }
    Ok(info)
}

fn plan(path: &Path) -> Result<(Archive, ArrayRoles)> {
    let mut archive = Archive::open(path)?;
    let (mut arrays, mut left_out) = (Vec::new(), Vec::new());
    for entry in archive.entries.clone() {
        let name = entry.name.strip_suffix(".npy").unwrap_or(&entry.name).to_string();
        match Npy::parse(&archive.start(&entry, LONGEST as u64)?) {
            Some(npy) => arrays.push(check(path, Array { name, entry, npy })?),
            None => left_out.push(name),
        }
    }
    let numbers = |array: &Array, shape: &[u64]| array.npy.shape == shape && !array.text();
    let mut axes = Vec::new();
    if let Some(at) = arrays.iter().position(|a| a.is(&XYZ) && !a.text() && matches!(a.npy.shape[..], [_, 3])) {
        axes.push(arrays.remove(at));
    } else {
        for axis in ["x", "y", "z"] {
            let Some(at) = arrays.iter().position(|a| a.is(&[axis]) && !a.text() && a.npy.shape.len() == 1) else {
                let found = arrays.iter().map(|a| format!("{} {:?}", a.name, a.npy.shape)).chain(left_out);
                let found = found.collect::<Vec<_>>().join(", ");
                return Err(bad(
                    path,
                    "arrays",
                    "archive".into(),
                    Mismatch::new(found, "`xyz` of n rows of 3, or `x`, `y`, `z`"),
                ));
            };
            axes.push(arrays.remove(at));
        }
    }
    let points = axes[0].npy.shape[0];
    if let Some(other) = axes.iter().find(|a| a.npy.shape[0] != points) {
        return Err(bad(
            path,
            &other.name,
            "shape".into(),
            Mismatch::new(format!("{:?}", other.npy.shape), format!("{points} rows")),
        ));
    }
    let (about, arrays): (Vec<_>, Vec<_>) = arrays.into_iter().partition(|a| a.is(&ABOUT) && a.npy.shape.is_empty());
    let wide = |a: &Array| matches!(a.npy.shape[..], [n, k] if n == points && k <= MOST_COLUMNS) && !a.text();
    let (columns, others): (Vec<_>, Vec<_>) = arrays.into_iter().partition(|a| numbers(a, &[points]) || wide(a));
    left_out.extend(others.into_iter().map(|a| a.name));
    Ok((archive, ArrayRoles { points, axes, columns, about, left_out }))
}

/// Checks that the declared shape matches the size of the entry.
fn check(path: &Path, array: Array) -> Result<Array> {
    let needed = array.npy.count().and_then(|n| n.checked_mul(array.npy.element.size() as u64));
    let there = array.entry.size.saturating_sub(array.npy.body as u64);
    match needed == Some(there) {
        true => Ok(array),
        false => {
            let found = format!("{:?} of {} bytes each", array.npy.shape, array.npy.element.size());
            Err(bad(
                path,
                &array.name,
                "shape".into(),
                Mismatch::new(found, format!("{there} bytes as the archive holds")),
            ))
        }
    }
}

fn column_names(array: &Array) -> Vec<String> {
    match array.npy.shape[..] {
        [_, 3] if array.is(&COLOURS) => names::COLOUR.map(String::from).to_vec(),
        [_, k] if k != 1 => (0..k).map(|c| format!("{}_{c}", array.name)).collect(),
        _ => vec![known::name(&array.name)],
    }
}

/// The numbers of an array in memory.
struct Content {
    bytes: Vec<u8>,
    body: usize,
    kind: Kind,
    big: bool,
    columns: usize,
    rows: usize,
    fortran: bool,
}

fn numbers(path: &Path, archive: &mut Archive, array: &Array) -> Result<Content> {
    let mut bytes = archive.content(&array.entry)?;
    let (mut body, npy) = (array.npy.body, &array.npy);
    let (kind, big) = match npy.element {
        Element::Number { kind, big } => (kind, big),
        Element::Half { big } => {
            let halves = bytes.get(body..).unwrap_or_default().chunks_exact(2);
            let bits = |h: &[u8]| if big { u16::from_be_bytes(array2(h)) } else { u16::from_le_bytes(array2(h)) };
            let mut wide = Vec::new();
            memory::reserve(&mut wide, 2 * halves.len() * 2, &array.name)?;
            halves.for_each(|h| wide.extend(half(bits(h)).to_le_bytes()));
            bytes = wide;
            body = 0;
            (Kind::F32, false)
        }
        Element::Text { .. } => return Err(bad(path, &array.name, "type".into(), Mismatch::new("text", "numbers"))),
    };
    let columns = npy.shape.get(1).map_or(1, |&k| k as usize);
    let rows = npy.shape.first().map_or(1, |&n| n as usize);
    Ok(Content { bytes, body, kind, big, columns, rows, fortran: npy.fortran })
}

fn array2(bytes: &[u8]) -> [u8; 2] {
    array(bytes, 0)
}

impl Content {
    /// The bytes that contain column `c`, and its position in them.
    fn slot(&self, c: usize) -> (&[u8], Slot) {
        let size = self.kind.size();
        let body = self.bytes.get(self.body..).unwrap_or_default();
        match self.fortran {
            true => {
                let column = body.get(c * self.rows * size..(c + 1) * self.rows * size).unwrap_or_default();
                (column, Slot { kind: self.kind, at: 0, width: size, big: self.big })
            }
            false => (body, Slot { kind: self.kind, at: c * size, width: size * self.columns.max(1), big: self.big }),
        }
    }

    fn append_f64(&self, c: usize, out: &mut Vec<f64>) {
        let (bytes, slot) = self.slot(c);
        slot.append_f64(bytes, out);
    }

    fn values(&self, c: usize) -> Values {
        let (bytes, slot) = self.slot(c);
        let mut values = self.kind.values();
        slot.append(bytes, &mut values);
        values
    }
}

/// Sets CRS and unit.
fn about(path: &Path, archive: &mut Archive, array: &Array, cloud: &mut Cloud) -> Result<()> {
    if array.is(&["crs"]) {
        if let Element::Text { big, .. } = array.npy.element {
            let bytes = archive.content(&array.entry)?;
            let code = |c: &[u8]| if big { u32::from_be_bytes(array4(c)) } else { u32::from_le_bytes(array4(c)) };
            let codes = bytes.get(array.npy.body..).unwrap_or_default().chunks_exact(4).map(code);
            let text: String = codes.filter(|&c| c > 0).map(|c| char::from_u32(c).unwrap_or('\u{fffd}')).collect();
            cloud.crs = Some(text).filter(|t| !t.is_empty());
        }
    } else if !array.text() {
        let mut value = Vec::new();
        numbers(path, archive, array)?.append_f64(0, &mut value);
        cloud.metres_per_unit = value.first().copied().filter(|m| m.is_finite() && *m > 0.0);
    }
    Ok(())
}

fn array4(bytes: &[u8]) -> [u8; 4] {
    array(bytes, 0)
}
