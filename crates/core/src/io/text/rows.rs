//! Rows of numbers from a part of a file.

use super::holds;
use crate::io::lines::words::{Word, Words, separator};
use crate::io::lines::{count, lines};
use crate::memory;

/// An error in a line: its number within the part, from 1, and the column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) line: usize,
    pub(super) column: usize,
    pub(super) field: &'static str,
    pub(super) found: String,
    pub(super) allowed: String,
}

/// Room for so many columns of a part whose rows have `width` numbers.
pub(super) fn room(part: &[u8], width: usize, columns: usize) -> crate::Result<Vec<Vec<f64>>> {
    // Each number takes at least a digit and a separator; lines may be empty.
    let rows = (count(part) + 1).min(part.len() / (2 * width).max(1) + 1);
    let mut out = vec![Vec::new(); columns];
    out.iter_mut().try_for_each(|column| memory::reserve(column, rows, "the numbers of a text file"))?;
    Ok(out)
}

/// Reads the rows of a part into columns. `targets` gives for each number of a row its column, if it is needed.
pub(super) fn read(part: &[u8], targets: &[Option<usize>], mut out: Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, Fault> {
    for (number, line) in (1..).zip(lines(part)) {
        if holds(line) {
            row(line, targets, &mut out).map_err(|fault| Fault { line: number, ..fault })?;
        }
    }
    Ok(out)
}

fn row(line: &[u8], targets: &[Option<usize>], columns: &mut [Vec<f64>]) -> Result<(), Fault> {
    let mut words = Words::new(line);
    for (read, target) in targets.iter().enumerate() {
        let Some(word) = words.next() else { return Err(columns_fault(line, read, targets.len())) };
        let Some(value) = word.value else { return Err(value_fault(&word)) };
        if let Some(column) = target.and_then(|c| columns.get_mut(c)) {
            column.push(value);
        }
    }
    match words.next() {
        None => Ok(()),
        Some(Word { value: None, .. }) => match words.find(|w| w.value.is_none()) {
            Some(word) => Err(value_fault(&word)),
            None => Err(columns_fault(line, Words::new(line).count(), targets.len())),
        },
        Some(_) => Err(columns_fault(line, Words::new(line).count(), targets.len())),
    }
}

fn value_fault(word: &Word<'_>) -> Fault {
    Fault { line: 0, column: word.at, field: "value", found: word.string(), allowed: "a number".into() }
}

fn columns_fault(line: &[u8], found: usize, expected: usize) -> Fault {
    let comma = line.contains(&b',')
        && line.trim_ascii().iter().any(|&b| b != b',' && separator(b))
        && !line.windows(2).any(|w| w == b", ");
    let allowed = match comma {
        true => format!("{expected}; write decimals with a point, not a comma"),
        false => format!("{expected} as in the first line"),
    };
    Fault { line: 0, column: 1, field: "columns", found: found.to_string(), allowed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_go_to_the_wanted_columns() {
        let read = |part: &[u8], targets: &[Option<usize>], columns| {
            read(part, targets, room(part, targets.len(), columns).unwrap())
        };
        let rows = read(b"1 2 3\r\n# 9\n\n 4,5;6\n// 7\n7 8 9", &[Some(1), None, Some(0)], 2).unwrap();
        assert_eq!(rows, [[3.0, 6.0, 9.0], [1.0, 4.0, 7.0]]);
        let fault = read(b"1 2 3\n\n1 2\n", &[None, None, Some(0)], 1).unwrap_err();
        assert_eq!((fault.line, fault.found.as_str()), (3, "2"));
    }
}
