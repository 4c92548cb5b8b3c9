//! Comparison of two files, field by field: shows that nothing was lost.

mod clouds;
mod header;
mod points;
mod tally;

pub(super) use clouds::compare;

use crate::cloud::rounding;
use crate::error::Result;
use crate::io::{ReadOptions, las};
use serde::Serialize;
use std::path::Path;

/// A property that both files have, with different values, as text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Changed {
    /// Name of the property.
    pub name: String,
    /// Value in the first file; `absent` if it has none.
    pub a: String,
    /// Value in the second file; `absent` if it has none.
    pub b: String,
}

impl Changed {
    fn new(name: impl Into<String>, a: impl ToString, b: impl ToString) -> Self {
        Self { name: name.into(), a: a.to_string(), b: b.to_string() }
    }
}

/// A field of the points that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldDifference {
    /// PDAL's dimension name.
    pub name: String,
    /// Number of points whose values differ.
    pub differing: u64,
    /// Index of the first of them, from 0.
    pub first: u64,
    /// Largest difference between two finite values, in the field's unit; NaN (null in JSON) if no such values differ.
    pub largest: f64,
    /// Number of points whose value is a finite number in one of the files only.
    pub one_sided: u64,
}

/// A pair of class codes and the number of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ClassChange {
    /// Code in the first file.
    pub from: u8,
    /// Code in the second file.
    pub to: u8,
    /// Number of points; pairs with `from == to` are unchanged.
    pub points: u64,
}

/// All differences between two files; empty fields are equal in both.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Difference {
    /// Number of points of the first and of the second file.
    pub points: [u64; 2],
    /// Number of points compared, in the order of the files: the smaller of the two counts.
    pub compared: u64,
    /// Header fields, except those that follow from the compression of the points (LAS or LAZ).
    pub header: Vec<Changed>,
    /// Variable length records (VLR, EVLR), by user, number and content.
    pub records: Vec<Changed>,
    /// Fields of the points that differ.
    pub fields: Vec<FieldDifference>,
    /// Fields that exist only in the first file, and only in the second.
    pub only_in: [Vec<String>; 2],
    /// Fields whose type differs.
    pub types: Vec<Changed>,
    /// All pairs of class codes from 0 to 255 that occur, if any class differs.
    pub classes: Vec<ClassChange>,
}

impl Difference {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        let Self { points, compared: _, header, records, fields, only_in, types, classes } = self;
        let same_fields = fields.is_empty() && types.is_empty() && classes.is_empty();
        points[0] == points[1]
            && header.is_empty()
            && records.is_empty()
            && same_fields
            && only_in.iter().all(Vec::is_empty)
    }

    /// The differences in one sentence.
    pub fn summary(&self) -> String {
        if self.is_empty() {
            return format!("same: {} points, every field, header and records", self.compared);
        }
        let mut parts = Vec::new();
        if self.points[0] != self.points[1] {
            parts.push(format!("{} points became {}", self.points[0], self.points[1]));
        }
        let one_sided = |f: &FieldDifference| match f.one_sided {
            0 => String::new(),
            count => format!(" ({count} of them have a number in one file only)"),
        };
        let fields = self.fields.iter();
        parts.extend(fields.map(|f| format!("{} in {} points{}", f.name, f.differing, one_sided(f))));
        for (names, word) in self.only_in.iter().zip(["gone", "new"]) {
            if !names.is_empty() {
                parts.push(format!("{word}: {}", names.join(" ")));
            }
        }
        for (list, one) in [(&self.types, "type of"), (&self.header, "header:"), (&self.records, "record")] {
            parts.extend(list.iter().map(|c| format!("{one} {}", c.name)));
        }
        let only = if parts.len() == 1 { "only " } else { "" };
        format!("{only}{}{}", parts.join(", "), if parts.len() == 1 { " differs" } else { " differ" })
    }
}

/// Largest difference of equal coordinates on different grids: their rounding, for coordinates and offsets up to `most`,
/// but not more than a thousandth of the finer tick.
fn grid_tolerance(finest: f64, most: f64) -> f64 {
    rounding(most).min(1e-3 * finest)
}

