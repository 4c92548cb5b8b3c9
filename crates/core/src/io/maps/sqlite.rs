//! A whole SQLite database as bytes: tables that are written once, in the file format 3 of
//! <https://www.sqlite.org/fileformat2.html>.
//!
//! The library itself would need a C compiler and make the program 1.7 MB larger; here a few tables are written,
//! and nothing is read or changed.

use crate::error::{Error, Result};

/// Bytes of a page.
const PAGE: usize = 4096;
/// Bytes at the start of the first page that describe the file.
const HEADER: usize = 100;
/// Largest payload of a table row that is kept in one page, and what is kept of larger ones at least.
const LOCAL: [usize; 2] = [PAGE - 35, (PAGE - 12) * 32 / 255 - 23];
/// Bytes of a row in an overflow page, after the number of the next.
const OVERFLOW: usize = PAGE - 4;
/// Kind of a page with rows of an index.
const INDEX: u8 = 10;
/// Kind of a page of a table above others.
const INTERIOR: u8 = 5;
/// Kind of a page with rows of a table.
const LEAF: u8 = 13;

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Null,
    Integer(i64),
    Real(f64),
    Text(String),
    Blob(Vec<u8>),
}

/// A row: its number, and the value of each column. The value of a column `INTEGER PRIMARY KEY` is the number, and
/// [`Value::Null`] stands in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    pub(super) id: i64,
    pub(super) values: Vec<Value>,
}

/// A table, rows ascending by their numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    pub(super) name: String,
    /// The statement that creates it.
    pub(super) sql: String,
    pub(super) rows: Vec<Row>,
    /// Columns of each key that SQLite keeps an index for, in the order of the statement.
    pub(super) keys: Vec<Vec<usize>>,
}

/// Numbers in the header by which a program knows the kind of the database.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    pub(super) application: u32,
    pub(super) version: u32,
}

/// The bytes of a database with these tables.
///
/// # Errors
/// If the statements, or an index, do not fit into one page.
pub(super) fn database(tables: &[Table], kind: Kind) -> Result<Vec<u8>> {
    let mut pages = Pages::default();
    pages.add();
    let mut schema = Vec::new();
    for table in tables {
        let root = pages.table(&table.rows);
        schema.push(entry("table", [&table.name, &table.name], root, Value::Text(table.sql.clone())));
        for (key, number) in table.keys.iter().zip(1..) {
            let name = format!("sqlite_autoindex_{}_{number}", table.name);
            let root = pages.index(&table.rows, key)?;
            schema.push(entry("index", [&name, &table.name], root, Value::Null));
        }
    }
    let cells: Vec<Vec<u8>> = schema.iter().zip(1..).map(|(values, id)| pages.cell(id, &record(values))).collect();
    if HEADER + 8 + cells.iter().map(|cell| cell.len() + 2).sum::<usize>() > PAGE {
        return Err(Error::input("the description of the tables does not fit into one page of the database"));
    }
    let first = page(LEAF, HEADER, &cells);
    pages.all[0] = first;
    let header = header(kind, pages.all.len() as u32);
    pages.all[0][..HEADER].copy_from_slice(&header);
    Ok(pages.all.concat())
}

/// A row of the table of tables: type, name, table, first page, statement.
fn entry(kind: &str, [name, table]: [&str; 2], root: u32, sql: Value) -> Vec<Value> {
    let text = |text: &str| Value::Text(text.into());
    vec![text(kind), text(name), text(table), Value::Integer(root.into()), sql]
}

/// The pages of a database; the first has number 1.
#[derive(Debug, Default)]
struct Pages {
    all: Vec<Vec<u8>>,
}

impl Pages {
    /// Adds an empty page and returns its number.
    fn add(&mut self) -> u32 {
        self.all.push(vec![0; PAGE]);
        self.all.len() as u32
    }

    fn push(&mut self, page: Vec<u8>) -> u32 {
        self.all.push(page);
        self.all.len() as u32
    }

    /// Writes the rows of a table; returns the number of its first page.
    fn table(&mut self, rows: &[Row]) -> u32 {
        let cells: Vec<Cell> =
            rows.iter().map(|row| Cell { last: row.id, bytes: self.cell(row.id, &record(&row.values)) }).collect();
        let mut level: Vec<Cell> = Vec::new();
        for group in groups(&cells) {
            let bytes: Vec<Vec<u8>> = group.iter().map(|cell| cell.bytes.clone()).collect();
            let number = self.push(page(LEAF, 0, &bytes));
            level.push(Cell::above(number, group.last().map_or(0, |cell| cell.last)));
        }
        while level.len() > 1 {
            let mut above = Vec::new();
            for group in groups(&level) {
                let number = self.push(interior(group));
                above.push(Cell::above(number, group.last().map_or(0, |cell| cell.last)));
            }
            level = above;
        }
        level.first().map_or_else(|| self.push(page(LEAF, 0, &[])), |root| root.page())
    }

    /// Writes an index of a few rows; returns the number of its page.
    fn index(&mut self, rows: &[Row], key: &[usize]) -> Result<u32> {
        let of = |row: &Row| {
            let mut values: Vec<Value> = key.iter().map(|&column| row.values[column].clone()).collect();
            values.push(Value::Integer(row.id));
            let payload = record(&values);
            [varint(payload.len() as u64), payload].concat()
        };
        let cells: Vec<Vec<u8>> = rows.iter().map(of).collect();
        if 8 + cells.iter().map(|cell| cell.len() + 2).sum::<usize>() > PAGE / 4 {
            return Err(Error::input("an index of the database does not fit into one page"));
        }
        Ok(self.push(page(INDEX, 0, &cells)))
    }

