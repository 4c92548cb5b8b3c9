//! The meaning of the columns of a text file.

use super::bad;
use crate::cloud::{MOST_COLUMNS, names};
use crate::error::{Mismatch, Result};
use crate::io::format;
use crate::io::lines::words::Words;
use crate::io::lines::{Pieces, count, lines};
use crate::io::table::known;
use crate::io::table::limits::Names;
use crate::memory;
use std::path::Path;

/// The meaning of the numbers in a line.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) names: Vec<String>,
    /// Indices of the columns x, y and z.
    pub(super) axes: [usize; 3],
    /// Number of points in the first line of PTS.
    pub(super) declared: Option<u64>,
    /// The first line, shortened, if names were given to its columns only by their number.
    pub(super) guessed: Option<String>,
    /// Whether decimals are written with commas.
    pub(super) decimal_commas: bool,
}

/// Names of the axes in header rows, by preference.
const AXES: [&[&str]; 3] = [
    &["x", "easting", "east", "e"],
    &["y", "northing", "north", "n"],
    &["z", "elevation", "elev", "height", "altitude", "alt", "h"],
];
/// Characters of the first line that are shown.
const SHOWN: usize = 60;

/// Finds the layout from the first non-blank line. Returns it, the rest of its piece from the first data row on, and
/// the number of lines before. `given` are names for the columns, which replace those of a header row.
pub(super) fn find(path: &Path, pieces: &mut Pieces, given: &[String]) -> Result<(Layout, Option<Vec<u8>>, usize)> {
    let mut before = 0;
    while let Some(piece) = pieces.next()? {
        let mark = if before == 0 && piece.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        let piece = &piece[mark..];
        let (mut at, mut declared) = (0, None);
        for (line, number) in lines(piece).zip(before + 1..) {
            let next = (at + line.len() + 1).min(piece.len());
            // A comment in the first line may be the header row.
            if super::holds(line) || (number == 1 && line.starts_with(b"//")) {
                let line = line.trim_ascii();
                let whole = std::str::from_utf8(line).ok().and_then(|l| l.parse().ok());
                match whole.filter(|_| declared.is_none() && format::extension(path) == "pts") {
                    Some(n) => declared = Some(n),
                    None => {
                        let (layout, header) = Line { path, number, text: line }.layout(given)?;
                        let from = if header { next } else { at };
                        let above = if header { number } else { number - 1 };
                        let guessed = layout.guessed.filter(|_| declared.is_none());
                        let mut rest = Vec::new();
                        memory::reserve(&mut rest, piece.len() - from, "a piece of a text file")?;
                        rest.extend_from_slice(&piece[from..]);
                        let decimal_commas = lines(&rest).find(|line| super::holds(line)).is_some_and(decimal_commas);
                        return Ok((Layout { declared, guessed, decimal_commas, ..layout }, Some(rest), above));
                    }
                }
            }
            at = next;
        }
        before += count(piece);
        if declared.is_some() {
            return Ok((Layout { declared, ..Layout::bare() }, None, before));
        }
    }
    Ok((Layout::bare(), None, before))
}

impl Layout {
    /// The layout of a file without points.
    fn bare() -> Self {
        Self::named(["x", "y", "z"].map(String::from).to_vec(), [0, 1, 2])
    }

    fn named(names: Vec<String>, axes: [usize; 3]) -> Self {
        Self { names, axes, declared: None, guessed: None, decimal_commas: false }
    }
}

/// Names under which columns are read; of two with the same name the second gets a number.
fn unique(names: &[String], axes: [usize; 3]) -> Vec<String> {
    let mut found: Vec<String> = names.iter().map(|name| known::name(name)).collect();
    let mut taken = Names::default();
    for (i, name) in found.iter_mut().enumerate() {
        if !axes.contains(&i) {
            *name = taken.free(name);
        }
    }
    found
}

/// The first line of a file.
struct Line<'a> {
    path: &'a Path,
    number: usize,
    text: &'a [u8],
}

