//! Runs of the command line in a folder.

use std::path::Path;
use std::process::{Command, Output};

/// The program under test: its path.
#[derive(Clone, Copy, Debug)]
pub struct Program(pub &'static str);

/// Defines for a file of tests those of the functions `scansion`, `done`, `fails` and `ends` that it names: the methods of
/// [`Program`] for the program of this package.
#[macro_export]
macro_rules! program {
    ($($name:ident),+) => {
        const PROGRAM: $crate::program::Program = $crate::program::Program(env!("CARGO_BIN_EXE_scansion-under-test"));
        $($crate::program_run!($name);)+
    };
}

/// One of the functions of [`program!`].
#[macro_export]
macro_rules! program_run {
    (scansion) => {
        fn scansion(folder: &std::path::Path, arguments: &[&str]) -> std::process::Output {
            PROGRAM.run(folder, arguments)
        }
    };
    (done) => {
        fn done(folder: &std::path::Path, arguments: &[&str]) -> String {
            PROGRAM.done(folder, arguments)
        }
    };
    (fails) => {
        fn fails(folder: &std::path::Path, arguments: &[&str], code: i32) -> String {
            PROGRAM.fails(folder, arguments, code)
        }
    };
    (ends) => {
        fn ends(folder: &std::path::Path, arguments: &[&str], code: i32) -> (String, String) {
            PROGRAM.ends(folder, arguments, code)
        }
    };
}

impl Program {
    /// The program with its arguments in a folder, without colours.
    pub fn command(self, folder: &Path, arguments: &[&str]) -> Command {
        let mut command = Command::new(self.0);
        command.args(arguments).current_dir(folder).env("NO_COLOR", "1");
        command
    }

    /// What a run printed, and how it ended.
    pub fn run(self, folder: &Path, arguments: &[&str]) -> Output {
        self.command(folder, arguments).output().unwrap()
    }

    /// Standard output and standard error of a run that ends with this code. Runs that succeed may replace files.
    pub fn ends(self, folder: &Path, arguments: &[&str], code: i32) -> (String, String) {
        // Tests write the same names again.
        let again: &[&str] = if code < 2 && !arguments.contains(&"--overwrite") { &["--overwrite"] } else { &[] };
        let output = self.run(folder, &[arguments, again].concat());
        let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {out}{err}");
        assert!(!err.contains("panicked"), "{err}");
        (out, err)
    }

    /// Standard output of a run that succeeds.
    pub fn done(self, folder: &Path, arguments: &[&str]) -> String {
        self.ends(folder, arguments, 0).0
    }

    /// The message of a run that fails with this code.
    pub fn fails(self, folder: &Path, arguments: &[&str], code: i32) -> String {
        let output = self.run(folder, arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(message.contains("error") && !message.contains("panicked"), "{message}");
        message
    }
}
