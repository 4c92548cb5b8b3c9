//! Columns that grow while a file is read, and are returned as clouds.

pub(super) mod edits;
pub(super) mod known;
pub(super) mod limits;
pub(super) mod number;
pub(super) mod packed;

use crate::cloud::{Cloud, Column, Coordinates, Values, each_values};
use crate::error::{Error, Result};
use crate::memory;
use limits::Names;
use number::Kind;

/// Rows that were read but not returned yet; between two calls all columns have the same length.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    pub(super) axes: [Vec<f64>; 3],
    pub(super) columns: Vec<Column>,
}

macro_rules! split {
    ($values:expr, $n:expr, $($variant:ident),*) => {
        match $values { $(Values::$variant(v) => {
            let rest = v.split_off($n.min(v.len()));
            Values::$variant(std::mem::replace(v, rest))
        })* }
    };
}

/// Removes and returns the first `n` values.
pub(super) fn split(values: &mut Values, n: usize) -> Values {
    split!(values, n, U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
}

/// Whether there is room for `n` more values.
pub(super) fn reserve(values: &mut Values, n: usize) -> bool {
    each_values!(values, v => v.try_reserve_exact(n).is_ok())
}

/// Appends zeros.
pub(super) fn pad(values: &mut Values, n: usize) {
    each_values!(values, v => v.resize(v.len() + n, Default::default()));
}

/// The error if there is no memory for `n` points of `width` bytes and these columns.
pub(super) fn missing<'a>(n: usize, width: usize, columns: impl Iterator<Item = &'a Values>) -> Error {
    let width = columns.fold(width, |sum, values| sum + Kind::of(values).size());
    let what = format!("{n} points of {width} bytes");
    Error::Memory { what, needed: (n as u64).saturating_mul(width as u64), free: memory::free() }
}

impl Table {
    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.axes[0].len()
    }

    /// Reserves room for `n` more rows; memory is committed only as rows arrive.
    pub(super) fn reserve(&mut self, n: usize) -> Result<()> {
        let axes = self.axes.iter_mut().all(|axis| axis.try_reserve_exact(n).is_ok());
        match axes && self.columns.iter_mut().all(|column| reserve(&mut column.values, n)) {
            true => Ok(()),
            false => Err(missing(n, 24, self.columns.iter().map(|c| &c.values))),
        }
    }

    /// Removes the first `n` rows (or all there are) and returns them as a cloud.
    pub(super) fn take(&mut self, n: usize) -> Result<Cloud> {
        if n >= self.len() {
            let columns = self.columns.iter().map(|c| Column::new(&c.name, Kind::of(&c.values).values())).collect();
            return std::mem::replace(self, Self { axes: Default::default(), columns }).cloud();
        }
        let mut axes: [Vec<f64>; 3] = Default::default();
        for (head, axis) in axes.iter_mut().zip(&mut self.axes) {
            let rest = axis.split_off(n.min(axis.len()));
            *head = std::mem::replace(axis, rest);
        }
        let head = |column: &mut Column| Column::new(&column.name, split(&mut column.values, n));
        Self { axes, columns: self.columns.iter_mut().map(head).collect() }.cloud()
    }

    /// All rows as a cloud. The second of two columns with the same name gets a number.
    pub(super) fn cloud(self) -> Result<Cloud> {
        let mut cloud = Cloud::new(Coordinates::Float(self.axes))?;
        let mut names = Names::default();
        for mut column in self.columns {
            column.name = names.free(&column.name);
            cloud.set_column(column)?;
        }
        Ok(cloud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_leave_the_table_in_order() {
        let axes = [0, 1, 2].map(|a| (0..5).map(|i| f64::from(10 * a + i)).collect());
        let mut table = Table { axes, columns: vec![Column::new("A", Values::U8(vec![0, 1, 2, 3, 4]))] };
        let head = table.take(2).unwrap();
        assert_eq!((head.len(), head.xyz(1), table.len()), (2, [1.0, 11.0, 21.0], 3));
        let rest = table.take(9).unwrap();
        assert_eq!(rest.column("A").unwrap().values, Values::U8(vec![2, 3, 4]));
        assert_eq!(table.take(9).unwrap().column("A").unwrap().values, Values::U8(vec![]));
    }
}