    /// The cell of a row; what does not fit is written to overflow pages.
    fn cell(&mut self, id: i64, payload: &[u8]) -> Vec<u8> {
        let [most, least] = LOCAL;
        let local = match payload.len() {
            length if length <= most => length,
            length => Some(least + (length - least) % OVERFLOW).filter(|&k| k <= most).unwrap_or(least),
        };
        let mut cell = [varint(payload.len() as u64), varint(id.cast_unsigned())].concat();
        cell.extend(&payload[..local]);
        if local < payload.len() {
            let parts = payload[local..].chunks(OVERFLOW);
            let (first, count) = (self.all.len() as u32 + 1, parts.len() as u32);
            cell.extend(first.to_be_bytes());
            for (part, next) in parts.zip(first + 1..) {
                let next = if next < first + count { next } else { 0 };
                let mut page = [&next.to_be_bytes()[..], part].concat();
                page.resize(PAGE, 0);
                self.push(page);
            }
        }
        cell
    }
}

/// A cell of a page, and the greatest row number in it or below it.
#[derive(Clone, Debug)]
struct Cell {
    last: i64,
    bytes: Vec<u8>,
}

impl Cell {
    /// The cell for a page one level below.
    fn above(page: u32, last: i64) -> Self {
        Self { last, bytes: [&page.to_be_bytes()[..], &varint(last.cast_unsigned())].concat() }
    }

    /// The page that a cell of [`Cell::above`] stands for.
    fn page(&self) -> u32 {
        u32::from_be_bytes([self.bytes[0], self.bytes[1], self.bytes[2], self.bytes[3]])
    }
}

/// Divides cells into runs that fit into a page.
fn groups(cells: &[Cell]) -> Vec<&[Cell]> {
    let (mut found, mut start, mut room) = (Vec::new(), 0, PAGE - 12);
    for (i, cell) in cells.iter().enumerate() {
        let need = cell.bytes.len() + 2;
        if need > room {
            found.push(&cells[start..i]);
            (start, room) = (i, PAGE - 12);
        }
        room -= need;
    }
    found.extend(Some(&cells[start..]).filter(|rest| !rest.is_empty()));
    found
}

/// A page above others: the last of them is named in its header, the others in cells.
fn interior(children: &[Cell]) -> Vec<u8> {
    let Some((last, others)) = children.split_last() else { return vec![0; PAGE] };
    let cells: Vec<Vec<u8>> = others.iter().map(|cell| cell.bytes.clone()).collect();
    let mut page = page(INTERIOR, 0, &cells);
    page[8..12].copy_from_slice(&last.page().to_be_bytes());
    page
}

/// A page with these cells, which fit into it; they start at the end of the page, their places at its beginning.
fn page(kind: u8, start: usize, cells: &[Vec<u8>]) -> Vec<u8> {
    let mut page = vec![0; PAGE];
    let mut pointer = start + if kind == INTERIOR { 12 } else { 8 };
    let mut at = PAGE;
    for cell in cells {
        at -= cell.len();
        page[at..at + cell.len()].copy_from_slice(cell);
        page[pointer..pointer + 2].copy_from_slice(&(at as u16).to_be_bytes());
        pointer += 2;
    }
    page[start] = kind;
    page[start + 3..start + 5].copy_from_slice(&(cells.len() as u16).to_be_bytes());
    page[start + 5..start + 7].copy_from_slice(&(at as u16).to_be_bytes());
    page
}

/// A record: types and lengths of the values, then the values.
fn record(values: &[Value]) -> Vec<u8> {
    let (mut types, mut body) = (Vec::new(), Vec::new());
    for value in values {
        types.extend(varint(match value {
            Value::Null => 0,
            Value::Integer(_) => 6,
            Value::Real(_) => 7,
            Value::Text(text) => 13 + 2 * text.len() as u64,
            Value::Blob(bytes) => 12 + 2 * bytes.len() as u64,
        }));
        match value {
            Value::Null => {}
            Value::Integer(number) => body.extend(number.to_be_bytes()),
            Value::Real(number) => body.extend(number.to_be_bytes()),
            Value::Text(text) => body.extend(text.as_bytes()),
            Value::Blob(bytes) => body.extend(bytes),
        }
    }
    // The length of the types includes its own.
    let own = if types.len() < 127 { 1 } else { 2 };
    [varint((types.len() + own) as u64), types, body].concat()
}

/// A number in 7 bits a byte, the highest first; all but the last byte have the eighth bit set, and a ninth has 8 bits.
fn varint(number: u64) -> Vec<u8> {
    if number >> 56 != 0 {
        let high = (0..8).map(|i| 0x80 | (number >> (57 - 7 * i)) as u8 & 0x7f);
        return high.chain([number as u8]).collect();
    }
    let bytes = (64 - (number | 1).leading_zeros()).div_ceil(7);
    let of = |i: u32| (number >> (7 * i)) as u8 & 0x7f | if i > 0 { 0x80 } else { 0 };
    (0..bytes).rev().map(of).collect()
}

fn header(kind: Kind, pages: u32) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..16].copy_from_slice(b"SQLite format 3\0");
    header[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
    // Versions of the format for writing and reading, no reserved bytes, and three fixed numbers.
    header[18..24].copy_from_slice(&[1, 1, 0, 64, 32, 32]);
    // Number of changes; pages; schema cookie; schema format; text encoding UTF-8; user version; application; the change
    // that the number of pages belongs to; version of the library that could have written it.
    let numbers = [
        (24, 1),
        (28, pages),
        (40, 1),
        (44, 4),
        (56, 1),
        (60, kind.version),
        (68, kind.application),
        (92, 1),
        (96, 3_040_001),
    ];
    for (at, number) in numbers {
        header[at..at + 4].copy_from_slice(&u32::to_be_bytes(number));
    }
    header
}
