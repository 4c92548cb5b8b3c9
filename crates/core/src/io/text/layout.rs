//! The meaning of the columns of a text file.

use super::bad;
use crate::cloud::{MOST_COLUMNS, names};
use crate::error::{Mismatch, Result};
use crate::io::format;
use crate::io::lines::words::Words;
use crate::io::lines::{Pieces, count, lines};
use crate::io::table::known;
use std::path::Path;

/// The meaning of the numbers in a line.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) names: Vec<String>,
    /// Indices of the columns x, y and z.
    pub(super) axes: [usize; 3],
    /// Number of points in the first line of PTS.
    pub(super) declared: Option<u64>,
}

/// Finds the layout from the first non-blank line. Returns it, the rest of its piece from the first data row on, and
/// the number of lines before.
pub(super) fn find(path: &Path, pieces: &mut Pieces) -> Result<(Layout, Option<Vec<u8>>, usize)> {
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
                        let (layout, header) = layout(path, number, line)?;
                        let from = if header { next } else { at };
                        let above = if header { number } else { number - 1 };
                        return Ok((Layout { declared, ..layout }, Some(piece[from..].to_vec()), above));
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
        Self { names: ["x", "y", "z"].map(String::from).to_vec(), axes: [0, 1, 2], declared: None }
    }
}

/// The layout according to the first line, and whether that line is a header row.
fn layout(path: &Path, number: usize, line: &[u8]) -> Result<(Layout, bool)> {
    decimal_comma(path, number, line)?;
    let head = line.strip_prefix(b"//").unwrap_or(line);
    let words: Vec<_> = Words::new(head).take(MOST_COLUMNS + 4).collect();
    if words.len() > MOST_COLUMNS + 3 {
        let allowed = format!("at most {MOST_COLUMNS} and x, y, z");
        return Err(bad(path, "number of columns", [number, 1], Mismatch::new(Words::new(head).count(), allowed)));
    }
    let is_name = |text: &[u8]| text.first().is_some_and(|b| b.is_ascii_alphabetic() || *b == b'_');
    if words.iter().any(|w| w.value.is_none() && is_name(w.text)) {
        let names: Vec<String> = words.iter().map(|w| w.string().trim_matches('"').to_string()).collect();
        let axis = |a: &str| names.iter().position(|n| n.eq_ignore_ascii_case(a));
        let axes = match (axis("x"), axis("y"), axis("z")) {
            (Some(x), Some(y), Some(z)) => [x, y, z],
            _ => {
                return Err(bad(
                    path,
                    "header row",
                    [number, 1],
                    Mismatch::new(names.join(" "), "names with x, y and z among them"),
                ));
            }
        };
        return Ok((Layout { names: names.iter().map(|n| known::name(n)).collect(), axes, declared: None }, true));
    }
    match words.len() {
        0..3 => Err(bad(path, "number of columns", [number, 1], Mismatch::new(words.len(), "3 or more: x y z ..."))),
        n => Ok((Layout { names: usual_names(n), axes: [0, 1, 2], declared: None }, false)),
    }
}

/// Rejects decimal commas: `1,5 2,5 3,5` would be read as six columns. Detected by commas within numbers of a line that
/// has another separator.
fn decimal_comma(path: &Path, number: usize, line: &[u8]) -> Result<()> {
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
        _ => Err(bad(
            path,
            "value",
            [number, 1],
            Mismatch::new(first, "a number; write decimals with a point, not a comma"),
        )),
    }
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
