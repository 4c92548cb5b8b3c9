//! Reads a written file back before it gets its final name.

use super::atomic::AtomicFile;
use super::reader::BlockReader;
use super::{Bounds, Columns, ReadOptions, WriteOptions};
use crate::cloud::{Cloud, around};
use crate::error::{Error, Result};
use std::path::Path;

/// Number of points in a block.
const BLOCK: usize = 65_536;

/// Gives a file its final name if `open`, the reader of its format, returns as many points as the cloud has, with the
/// same bounds.
///
/// Time linear in the points; memory for a block (npz: the coordinates).
pub(super) fn finish<R: BlockReader>(
    mut file: AtomicFile,
    cloud: &Cloud,
    options: &WriteOptions,
    open: impl FnOnce(&Path, &ReadOptions) -> Result<R>,
) -> Result<()> {
    file.flush()?;
    let columns = Columns::Only(Vec::new());
    let read = ReadOptions { columns, monitor: options.monitor.clone(), ..ReadOptions::default() };
    let found = open(file.partial(), &read).and_then(|reader| again(reader, options)).map_err(|e| match e {
        Error::Interrupted | Error::Memory { .. } => e,
        e => {
            // The temporary name means nothing to the user.
            let reason = e.to_string().replace(&format!("{}: ", file.partial().display()), "");
            Error::input(format!("{}: what was written cannot be read: {reason}", file.target().display()))
        }
    })?;
    let expected = (cloud.len(), cloud.bounds_watched(&options.monitor)?);
    if found.0 != expected.0 || !alike(found.1, expected.1) {
        let text =
            format!("wrote {} points in {:?}, but {} in {:?} can be read", expected.0, expected.1, found.0, found.1);
        return Err(Error::input(format!("{}: {text}", file.target().display())));
    }
    file.finish()
}

/// Number and bounds of the points of a file.
fn again(mut reader: impl BlockReader, options: &WriteOptions) -> Result<(usize, Option<Bounds>)> {
    options.monitor.stage("check", 0);
    let (mut points, mut bounds) = (0, None);
    loop {
        options.monitor.check()?;
        let block = reader.take(BLOCK)?;
        if block.is_empty() {
            return Ok((points, bounds));
        }
        points += block.len();
        bounds = match (bounds, block.bounds()) {
            (Some(a), Some(b)) => Some(around(a, b)),
            (a, b) => a.or(b),
        };
    }
}

/// Equal up to the rounding of text output.
fn alike(a: Option<Bounds>, b: Option<Bounds>) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-7 + 1e-12 * b.abs();
    match (a, b) {
        (Some(a), Some(b)) => (0..3).all(|i| near(a[0][i], b[0][i]) && near(a[1][i], b[1][i])),
        (a, b) => a.is_none() && b.is_none(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::text;

    #[test]
    fn a_file_that_does_not_hold_the_cloud_gets_no_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xyz");
        let cloud = Cloud::from_rows(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).unwrap();
        for (text, expected) in [
            ("x y z\n1 2 3\n", "but 1 in"),
            ("x y z\n1 2 3\n4 5 6.5\n", "6.5"),
            ("x y z\n1 2 3\n4 5 six\n", "cannot be read"),
        ] {
            let mut file = AtomicFile::create(&path).unwrap();
            file.write_all(text.as_bytes()).unwrap();
            let message = finish(file, &cloud, &WriteOptions::default(), text::Reader::open).unwrap_err().to_string();
            assert!(message.contains("a.xyz: ") && message.contains(expected), "{message}");
            assert!(!message.contains("partial"), "{message}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"x y z\n1 2 3\n4 5 6\n").unwrap();
        finish(file, &cloud, &WriteOptions::default(), text::Reader::open).unwrap();
        assert!(path.exists());
    }
}