/// Compares two files point by point, in their order. Time linear in the points; memory a few blocks of points for LAS
/// and LAZ, both clouds for other formats.
///
/// Fields are compared bit by bit; numbers of different types (`u8` and `f32`) by value; coordinates on different grids
/// with a tolerance of their rounding, at most a thousandth of the finer tick; scan angles in the two units of LAS with a tolerance of half a
/// unit.
///
/// All columns are compared; of the options the unit, the names of the columns of text and the monitor count.
///
/// # Errors
/// If a file cannot be read or the work was cancelled.
pub fn diff(a: &Path, b: &Path, options: &ReadOptions) -> Result<Difference> {
    crate::io::run::joined(&options.monitor, || match las::is_las(a)? && las::is_las(b)? {
        true => points::diff(a, b, &options.monitor),
        false => clouds::diff(a, b, options),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Column, Values};
    use crate::io::{self, Edit, WriteOptions};
    use std::path::PathBuf;

    fn file(folder: &Path, name: &str) -> PathBuf {
        let rows: Vec<[f64; 3]> = (0..1000).map(|i| [f64::from(i % 37), f64::from(i / 37), f64::from(i % 5)]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        let codes = (0..1000).map(|i| [2, 5, 6][i % 3]).collect();
        cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
        cloud.set_column(Column::new("Height", Values::F32((0..1000).map(|i| i as f32).collect()))).unwrap();
        let path = folder.join(name);
        io::write(&path, &cloud, &WriteOptions::default()).unwrap();
        path
    }

    fn compare(a: &Path, b: &Path) -> Difference {
        diff(a, b, &ReadOptions::default()).unwrap()
    }

    #[test]
    fn a_file_and_its_compressed_copy_are_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (file(folder.path(), "a.las"), folder.path().join("b.laz"));
        io::rewrite(&a, &b, &[], &WriteOptions::default()).unwrap();
        let found = compare(&a, &b);
        assert!(found.is_empty(), "{found:?}");
        assert_eq!((found.points, found.compared), ([1000, 1000], 1000));
    }

    #[test]
    fn only_the_classes_that_were_changed_differ() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (file(folder.path(), "a.laz"), folder.path().join("b.laz"));
        let codes = (0..1000).map(|i| if i % 10 == 4 { 9 } else { [2, 5, 6][i % 3] }).collect();
        io::rewrite(&a, &b, &[Edit::Classification(codes)], &WriteOptions::default()).unwrap();
        let found = compare(&a, &b);
        assert_eq!(found.summary(), "only Classification in 100 points differs");
        assert_eq!(found.fields[0].first, 4);
        let changed: u64 = found.classes.iter().filter(|c| c.from != c.to).map(|c| c.points).sum();
        assert_eq!((changed, found.classes.iter().map(|c| c.points).sum::<u64>()), (100, 1000));
    }

    #[test]
    fn a_new_dimension_a_changed_header_and_a_changed_record_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (file(folder.path(), "a.las"), folder.path().join("b.las"));
        let added = Column::new("Confidence", Values::F32(vec![0.5; 1000]));
        io::rewrite(&a, &b, &[Edit::Dimension(added)], &WriteOptions::default()).unwrap();
        let mut bytes = std::fs::read(&b).unwrap();
        bytes[30] ^= 1;
        std::fs::write(&b, bytes).unwrap();
        let found = compare(&a, &b);
        assert_eq!(found.only_in, [vec![], vec!["Confidence".to_string()]]);
        let names = |list: &[Changed]| list.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&found.header), ["system identifier", "record length"]);
        assert_eq!(names(&found.records), ["LASF_Spec 4"]);
        assert!(found.fields.is_empty(), "{found:?}");
    }

    #[test]
    fn files_of_other_formats_are_compared_by_their_columns() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (file(folder.path(), "a.ply"), file(folder.path(), "b.laz"));
        let found = compare(&a, &b);
        assert!(found.fields.is_empty(), "{found:?}");
        let mut cloud = io::read(&a).unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(vec![2; 1000]))).unwrap();
        let c = folder.path().join("c.ply");
        io::write(&c, &cloud, &WriteOptions::default()).unwrap();
        let found = compare(&a, &c);
        assert_eq!((found.fields.len(), found.fields[0].differing), (1, 666));
    }

    #[test]
    fn points_that_a_coarse_grid_moved_differ() {
        let folder = tempfile::tempdir().unwrap();
        let mut rows: Vec<[f64; 3]> = (0..1000).map(|i| [f64::from(i) * 1e-3, 0.25, 0.5]).collect();
        rows.push([1e8; 3]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        let [a, b, c] = ["a.txt", "b.las", "c.las"].map(|name| folder.path().join(name));
        io::write(&a, &cloud, &WriteOptions::default()).unwrap();
        for (path, scale) in [(&b, 1000.0), (&c, 2000.0)] {
            io::write(path, &cloud, &WriteOptions { scale: Some([scale; 3]), ..WriteOptions::default() }).unwrap();
        }
        let found = compare(&a, &b);
        let moved = |name: &str| found.fields.iter().find(|f| f.name == name).map(|f| f.differing);
        assert_eq!(["X", "Y", "Z"].map(moved), [Some(999), Some(1000), Some(1000)]);
        assert!(compare(&b, &c).fields.is_empty(), "the same places on two grids");
    }

    #[test]
    fn files_of_different_lengths_are_compared_as_far_as_both_go() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (file(folder.path(), "a.laz"), folder.path().join("b.las"));
        let cloud = io::read(&a).unwrap().select(&(0..990).collect::<Vec<u32>>());
        io::write(&b, &cloud, &WriteOptions::default()).unwrap();
        let found = compare(&a, &b);
        assert_eq!((found.points, found.compared, found.is_empty()), ([1000, 990], 990, false));
        assert!(found.fields.is_empty());
        assert!(found.summary().contains("1000 points became 990"), "{}", found.summary());
    }
}
