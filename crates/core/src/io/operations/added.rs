//! Whether an output of this name can store edits.

use crate::cloud::names;
use crate::error::{Error, Result};
use crate::io::table::edits::columns;
use crate::io::table::known;
use crate::io::{Edit, check_holds, is_label_name, kitti};
use std::path::Path;

/// Fails if an edit sets a column whose name is that of coordinates, or of what npz holds about the whole cloud.
pub(in crate::io) fn check_free(edits: &[Edit]) -> Result<()> {
    match edits.iter().flat_map(columns).find(|name| known::is_taken(name)) {
        Some(name) => {
            Err(Error::parameter("dimension", name, "a name that neither coordinates nor a whole cloud have"))
        }
        None => Ok(()),
    }
}

/// Fails if the output has class codes alone and the edits change others only.
pub(in crate::io) fn check_kept(output: &Path, edits: &[Edit]) -> Result<()> {
    let set: Vec<&str> = edits.iter().flat_map(columns).collect();
    let kept = |name: &&str| [names::CLASSIFICATION, kitti::INSTANCE].contains(name);
    match set.is_empty() || set.iter().any(kept) {
        true => Ok(()),
        false => check_holds(output, &set.join(", ")),
    }
}

/// What a file of class codes does not keep of a cloud; `None` for other files.
pub(in crate::io) fn lost_in_labels(output: &Path) -> Option<String> {
    is_label_name(output).then(|| "not kept: all but the classes".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Column, Values};
    use crate::io::{self, ReadOptions, WriteOptions};

    fn own(name: &str) -> Edit {
        Edit::Dimension(Column::new(name, Values::U8(vec![1, 2])))
    }

    fn cloud() -> Cloud {
        let mut cloud = Cloud::from_rows(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).unwrap();
        cloud.set_column(Column::new("Intensity", Values::U16(vec![3, 4]))).unwrap();
        cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(vec![3, 4]))).unwrap();
        cloud
    }

    #[test]
    fn edits_of_one_column_are_refused_in_every_format_and_leave_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for from in ["a.las", "a.csv", "a.ply", "a.npz"] {
            io::write(&path(from), &cloud(), &WriteOptions::default()).unwrap();
            for to in ["b.laz", "b.csv", "b.ply", "b.npz", "b.pcd"] {
                let refused = |edits: &[Edit]| {
                    let message = io::rewrite(&path(from), &path(to), edits, &WriteOptions::default()).unwrap_err();
                    assert!(message.to_string().contains("a name that n"), "{from} {to}: {message}");
                    assert!(!path(to).exists(), "{from} {to}");
                };
                refused(&[own("Own"), own("Own")]);
                refused(&[own("Confidence"), own("confidence")]);
                refused(&[Edit::Classification(vec![1, 2]), own("label")]);
                if [from, to] != ["a.las", "b.laz"] {
                    ["xyz", "X", "crs"].into_iter().for_each(|name| refused(&[own(name)]));
                }
            }
        }
        // To change a field is another thing than to add one.
        io::rewrite(&path("a.csv"), &path("c.csv"), &[own("Intensity")], &WriteOptions::default()).unwrap();
        let found = io::read_with(&path("c.csv"), &ReadOptions::default()).unwrap();
        assert_eq!(found.column("Intensity").unwrap().values.to_f64(), [1.0, 2.0]);
    }

    #[test]
    fn a_file_of_classes_alone_takes_no_other_result_and_tells_what_it_lacks() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (from, to) in [("a.las", "b.labels"), ("a.ply", "b.label")] {
            io::write(&path(from), &cloud(), &WriteOptions::default()).unwrap();
            let write = |edits: &[Edit]| io::rewrite(&path(from), &path(to), edits, &WriteOptions::default());
            let message = write(&[own("Own")]).unwrap_err().to_string();
            assert!(message.contains("not Own") && !path(to).exists(), "{message}");
            assert!(io::salvage::copy(&path(from), &path(to), &[own("Own")], &WriteOptions::default()).is_err());
            assert!(!path(to).exists());
            let report = write(&[Edit::Classification(vec![5, 6]), own("Own")]).unwrap();
            assert_eq!(report.notes, ["not kept: all but the classes"]);
        }
    }
}
