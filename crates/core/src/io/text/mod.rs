//! Text: columns of numbers, with or without a header row; Semantic3D's `x y z i r g b` with a `.labels` file; PTS with
//! the number of points in the first line.
//!
//! Separators are blanks, tabs, commas and semicolons. Empty lines and lines that start with `#` are skipped, and after
//! the first line also those with `//`.

mod labels;
mod layout;
mod print;
mod read;
mod rows;
mod write;

use crate::error::{Error, Mismatch};
use std::path::Path;

pub(super) use read::{Reader, inspect, read};
pub(super) use write::write;

/// An error about a word at a line and a column; line 0 stands for the whole file.
fn bad(path: &Path, field: &str, [line, column]: [usize; 2], mismatch: Mismatch) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "text",
        field: field.to_string(),
        place: if line == 0 { "the whole file".into() } else { format!("line {line}:{column}") },
        found: mismatch.found,
        allowed: mismatch.allowed,
    }
}

/// Whether a line after the first contains numbers.
fn holds(line: &[u8]) -> bool {
    let start = line.trim_ascii_start();
    !start.is_empty() && start[0] != b'#' && !start.starts_with(b"//")
}

#[cfg(test)]
mod tests {
    use crate::cloud::{Cloud, Column, Coordinates, Values};
    use crate::error::Result;
    use crate::io::{self, ReadOptions, WriteOptions};

