//! Polygons from well-known text (ISO 19125-1): `POLYGON ((0 0, 4 0, 4 4, 0 0), (1 1, 2 1, 2 2, 1 1))`.

use super::Parsed;
use super::polygon::Ring;
use crate::error::{Error, Result};

/// What follows the keyword of a text of polygons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body<'a> {
    /// `(...)`, or `EMPTY`.
    rest: &'a str,
    /// Whether there may be several polygons.
    many: bool,
    /// EPSG code before the keyword.
    code: Option<u16>,
}

/// The polygons in a text, if it begins like one of these.
pub(super) fn polygons_in(text: &str) -> Option<Body<'_>> {
    let text = text.trim();
    let (code, text) = match text.split_once(';') {
        Some((id, rest)) if id.get(..5).is_some_and(|word| word.eq_ignore_ascii_case("SRID=")) => {
            (id[5..].parse().ok(), rest.trim())
        }
        _ => (None, text),
    };
    let end = text.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (word, rest) = text.split_at(end);
    let many = match word.to_ascii_uppercase().as_str() {
        "POLYGON" => false,
        "MULTIPOLYGON" => true,
        _ => return None,
    };
    let rest = rest.trim_start();
    let next = rest.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(rest.len());
    let rest = match rest[..next].to_ascii_uppercase().as_str() {
        "Z" | "M" | "ZM" => rest[next..].trim_start(),
        _ => rest,
    };
    (rest.starts_with('(') || rest.eq_ignore_ascii_case("EMPTY")).then_some(Body { rest, many, code })
}

/// The polygons of a text.
pub(super) fn parsed(text: &str) -> Result<Parsed> {
    let start: String = text.chars().take(40).collect();
    let Some(Body { rest, many, code }) = polygons_in(text) else {
        return Err(Error::input(format!(
            "found {start:?}, expected GeoJSON, POLYGON ((...)) or MULTIPOLYGON (((...)))"
        )));
    };
    let mut lists = Lists { deepest: if many { 3 } else { 2 }, ..Lists::default() };
    for (at, c) in rest.char_indices() {
        lists.take(c).map_err(|what| Error::input(format!("well-known text: {what} at character {}", at + 1)))?;
    }
    if lists.depth > 0 || !lists.closed || !lists.word.is_empty() {
        return Err(Error::input(format!("well-known text: {start:?} has no polygon or no end")));
    }
    Ok(Parsed { polygons: lists.polygons, code })
}

/// Nested lists of corners, read character by character.
#[derive(Debug, Default)]
struct Lists {
    polygons: Vec<Vec<Ring>>,
    /// Numbers of the current corner.
    corner: Vec<f64>,
    /// Characters of the current number.
    word: String,
    /// Open brackets.
    depth: usize,
    /// Open brackets around the corners of a ring.
    deepest: usize,
    /// Whether the last bracket was closed.
    closed: bool,
}

impl Lists {
    fn take(&mut self, c: char) -> std::result::Result<(), String> {
        match c {
            _ if self.closed && !c.is_whitespace() => Err(format!("found {c:?} after the end")),
            '(' if self.depth < self.deepest && self.word.is_empty() => self.open(),
            ')' if self.depth > 0 => self.close(),
            ',' if self.depth == self.deepest => self.end_corner(),
            ',' if self.depth > 0 && self.word.is_empty() => Ok(()),
            c if c.is_whitespace() => self.end_number(),
            c if self.depth == self.deepest && c != '(' => {
                self.word.push(c);
                Ok(())
            }
            c => Err(format!("found {c:?}")),
        }
    }

    fn open(&mut self) -> std::result::Result<(), String> {
        self.depth += 1;
        if self.depth == self.deepest {
            if self.depth == 2 && self.polygons.is_empty() {
                self.polygons.push(Vec::new());
            }
            match self.polygons.last_mut() {
                Some(polygon) => polygon.push(Ring::new()),
                None => return Err("found a ring without a polygon".into()),
            }
        } else if self.depth == 2 {
            self.polygons.push(Vec::new());
        }
        Ok(())
    }

    fn close(&mut self) -> std::result::Result<(), String> {
        if self.depth == self.deepest {
            self.end_corner()?;
        }
        self.depth -= 1;
        self.closed = self.depth == 0;
        Ok(())
    }

    fn end_number(&mut self) -> std::result::Result<(), String> {
        if !self.word.is_empty() {
            let number = self.word.parse().map_err(|_| format!("found {:?}, expected a number", self.word))?;
            self.corner.push(number);
            self.word.clear();
        }
        Ok(())
    }

    fn end_corner(&mut self) -> std::result::Result<(), String> {
        self.end_number()?;
        let place = match self.corner[..] {
            [x, y] | [x, y, _] | [x, y, _, _] => [x, y],
            _ => return Err(format!("found a corner of {} numbers, expected 2 to 4", self.corner.len())),
        };
        self.corner.clear();
        self.polygons.last_mut().and_then(|polygon| polygon.last_mut()).into_iter().for_each(|ring| ring.push(place));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_with_holes_heights_and_codes_are_read() {
        let found = parsed(" polygon((0 0,4 0, 4 4 ,0 0),(1 1, 2 1, 2 1.5e0)) ").unwrap();
        assert_eq!(found.polygons.iter().map(Vec::len).collect::<Vec<_>>(), [2]);
        assert_eq!(found.polygons[0][1], [[1.0, 1.0], [2.0, 1.0], [2.0, 1.5]]);
        let found = parsed(
            "SRID=2154;MULTIPOLYGON Z (((0 0 9, 1 0 9, 1 1 9)),\n((5 5 9, -6.5 5 9, 6 6 9), (5 5 1,6 5 1,6 6 1)))",
        );
        let found = found.unwrap();
        assert_eq!((found.polygons.len(), found.polygons[1].len(), found.code), (2, 2, Some(2154)));
        assert_eq!(found.polygons[1][0][1], [-6.5, 5.0]);
    }

    #[test]
    fn names_of_files_are_no_polygons() {
        assert!(polygons_in("POLYGON((0 0))").is_some() && polygons_in(" multipolygon zm (((0").is_some());
        for name in
            ["polygon.geojson", "polygon", "POLYGON/a.json", "my polygon((.json", "é", "SRID=é;x", "SRI\u{35c};", ""]
        {
            assert!(polygons_in(name).is_none(), "{name}");
        }
    }

    #[test]
    fn malformed_text_is_refused_with_its_place() {
        for (text, said) in [
            ("POLYGON ((0 0, 1 0, 1 x))", "\"x\""),
            ("POLYGON ((0 0, 1 0, 1))", "1 numbers"),
            ("POLYGON ((0 0 0 0 0, 1 0, 1 1))", "5 numbers"),
            ("POLYGON ((0 0, 1 0, 1 1)", "no end"),
            ("POLYGON ((0 0, 1 0, 1 1)))", "after the end"),
            ("POLYGON (((0 0, 1 0, 1 1)))", "'('"),
            ("POLYGON (0 0, 1 0, 1 1)", "'0'"),
            ("POLYGON EMPTY", "'E'"),
            ("LINESTRING (0 0, 1 1)", "POLYGON"),
            ("POLYGON ((0 0,, 1 0))", "0 numbers"),
        ] {
            let message = parsed(text).unwrap_err().to_string();
            assert!(message.contains(said), "{text}: {message}");
        }
    }
}
