//! Identical files, and files that change.

use super::*;
use crate::io::{atomic, open};

const REFUSED: Replace = Replace::Refused("give the output another name");

fn refusing<T>(work: impl FnOnce() -> T) -> T {
    run(Rules { replace: REFUSED, ..Rules::default() }, work)
}

#[cfg(unix)]
#[test]
fn an_input_is_not_written_over_by_whatever_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("a"), "a scan").unwrap();
    std::os::unix::fs::symlink(path("a"), path("soft")).unwrap();
    std::fs::hard_link(path("a"), path("hard")).unwrap();
    std::fs::create_dir(path("b")).unwrap();
    for output in ["a", "soft", "hard", "b/../a"] {
        // Read first and then written, or announced first and then read.
        let message = refusing(|| {
            open::file(&path("a")).unwrap();
            atomic::write_bytes(&path(output), b"new").unwrap_err().to_string()
        });
        assert!(message.contains("input and output") && message.contains(output), "{message}");
        let message = refusing(|| {
            atomic::check_output(&path(output)).unwrap();
            open::file(&path("a")).unwrap_err().to_string()
        });
        assert!(message.contains("input and output") && message.contains(output), "{message}");
    }
    assert_eq!(std::fs::read(path("a")).unwrap(), b"a scan");
    // Another run, and one without the restriction.
    refusing(|| atomic::write_bytes(&path("a"), b"new").unwrap());
    run(Rules::default(), || {
        open::file(&path("a")).unwrap();
        atomic::write_bytes(&path("a"), b"newer").unwrap();
        open::file(&path("a")).unwrap();
    });
    assert_eq!(std::fs::read(path("a")).unwrap(), b"newer");
}

#[test]
fn runs_in_threads_and_runs_in_runs_do_not_mix() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    std::fs::write(&path, "a").unwrap();
    refusing(|| {
        open::file(&path).unwrap();
        std::thread::scope(|s| s.spawn(|| refusing(|| atomic::write_bytes(&path, b"b").unwrap())).join().unwrap());
        refusing(|| atomic::write_bytes(&path, b"c").unwrap());
        assert!(part(|| atomic::write_bytes(&path, b"d")).is_err(), "a part knows the inputs of the whole");
    });
    assert!(CURRENT.with_borrow(Option::is_none));
}

#[test]
fn two_outputs_of_one_name_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    refusing(|| {
        atomic::check_output(&path("a")).unwrap();
        atomic::check_output(&path("b")).unwrap();
        let message = part(|| atomic::check_output(&path("a"))).unwrap_err().to_string();
        assert!(message.contains("an output twice"), "{message}");
        atomic::write_bytes(&path("a"), b"x").unwrap();
    });
}

#[test]
fn a_file_that_is_replaced_or_changed_between_two_readings_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("a"), folder.path().join("b"));
    let change: [&dyn Fn(); 3] =
        [&|| std::fs::rename(&other, &path).unwrap(), &|| std::fs::write(&path, "other").unwrap(), &|| {
            std::fs::write(&path, "longer than before").unwrap()
        }];
    for change in change {
        std::fs::write(&path, "first").unwrap();
        std::fs::write(&other, "first").unwrap();
        run(Rules::default(), || {
            open::file(&path).unwrap();
            open::file(&path).unwrap();
            unchanged(&path).unwrap();
            change();
            assert!(unchanged(&path).unwrap_err().to_string().contains("changed while it was read"));
            assert!(open::file(&path).unwrap_err().to_string().contains("changed while it was read"));
            std::fs::remove_file(&path).unwrap();
            unchanged(&path).unwrap();
        });
    }
}