    fn read_text(name: &str, files: &[(&str, &str)]) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
        io::read(&folder.path().join(name))
    }

    #[test]
    fn semantic3d_text_with_labels_is_read() {
        let text = "\u{feff}1.5 2 3 -900 10 20 30\r\n\r\n4 5 nan 7 255 0 1\r\n";
        let cloud = read_text("a.txt", &[("a.txt", text), ("a.labels", "1\n8\n")]).unwrap();
        assert_eq!(cloud.len(), 2);
        assert!(cloud.xyz(1)[2].is_nan());
        assert_eq!(cloud.column("Classification").unwrap().values, Values::U8(vec![1, 8]));
        assert_eq!(cloud.column("Red").unwrap().values, Values::U8(vec![10, 255]));
        assert_eq!(cloud.column("Intensity").unwrap().values, Values::F64(vec![-900.0, 7.0]));
    }

    #[test]
    fn the_second_of_two_columns_with_the_same_name_gets_a_number() {
        let cloud = read_text("a.csv", &[("a.csv", "x,y,z,label,k,class,k\n1,2,3,4,5,6,7\n")]).unwrap();
        let found: Vec<_> = cloud.columns().iter().map(|c| (c.name.as_str(), c.values.get(0))).collect();
        assert_eq!(found, [("Classification", 4.0), ("k", 5.0), ("Classification_2", 6.0), ("k_2", 7.0)]);
    }

    #[test]
    fn header_rows_in_the_usual_forms_are_understood() {
        for head in ["//X Y Z class\n", "x,y,z,Classification\n", "# a comment\nx;y;z;label\n"] {
            let cloud = read_text("a.csv", &[("a.csv", &(head.to_string() + "1 2 3 6\n"))]).unwrap();
            assert_eq!(cloud.column("Classification").unwrap().values, Values::U8(vec![6]), "{head}");
        }
        let plain = read_text("a.xyz", &[("a.xyz", "1 2 3 4 5\n")]).unwrap();
        assert_eq!(plain.columns().iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["C4", "C5"]);
    }

    #[test]
    fn malformed_text_is_an_error_with_line_and_column() {
        for (text, expected) in [
            ("1 2 3\n4 5\n", "line 2:1"),
            ("1 2 3\n4 x5 6\n", "line 2:3"),
            ("1 2 3\n4 1e400 6\n", "line 2:3"),
            ("1.0 2.0 3.0\n1,5 2,5 3,5\n", "not a comma"),
            ("1,5 2,5 3,5\n4,5 5,5 6,5\n", "not a comma"),
            ("a b c\n1 2 3\n", "x, y and z"),
            ("1 2\n", "3 or more"),
        ] {
            let message = read_text("a.txt", &[("a.txt", text)]).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        for labels in ["1\n2\n3\n4\n", "1\n", "1\n256\n", "1\ncar\n"] {
            let message =
                read_text("a.txt", &[("a.txt", "1 2 3\n4 5 6\n"), ("a.labels", labels)]).unwrap_err().to_string();
            assert!(message.contains("a.labels"), "{message}");
        }
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = Cloud::from_rows(&[[652_000.123, 6e6, 1.0], [1.25, -2.5, 3.0]]).unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(vec![2, 6]))).unwrap();
        for name in ["a.txt", "a.csv"] {
            let path = folder.path().join(name);
            io::write(&path, &cloud, &Default::default()).unwrap();
            assert_eq!(io::read(&path).unwrap(), cloud);
        }
        let path = folder.path().join("b.labels");
        io::write(&path, &cloud, &Default::default()).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "2\n6\n");
    }

    #[test]
    fn classes_that_were_written_are_not_replaced_by_old_labels() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3]]).unwrap();
        for labels in ["2\n2\n", "2\n2\n2\n", "car\n"] {
            std::fs::write(folder.path().join("a.labels"), labels).unwrap();
            cloud.set_column(Column::new("Classification", Values::U8(vec![5, 6]))).unwrap();
            let write = WriteOptions::default();
            io::write(&path, &cloud, &write).unwrap();
            assert!(write.monitor.take_warnings().is_empty());
            let read = ReadOptions::default();
            assert_eq!(io::read_with(&path, &read).unwrap(), cloud);
            let told = read.monitor.take_warnings();
            assert!(told.len() == 1 && told[0].contains("a.labels is not read"), "{told:?}");
            assert_eq!(io::inspect(&path).unwrap().dimensions, ["Classification"]);
            cloud.take_column("Classification");
            io::write(&path, &cloud, &write).unwrap();
            let told = write.monitor.take_warnings();
            assert!(told.len() == 1 && told[0].contains("has no classes"), "{told:?}");
        }
    }

    #[test]
    fn fine_coordinates_are_not_rounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let cloud = Cloud::from_rows(&[[5.123_456_789_012, 52.000_000_000_1, 1e-9]]).unwrap();
        io::write(&path, &cloud, &Default::default()).unwrap();
        assert_eq!(io::read(&path).unwrap(), cloud);
        let scaled = Coordinates::Scaled {
            ticks: [vec![512_345_678], vec![65_200_012], vec![-1]],
            scale: [1e-8, 0.01, 0.001],
            offset: [0.0; 3],
        };
        io::write(&path, &Cloud::new(scaled).unwrap(), &Default::default()).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "x y z\n5.12345678 652000.12 -0.001\n");
    }

    #[test]
    fn pts_says_how_many_points_follow() {
        let cloud = read_text("a.pts", &[("a.pts", "2\n1 2 3 -900 10 20 30\n4 5 6 7 40 50 60\n")]).unwrap();
        assert_eq!((cloud.len(), cloud.xyz(1)), (2, [4.0, 5.0, 6.0]));
        assert_eq!(cloud.column("Intensity").unwrap().values.to_f64(), [-900.0, 7.0]);
        assert_eq!(cloud.column("Blue").unwrap().values, Values::U8(vec![30, 60]));
        assert_eq!(read_text("a.pts", &[("a.pts", "0\n")]).unwrap().len(), 0);
        for text in ["3\n1 2 3\n4 5 6\n", "1\n1 2 3\n4 5 6\n", "1\n"] {
            let message = read_text("a.pts", &[("a.pts", text)]).unwrap_err().to_string();
            assert!(message.contains("number of points"), "{message}");
        }
    }

    #[test]
    fn long_files_are_read_in_pieces_with_the_right_lines() {
        let row = |i: u32| format!("{}.25 {} -{i}e-2 {}\n", i, i % 977, i % 7);
        let mut text: String = "# c\nx y z Classification\n".into();
        (0..400_000).for_each(|i| text += &row(i));
        let cloud = read_text("a.xyz", &[("a.xyz", &text)]).unwrap();
        assert_eq!(cloud.len(), 400_000);
        for i in [0, 123_456, 399_999u32] {
            let z: f64 = format!("-{i}e-2").parse().unwrap();
            assert_eq!(cloud.xyz(i as usize), [f64::from(i) + 0.25, f64::from(i % 977), z]);
        }
        assert_eq!(cloud.column("Classification").unwrap().values.get(399_999), f64::from(399_999 % 7));
        let broken = text.clone() + "1 2 q 4\n";
        let message = read_text("a.xyz", &[("a.xyz", &broken)]).unwrap_err().to_string();
        assert!(message.contains("line 400003:5 (found q"), "{message}");
    }

    #[test]
    fn the_lines_are_counted_without_reading_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, "x y z Class\n# c\n1 2 3 4\n\n5 6 7 8").unwrap();
        let info = io::inspect(&path).unwrap();
        assert_eq!((info.points, &info.dimensions[..]), (2, &["Classification".to_string()][..]));
    }
}