impl Line<'_> {
    /// The layout according to the line, or to the names given for its columns; and whether it is a header row.
    fn layout(&self, given: &[String]) -> Result<(Layout, bool)> {
        let commas = decimal_commas(self.text);
        if !commas {
            self.refuse_commas()?;
        }
        let head = self.text.strip_prefix(b"//").unwrap_or(self.text);
        let plain: Vec<u8> = head.iter().map(|&b| if commas && b == b',' { b'.' } else { b }).collect();
        let words: Vec<_> = Words::new(&plain).take(MOST_COLUMNS + 4).collect();
        if words.len() > MOST_COLUMNS + 3 {
            let allowed = format!("at most {MOST_COLUMNS} and x, y, z");
            return Err(self.wrong("number of columns", Mismatch::new(Words::new(&plain).count(), allowed)));
        }
        let is_name = |text: &[u8]| text.first().is_some_and(|b| b.is_ascii_alphabetic() || *b == b'_');
        let header = words.iter().any(|w| w.value.is_none() && is_name(w.text));
        let own = || words.iter().map(|w| w.string().trim_matches('"').to_string()).collect::<Vec<_>>();
        match (given, header) {
            ([], true) => Ok((self.by_names(&own())?, true)),
            ([], false) => Ok((self.by_number(words.len())?, false)),
            _ if given.len() != words.len() => {
                let allowed = format!("{} as in the names given for them: {}", given.len(), given.join(", "));
                Err(self
                    .wrong("number of columns", Mismatch::new(format!("{} in {}", words.len(), self.shown()), allowed)))
            }
            _ => Ok((self.by_names(given)?, header)),
        }
    }

    /// Columns with names, x, y and z among them.
    fn by_names(&self, names: &[String]) -> Result<Layout> {
        let named = |wanted: &str| names.iter().position(|n| n.eq_ignore_ascii_case(wanted));
        let axes = AXES.map(|known| known.iter().find_map(|name| named(name)));
        match axes {
            [Some(x), Some(y), Some(z)] => Ok(Layout::named(unique(names, [x, y, z]), [x, y, z])),
            _ => {
                let allowed = "names with x, y and z (or easting, northing and height) among them";
                Err(self.wrong("header row", Mismatch::new(names.join(" "), allowed)))
            }
        }
    }

    /// Columns without names.
    fn by_number(&self, columns: usize) -> Result<Layout> {
        match columns {
            0..3 => {
                let found = format!("{columns} in {}", self.shown());
                Err(self.wrong("number of columns", Mismatch::new(found, "3 or more: x y z ...")))
            }
            _ => {
                let guessed = (columns > 3).then(|| self.shown());
                Ok(Layout { guessed, ..Layout::named(usual_names(columns), [0, 1, 2]) })
            }
        }
    }

    /// Refuses decimal commas beside blanks: `1,5 2,5 3,5` may be six columns. Detected by commas within numbers of a line
    /// that has another separator.
    fn refuse_commas(&self) -> Result<()> {
        let parts = self.text.split(|&b| b.is_ascii_whitespace() || b == b';').filter(|w| !w.is_empty());
        let mut parts = parts.peekable();
        let first = parts.peek().map(|w| String::from_utf8_lossy(w).into_owned()).unwrap_or_default();
        match parts.filter(|w| comma_inside(w)).count() {
            0 | 1 => Ok(()),
            _ => {
                let allowed =
                    "a number; write decimals with a point, not a comma, or separate columns by semicolons or tabs";
                Err(self.wrong("value", Mismatch::new(first, allowed)))
            }
        }
    }

    fn wrong(&self, field: &'static str, mismatch: Mismatch) -> crate::error::Error {
        bad(self.path, field, [self.number, 1], mismatch)
    }

    /// The line, shortened.
    fn shown(&self) -> String {
        let text: String = String::from_utf8_lossy(self.text).chars().take(SHOWN + 1).collect();
        if text.chars().count() > SHOWN { text.chars().take(SHOWN).chain("...".chars()).collect() } else { text }
    }
}

/// Whether a line between whose columns are semicolons or tabs has decimal commas, two or more.
fn decimal_commas(line: &[u8]) -> bool {
    let parts: Vec<&[u8]> = line.split(|&b| b == b';' || b == b'\t').map(<[u8]>::trim_ascii).collect();
    let most_one = parts.iter().all(|part| part.iter().filter(|&&b| b == b',').count() <= 1);
    parts.len() >= 3 && most_one && parts.iter().filter(|part| comma_inside(part)).count() >= 2
}

/// Whether a word is a number with a comma between two digits.
fn comma_inside(word: &[u8]) -> bool {
    let commas = word.iter().filter(|&&b| b == b',').count();
    let digits = word.iter().all(|b| b.is_ascii_digit() || b",+-".contains(b));
    commas == 1 && digits && word.windows(3).any(|t| t[0].is_ascii_digit() && t[1] == b',' && t[2].is_ascii_digit())
}

/// Names of columns without a header row, by their number; 7 columns are those of Semantic3D.
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
