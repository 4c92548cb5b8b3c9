//! Every output is either complete or absent.

use super::leftovers::FORGOTTEN;
use super::*;

#[test]
fn the_old_file_stays_until_the_new_one_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    write_bytes(&path, b"old").unwrap();
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"new").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    drop(file);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the partial file is gone");
    write_bytes(&path, b"new").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
}

#[test]
fn a_missing_folder_is_an_error_that_names_the_target() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent").join("a.txt");
    let message = write_bytes(&path, b"x").unwrap_err().to_string();
    assert!(message.contains("absent/a.txt"), "{message}");
    assert!(write_bytes(folder.path(), b"x").is_err(), "a folder is no target");
}

#[test]
fn a_name_of_any_length_that_the_system_takes_is_written_and_a_longer_one_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a".repeat(255), "é".repeat(127)] {
        check_output(&folder.path().join(&name)).unwrap();
        write_bytes(&folder.path().join(name), b"x").unwrap();
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    assert!(check_output(&folder.path().join("a".repeat(256))).is_err());
    assert!(AtomicFile::create(&folder.path().join("a".repeat(256))).is_err());
}

#[cfg(unix)]
#[test]
fn a_link_to_a_file_that_is_not_there_yet_stays_and_its_target_is_written() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir(path("sub")).unwrap();
    symlink("sub/b", path("a")).unwrap();
    symlink("a", path("first")).unwrap();
    write_bytes(&path("first"), b"x").unwrap();
    assert_eq!(std::fs::read(path("sub/b")).unwrap(), b"x");
    assert!(path("a").is_symlink() && path("first").is_symlink());
    symlink("absent/b", path("nowhere")).unwrap();
    assert!(check_output(&path("nowhere")).unwrap_err().to_string().contains("folder does not exist"));
    symlink("round", path("round")).unwrap();
    assert!(check_output(&path("round")).unwrap_err().to_string().contains("leads back"));
}

#[test]
fn what_killed_runs_have_left_is_removed_unless_it_is_young_held_or_not_ours() {
    let folder = tempfile::tempdir().unwrap();
    let ours = |n: u64| folder.path().join(format!(".out.laz.123-{n:016x}.partial"));
    let foreign = [".other.partial", ".b.12-00.partial", "c.1-0000000000000001.partial"].map(|n| folder.path().join(n));
    let old = std::time::SystemTime::now() - 2 * FORGOTTEN;
    let make = |path: &Path, at| {
        let file = File::create(path).unwrap();
        file.set_modified(at).unwrap();
        file
    };
    drop(make(&ours(1), old));
    let held = make(&ours(2), old);
    held.try_lock().unwrap();
    drop(make(&ours(3), std::time::SystemTime::now()));
    foreign.iter().for_each(|path| drop(make(path, old)));
    check_output(&folder.path().join("new.laz")).unwrap();
    assert!(!ours(1).exists());
    assert!(ours(2).exists() && ours(3).exists() && foreign.iter().all(|path| path.exists()));
    drop(held);
}

#[cfg(unix)]
#[test]
fn links_are_followed_permissions_kept_and_devices_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (path, link) = (folder.path().join("a.txt"), folder.path().join("link.txt"));
    write_bytes(&path, b"old").unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
    std::os::unix::fs::symlink(&path, &link).unwrap();
    write_bytes(&link, b"new").unwrap();
    assert!(link.is_symlink());
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
    assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    assert!(write_bytes(Path::new("/dev/null"), b"x").unwrap_err().to_string().contains("plain file"));
}

/// All writers, each replacing an old file that must stay until the new one is complete.
#[test]
fn whatever_fails_the_old_output_stays_and_nothing_is_left_behind() {
    use crate::cloud::{Cloud, Column, Values};
    use crate::io::{self, ConvertParams, Edit, WriteOptions};
    let folder = tempfile::tempdir().unwrap();
    let source = tempfile::tempdir().unwrap();
    let rows: Vec<[f64; 3]> = (0..60_000).map(|i| [f64::from(i % 251), f64::from(i / 251), 0.5]).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Height", Values::F32(vec![1.25; rows.len()]))).unwrap();
    let options = WriteOptions::default();
    let packed = WriteOptions { compressed: true, ..Default::default() };
    let mut labelled = cloud.clone();
    labelled.set_column(Column::new("Classification", Values::U8(vec![2; rows.len()]))).unwrap();
    let input = source.path().join("in.laz");
    io::write(&input, &cloud, &options).unwrap();
    let codes = [Edit::Classification(vec![6; rows.len()])];
    type Work<'a> = Box<dyn Fn(&Path) -> Result<()> + 'a>;
    let write = || -> Work<'_> { Box::new(|p| io::write(p, &cloud, &options)) };
    let rewrite = || -> Work<'_> { Box::new(|p| io::rewrite(&input, p, &codes, &options).map(|_| ())) };
    let works: Vec<(&str, Work<'_>)> = vec![
        ("a.las", write()),
        ("a.laz", write()),
        ("a.ply", write()),
        ("a.txt", write()),
        ("a.labels", Box::new(|p| io::write(p, &labelled, &options))),
        ("a.pcd", write()),
        ("c.pcd", Box::new(|p| io::write(p, &cloud, &packed))),
        ("a.npz", write()),
        ("c.npz", Box::new(|p| io::write(p, &cloud, &packed))),
        ("b.las", rewrite()),
        ("b.laz", rewrite()),
        ("c.las", Box::new(|p| io::convert(&input, p, &ConvertParams::default(), &options).map(|_| ()))),
        ("d.laz", Box::new(|p| io::merge(&[input.clone(), input.clone()], p, &options).map(|_| ()))),
        ("e.laz", Box::new(|p| io::salvage::copy(&input, p, &[], &options).map(|_| ()))),
        // Models, pictures, reports and recipes are bytes in memory.
        ("f.model", Box::new(|p| write_bytes(p, &vec![7; 3 << 20]))),
    ];
    for (name, work) in works {
        let path = folder.path().join(name);
        std::fs::write(&path, b"old").unwrap();
        let steps = fail::at_each(
            || work(&path),
            |done| {
                let bytes = std::fs::read(&path).unwrap();
                assert_eq!(bytes == b"old", !done, "{name}");
                assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{name}: something is left");
                std::fs::write(&path, b"old").unwrap();
            },
        );
        assert!(steps >= 5, "{name}: {steps} steps");
        std::fs::remove_file(&path).unwrap();
    }
}

#[test]
fn a_file_that_appears_while_an_output_is_made_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let rules = |existing| run::Rules { existing, ..run::Rules::default() };
    let late = |existing| {
        run::run(rules(existing), || {
            let _ = std::fs::remove_file(&path);
            let mut file = AtomicFile::create(&path)?;
            file.write_all(b"ours")?;
            std::fs::write(&path, b"theirs").unwrap();
            file.finish()
        })
    };
    let error = late(run::Replace::Refused("use another name")).unwrap_err().to_string();
    assert!(error.contains("it exists; use another name"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), b"theirs");
    late(run::Replace::Allowed).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"ours");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
